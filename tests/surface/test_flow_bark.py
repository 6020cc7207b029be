"""Covers of particles, wounds that heal, and bark as spots and ribbons."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from forest.errors import InputError
from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.surface.export import write_mesh
from forest.surface.flow import (
    FlowBark,
    HealedYear,
    Near,
    Wound,
    WoundRules,
    cover,
    feature_preset,
    features,
    heal,
    preset_for,
    preset_names,
    prune,
    read_preset,
)
from forest.trees.skeleton import Skeleton
from tests.surface.limbs import Limb, branched, pole, tree

RING = 0.006
RINGS = np.repeat([RING, 0.04], [9, 4])


def _everywhere(blend: Blend, height: float, radius: float, n: int = 1500) -> np.ndarray:
    rng = np.random.default_rng(5)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)
    z = rng.uniform(0.1 * height, 0.9 * height, n)
    return blend.project(np.column_stack((radius * np.cos(turn), radius * np.sin(turn), z)))


def _stubbed(radius: float, stub_m: float = 0.23) -> tuple[Skeleton, Wound]:
    skeleton = tree(
        Limb(-1, 0, (0, 0, 0), (0, 0, 1.0), 0.2, 0.19),
        Limb(0, 3, (0, 0, 0.5), (0.8, 0, 0.7), radius, radius, 4),
    )
    return prune(skeleton, 1, stub_m=stub_m)


@pytest.fixture(scope="module")
def healed() -> dict[float, list[HealedYear]]:
    found = {}
    for radius in (0.03, 0.05):
        skeleton, wound = _stubbed(radius)
        found[radius] = heal(skeleton, wound, RINGS, spacing_m=0.4 * radius)
    return found


@pytest.fixture(scope="module")
def flush() -> dict[float, list[HealedYear]]:
    """Wounds of cuts that were meant to be within the stem."""
    found = {}
    for radius in (0.03, 0.05):
        skeleton, wound = _stubbed(radius, 0.05)
        found[radius] = heal(skeleton, wound, np.full(4, RING), spacing_m=0.4 * radius)
    return found


@pytest.fixture(scope="module")
def aspen() -> FlowBark:
    return features(pole(0.1, 0.5), "quaking_aspen", age=70.0, seed=4)


@pytest.fixture(scope="module")
def maple() -> FlowBark:
    near = Near(np.array([0.0, 0.0, 0.4]), 0.25)
    return features(pole(0.1, 0.8), "maple", age=80.0, near=near, spiral_deg=10.0)


# --- covers --------------------------------------------------------------------------------


def test_particles_cover_the_whole_surface() -> None:
    blend = Blend.of(limbs_of(branched()))
    found = cover(blend, 0.03)
    assert np.abs(blend.value(found.place)).max() < 1e-4 * 0.04
    assert found.gaps(_everywhere(blend, 0.8, 0.1)).max() < 0.03
    nearest = cKDTree(found.place).query(found.place, k=2)[0][:, 1]
    assert np.percentile(nearest, 5) > 0.5 * 0.03


def test_one_particle_splits_until_the_surface_is_covered() -> None:
    blend = Blend.of(limbs_of(pole(0.1, 0.5)))
    found = cover(blend, 0.06, start=np.array([0.1, 0.0, 0.2]), rounds=300)
    assert len(found) > 30
    assert found.gaps(_everywhere(blend, 0.5, 0.1)).max() < 0.06


def test_a_cover_hangs_on_its_seed_alone() -> None:
    blend = Blend.of(limbs_of(pole(0.1, 0.5)))
    start = np.array([0.1, 0.0, 0.2])
    one, same, other = (
        cover(blend, 0.06, start=start, rounds=120, seed=seed) for seed in (1, 1, 2)
    )
    assert np.array_equal(one.place, same.place)
    assert not np.array_equal(one.place[:20], other.place[:20])


# --- wounds --------------------------------------------------------------------------------


def test_pruning_leaves_the_rest_of_the_tree() -> None:
    skeleton, wound = _stubbed(0.05)
    assert len(skeleton) == 8
    assert wound.radius_m == pytest.approx(0.05)
    assert np.linalg.norm(wound.middle - (0.0, 0.0, 0.5)) == pytest.approx(0.23)
    with pytest.raises(InputError, match="axis"):
        prune(branched(), 7, stub_m=0.1)
    with pytest.raises(InputError, match="stub_m"):
        prune(branched(), 1, stub_m=5.0)


def test_the_open_face_shrinks_until_it_is_closed(healed: dict[float, list[HealedYear]]) -> None:
    for radius, years in healed.items():
        area = np.array([year.open_m2 for year in years])
        assert area[0] == pytest.approx(np.pi * radius**2, rel=0.01)
        assert (np.diff(area)[area[:-1] > 0.0] < 0.0).all()
        assert area[-1] == 0.0


def _closed_in(years: list[HealedYear]) -> int:
    closed = next(year.year for year in years if year.open_m2 == 0.0)
    assert not any(year.open.any() for year in years[closed:])
    assert all(year.open.any() for year in years[: closed - 1])
    return closed


def test_larger_wounds_and_longer_stubs_take_longer(
    healed: dict[float, list[HealedYear]], flush: dict[float, list[HealedYear]]
) -> None:
    """Flush: 3 and 5 cm at 1.8 cm a year; stubs of 2.9 cm: at 0.45 cm until swallowed."""
    assert [_closed_in(flush[radius]) for radius in (0.03, 0.05)] == [2, 3]
    assert [_closed_in(healed[radius]) for radius in (0.03, 0.05)] == [6, 7]
    skeleton, wound = _stubbed(0.03, 0.26)
    longer = heal(skeleton, wound, np.full(8, RING), spacing_m=0.009)
    assert wound.protrusion_m > 1.5 * healed[0.03][0].surface.wound.protrusion_m
    assert _closed_in(longer) > _closed_in(healed[0.03])


def test_a_cut_within_the_stem_is_made_flush(flush: dict[float, list[HealedYear]]) -> None:
    for radius, years in flush.items():
        wound = years[0].surface.wound
        assert wound.flush and wound.stub_m > 0.19
        stem = years[0].surface.stem
        assert np.abs(stem.value(wound.middle)).max() < 1e-6
        assert years[0].roughness_deg < 1.0  # no stub stands out
        line = np.cross(years[0].cover.place - wound.middle, wound.heading)
        within = np.linalg.norm(line, axis=1) < 0.97 * radius
        assert within.sum() > 10 and years[0].open[within].all()
        rng = np.random.default_rng(3)  # the area as the share of a box around the wound
        n, half = 200_000, 1.5 * radius
        turn = rng.uniform(-half, half, n) / 0.195
        z = wound.middle[2] + rng.uniform(-half, half, n)
        place = np.column_stack((0.195 * np.cos(turn), 0.195 * np.sin(turn), z))
        aside = np.linalg.norm(np.cross(place - wound.middle, wound.heading), axis=1)
        area = (2.0 * half) ** 2 * np.mean(aside < radius)
        assert years[0].open_m2 == pytest.approx(area, rel=0.02)
        assert any(year.roughness_deg > 10.0 for year in years[1:3])  # a roll around a dent


def test_a_limb_within_the_stem_cannot_be_cut() -> None:
    skeleton = tree(
        Limb(-1, 0, (0, 0, 0), (0, 0, 1.0), 0.2, 0.19),
        Limb(0, 3, (0, 0, 0.5), (0.1, 0, 0.5), 0.03, 0.03, 4),
    )
    with pytest.raises(InputError, match="come out"):
        prune(skeleton, 1, stub_m=0.05)


def test_particles_stay_on_the_healing_surface(healed: dict[float, list[HealedYear]]) -> None:
    for years in healed.values():
        for year in years:
            off = np.abs(year.surface.value(year.cover.place))
            assert off.max() < 0.01 * 0.2
        assert years[0].open.any() and not years[-1].open.any()
        last = years[-1]
        ring = 1.2 * last.surface.wound.radius_m * np.random.default_rng(1).normal(size=(200, 3))
        over = last.surface.project(last.surface.wound.middle + 0.3 * ring)
        assert last.cover.gaps(over).max() < 1.2 * last.cover.spacing_m  # still covered


def test_wood_only_ever_grows(healed: dict[float, list[HealedYear]]) -> None:
    rng = np.random.default_rng(2)
    years = healed[0.05]
    points = years[0].surface.wound.middle + rng.uniform(-0.15, 0.15, (3000, 3))
    for before, after in pairwise(years):
        inside = before.surface.value(points) < 0.0
        assert (after.surface.value(points[inside]) < 1e-9).all()


def test_the_healed_surface_is_smooth(healed: dict[float, list[HealedYear]]) -> None:
    for years in healed.values():
        rough = [year.roughness_deg for year in years]
        assert rough[0] > 60.0
        assert rough[-1] < 3.0


def test_wrong_rings_are_refused() -> None:
    skeleton, wound = _stubbed(0.05)
    with pytest.raises(InputError, match="ring_widths_m"):
        heal(skeleton, wound, [0.002, -0.001])
    with pytest.raises(InputError, match="rules"):
        heal(skeleton, wound, [0.002], rules=WoundRules(closing=0.0))


# --- spots and ribbons ---------------------------------------------------------------------


def test_quads_cover_the_surface(aspen: FlowBark) -> None:
    """Every point of the surface lies within a quad, seen along the quad's normal."""
    blend = Blend.of(limbs_of(pole(0.1, 0.5)))
    points = _everywhere(blend, 0.5, 0.1)
    sites, half = aspen.sites, aspen.quad_m
    held = np.zeros(len(points), np.bool_)
    for k in range(len(sites)):
        away = points - sites.place[k]
        held |= (
            (np.abs(away @ sites.across[k]) <= half[k])
            & (np.abs(away @ sites.along[k]) <= half[k])
            & (np.abs(away @ sites.normal[k]) <= half[k])
        )
    assert held.all()
    assert half.max() < 2.0 * sites.spacing_m


