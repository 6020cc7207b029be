"""`forest tree`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.cli import main
from forest.interop import read_simpleforest
from forest.parametric import grow
from forest.species.parametric import parametric_names
from forest.view.parametric_picture import lobed_trunk

_WILD = ("--set", "0SegSplits=9", "--set", "0CurveRes=50", "--set", "clone_habit=1")


def _forest(*words: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["tree", *words])
    return int(end.value.code or 0)


def test_cylinders_are_those_of_the_tree(tmp_path: Path) -> None:
    to = tmp_path / "aspen.csv"
    assert _forest("quaking_aspen", "--seed", "3", "--to", str(to)) == 0
    read, made = read_simpleforest(to), grow("quaking_aspen", 3).skeleton()
    np.testing.assert_array_equal(read.parent, made.parent)
    np.testing.assert_allclose(read.end, made.end, atol=1e-6)
    assert read.order.max() == 2


def test_tubes_and_leaves(tmp_path: Path) -> None:
    import pyvista

    palm = grow("queen_palm", 1)
    for option, leaves in (("--leaves", len(palm.leaves.stem)), ("--no-leaves", 0)):
        to = tmp_path / f"palm{option}.vtp"
        assert _forest("queen_palm", "--seed", "1", option, "--to", str(to)) == 0
        mesh = pyvista.read(to)
        assert int(mesh.cell_data["leaf"].sum()) == 2 * leaves
        assert mesh.bounds[5] == pytest.approx(palm.nodes.position[:, 2].max(), abs=1.5)


def test_a_closed_surface(tmp_path: Path) -> None:
    import trimesh

    to = tmp_path / "cactus.ply"
    assert _forest("saguaro", "--to", str(to)) == 0
    assert trimesh.load(to).is_watertight


def test_picture(tmp_path: Path) -> None:
    to = tmp_path / "lilac.png"
    words = (
        "lilac",
        "--set",
        "1Branches=3",
        "--set",
        "Lobes=3",
        "--set",
        "LobeDepth=0.2",
        "--season",
        "fall",
        "--wind",
        "3",
        "--time",
        "9",
    )
    assert _forest(*words, "--to", str(to)) == 0
    assert to.stat().st_size > 5_000


def test_animation(tmp_path: Path) -> None:
    from PIL import Image

    to = tmp_path / "sway.gif"
    words = (
        "lilac",
        "--set",
        "1Branches=3",
        "--set",
        "Leaves=1",
        "--wind",
        "8",
        "--quality",
        "0.5",
    )
    assert _forest(*words, "--frames", "3", "--seconds", "0.6", "--to", str(to)) == 0
    with Image.open(to) as film:
        assert film.n_frames == 3
        assert film.info["duration"] == 200
        first = np.asarray(film.convert("RGB"))
        film.seek(1)
        assert (np.asarray(film.convert("RGB")) != first).any()


def test_lobes_are_drawn() -> None:
    tree = grow("black_tupelo", 1)
    points, quads = lobed_trunk(tree)
    rings = points.reshape(-1, 36, 3)  # three lobes
    assert len(rings) == tree.stems.nodes[0]
    far = np.linalg.norm(rings - tree.nodes.position[: len(rings), None], axis=2)
    angle = 2.0 * np.pi * np.arange(36) / 36
    share = far[:-1] / tree.nodes.radius[: len(rings) - 1, None]
    np.testing.assert_allclose(share, np.tile(1.0 + 0.1 * np.sin(3.0 * angle), (len(far) - 1, 1)))
    assert len(quads) == 36 * (len(rings) - 1)


def test_species_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert _forest("--list") == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == parametric_names()
    assert len(listed) >= 10


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["quaking_aspn"], "did you mean 'quaking_aspen'?"),
        (["lilac", "--season", "sumer"], "did you mean 'summer'?"),
        (["lilac", "--readings", "mine"], "unknown readings 'mine'"),
        (["lilac", "--to", "lilac.stl"], "unknown format '.stl'"),
        (["lilac", "--seed", "-1"], "seed -1 is not allowed"),
        (["lilac", "--set", "1CurveRes=0"], "level[1].segments: 0 is not allowed"),
        (["lilac", "--set", "ScaleV=4.5"], "smaller than nothing"),
        (["lilac", *_WILD], "more than"),
        (["lilac", "--set", "1Branches=5000", "--set", "2Branches=5000"], "more than"),
        (["lilac", "--quality", "0"], "quality 0 is not allowed"),
        (["lilac", "--wind", "nan"], "wind speed nan is not allowed"),
        (["lilac", "--to", "still.gif"], "nothing moves"),
        (["--to", "x.png"], "--to needs a species; expected forest tree SPECIES"),
        (["--list", "--time-scale", "2"], "--time-scale needs a species"),
        (["--list", "lilac"], "--list takes no species"),
        (["lilac", "--frames", "2", "--to", "z.png"], "--frames is for a .gif; expected --to NAME"),
        (["lilac", "--seconds", "4"], "--seconds is for a .gif"),
    ],
)
def test_refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert _forest(*words) == 2
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1
