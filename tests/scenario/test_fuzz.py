"""Whatever a file holds: a scenario comes of it, or a refusal of one line."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.scenario import Scenario

TOML = b"""title = "a"
years = 10
seed = 3
[plot]
size_m = [10, 10]
boundary = "periodic"
[climate]
extreme_years = [{year = 2001, factor = 0.5}]
[environment.shadow]
voxel_m = 0.2
[environment.canopy]
voxel_m = 1.0
[environment.markers]
clouds = ["map.csv", [1, 2, 3]]
envelope = [{shape = "box", center_m = [5, 5, 5], size_m = [4, 4, 4]}]
[species.picea_abies]
share = 2
base = "picea_abies"
carbon.sapwood_years = 20
shoots.tropism_factor_by_age = [[0, 1], [20, 2]]
sources.carbon.sapwood_years = "x"
[planting]
kind = "stem_map"
file = "map.csv"
species = "picea_abies"
[[obstacles]]
kind = "box"
min_m = [0, 0, 0]
max_m = [1, 1, 1]
[[acts]]
kind = "prune"
year = 2003
tree_ids = [1, 2]
side_deg = 90
within_deg = 30
[[acts]]
kind = "fell"
year = 2004
tree_ids = [3]
[[acts]]
kind = "plant"
year = 2005
x_m = [1, 2]
y_m = [3, 4]
species = ["picea_abies"]
[[acts]]
kind = "thin"
when = "sdi > 900"
from_year = 2002
method = "selective"
crop_trees_ha = 100
species = "picea_abies"
[[acts]]
kind = "harvest"
years = [2006, 2007]
method = "gap"
gap = {kind = "ellipse", x_m = 5, y_m = 5, size_m = [4, 3], azimuth_deg = 30}
[[acts]]
kind = "plant"
every_years = 3
pattern = "random"
density_ha = 500
within = {kind = "polygon", points_m = [[1, 1], [5, 1], [5, 5]]}
[output]
tables = ["trees"]
sample_trees = {ids = [1], dbh_quantiles = [0.5], at_year = 2009}
"""
CSV = b"x_m,y_m,z_m,species\n1,1,1,picea_abies\n2,2,2,\n3,3,3,picea_abies\n"
TOKENS = [
    b"nan", b"-inf", b"1e999", b"-1", b"0", b"true", b'""', b"[]", b"{}", b"[[1]]", b"'x'", b"\n",
    b"\r", b"\x00", b"\xff", b'"\\ud83d"', b"2020-01-01", b"9" * 400, b"9" * 5000, b"[" * 3000,
    b"kind", b"a.b.c=1\n", b"= ", b"[x]\n", b"1_0", b'"', b",", b"'''",
    "ü".encode(), b"\xe2\x80\xa8",
]  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn, original: bytes) -> bytes:
    """Spoil a file: cut, insert, swap and repeat words and lines."""
    rng = random.Random(draw(st.integers(0, 2**32)))
    data = original
    for _ in range(draw(st.integers(1, 4))):
        lines = data.splitlines(keepends=True)
        match draw(st.integers(0, 4)):
            case 0:  # a token in place of some bytes
                at = rng.randrange(len(data) + 1)
                data = data[:at] + draw(st.sampled_from(TOKENS)) + data[at + rng.randrange(4) :]
            case 1 if lines:  # another value
                i = rng.randrange(len(lines))
                key, sign, _ = lines[i].partition(b"=")
                lines[i] = key + sign + draw(st.sampled_from(TOKENS)) + b"\n"
                data = b"".join(lines)
            case 2 if lines:  # a line lost
                lines.pop(rng.randrange(len(lines)))
                data = b"".join(lines)
            case 3 if lines:  # a line elsewhere
                lines.insert(rng.randrange(len(lines)), rng.choice(lines))
                data = b"".join(lines)
            case _:  # cut short
                data = data[: rng.randrange(len(data) + 1)]
    return data


def load(toml: bytes, stem_map: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "map.csv").write_bytes(stem_map)
        path = Path(folder) / "stand.toml"
        path.write_bytes(toml)
        try:
            scenario = Scenario.load(path)
        except InputError as refusal:
            assert len(str(refusal).splitlines()) == 1
            assert str(refusal).isprintable()
            return
        assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_the_original_is_right() -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "map.csv").write_bytes(CSV)
        assert Scenario.from_toml(TOML.decode(), folder=folder).years == 10


@settings(max_examples=150, deadline=None)
@given(mutated(TOML))
def test_spoilt_toml(toml: bytes) -> None:
    load(toml, CSV)


@settings(max_examples=100, deadline=None)
@given(mutated(CSV))
def test_spoilt_csv(stem_map: bytes) -> None:
    load(TOML, stem_map)


@settings(max_examples=30, deadline=None)
@given(st.binary(max_size=200), st.binary(max_size=200))
def test_noise(toml: bytes, stem_map: bytes) -> None:
    load(toml, CSV)
    load(TOML, stem_map)