def test_faces_look_outward(aspen: FlowBark, maple: FlowBark) -> None:
    for bark, radius in ((aspen, 0.5), (maple, 0.8)):
        for name, piece in bark.pieces.items():
            assert np.isfinite(piece.uv).all() and np.isfinite(piece.points).all()
            normal = piece.face_normals()
            middle = piece.points[piece.triangles].mean(axis=1)
            side = (np.abs(middle[:, 2] - 0.5 * radius) < 0.3 * radius) & (
                np.linalg.norm(normal, axis=1) > 0.0
            )
            outward = np.sum(normal[side, :2] * middle[side, :2], axis=1) / (
                np.linalg.norm(normal[side], axis=1) * np.linalg.norm(middle[side, :2], axis=1)
            )
            least = 0.9 if name == "background" else -0.6  # sides of features stand upright
            assert np.percentile(outward, 1) > least, name


def test_a_spot_is_a_fan_with_its_peak_above_the_edge(aspen: FlowBark) -> None:
    preset = feature_preset("quaking_aspen")
    assert preset.spots is not None
    piece = aspen.pieces["spots"]
    away = np.hypot(piece.points[:, 0], piece.points[:, 1])
    count = len(piece.points) // 25  # a peak, an upper and a lower edge of 12 points
    side = np.abs(piece.points[:count, 2] - 0.25) < 0.18  # not on the ends of the pole
    peak, upper, lower = np.split(away, (count, 13 * count))
    peak = peak[side]
    upper, lower = (edge.reshape(count, 12)[side].mean(axis=1) for edge in (upper, lower))
    np.testing.assert_allclose(upper - lower, preset.spots.raise_m[-1], rtol=0.05)
    assert (peak > upper + 0.5 * preset.spots.peak_m[-1]).all()
    share = count / len(aspen.sites)
    assert share == pytest.approx(preset.spots.density[-1], abs=0.05)


def test_ribbons_follow_the_grain_in_layers(maple: FlowBark) -> None:
    preset = feature_preset("maple")
    assert preset.ribbons is not None
    nodes = preset.ribbons.segments + 1
    heights = []
    for k in range(len(preset.ribbons.layers)):
        ribbon = maple.pieces[f"ribbons_{k}"].points.reshape(-1, nodes, 4, 3)
        way = ribbon[:, -1].mean(axis=1) - ribbon[:, 0].mean(axis=1)
        middle = ribbon[:, nodes // 2].mean(axis=1)
        right = np.column_stack((-middle[:, 1], middle[:, 0])) / np.hypot(*middle.T[:2])[:, None]
        lean = np.degrees(np.arctan2(np.sum(way[:, :2] * right, axis=1), way[:, 2]))
        assert np.median(lean) == pytest.approx(10.0, abs=4.0)
        assert np.std(lean) > 1.0  # twisted
        away = np.hypot(ribbon[:, nodes // 2, :, 0], ribbon[:, nodes // 2, :, 1])
        heights.append(float(np.median(away[:, 1:3].mean(axis=1) - away[:, ::3].mean(axis=1))))
        length = np.linalg.norm(way, axis=1)
        width = np.linalg.norm(ribbon[:, nodes // 2, 0] - ribbon[:, nodes // 2, 3], axis=1)
        assert np.median(length / width) > 4.0
    assert heights == sorted(heights)
    assert heights[0] > 0.002


def test_bark_hangs_on_age_and_seed() -> None:
    skeleton = pole(0.1, 0.2)
    young, old, other, same = (
        features(skeleton, "quaking_aspen", age=age, seed=seed, grain_of_flow=False)
        for age, seed in ((10.0, 0), (70.0, 0), (70.0, 1), (70.0, 0))
    )
    assert len(young.pieces["spots"].points) < len(old.pieces["spots"].points)
    assert np.array_equal(old.pieces["spots"].points, same.pieces["spots"].points)
    assert len(old.pieces["spots"].points) != len(other.pieces["spots"].points)
    assert young.colours["spots"] != old.colours["spots"]


def test_bark_is_as_old_as_its_internode() -> None:
    skeleton = pole(0.06, 0.8)
    years = np.arange(2000, 2080, 10).astype(np.int32)
    bark = features(
        replace(skeleton, birth_year=years), "quaking_aspen", year=2080, grain_of_flow=False
    )
    upper = bark.sites.place[:, 2] > 0.75
    lower = bark.sites.place[:, 2] < 0.05
    assert set(bark.sites.age[upper]) == {10.0} and set(bark.sites.age[lower]) == {80.0}


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_sound(name: str) -> None:
    preset = feature_preset(name)
    assert (preset.spots is None) != (preset.ribbons is None)
    assert all(0.0 <= part <= 1.0 for row in preset.background + preset.feature for part in row)
    assert all(preset_for(species) is preset for species in preset.species)


def test_bark_can_be_written(aspen: FlowBark, tmp_path: Path) -> None:
    write_mesh(aspen.parts(), tmp_path / "aspen.glb")
    scene = trimesh.load(tmp_path / "aspen.glb")
    faces = {name: len(mesh.faces) for name, mesh in scene.geometry.items()}
    assert sorted(faces.values()) == sorted(len(p.triangles) for p in aspen.pieces.values())


def test_presets_by_name_species_and_file(tmp_path: Path) -> None:
    assert preset_for("betula_pendula") is feature_preset("silver_birch")
    assert preset_for("picea_abies") is None
    with pytest.raises(InputError, match="quaking_aspen"):
        feature_preset("quaking_aspn")
    text = (Path(__file__).parents[2] / "forest/surface/flow/presets/alder.toml").read_text()
    own = tmp_path / "own.toml"
    own.write_text(text)
    assert read_preset(own) == feature_preset("alder")
    own.write_text(text.replace("0.036]", "0.2]"))
    with pytest.raises(InputError, match="twice as high as wide"):
        read_preset(own)
    own.write_text(text.replace("density = [0.15, ", "density = ["))
    with pytest.raises(InputError, match="one for each of 3"):
        read_preset(own)
