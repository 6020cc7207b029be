"""Maps of bark: tiles, heights, normals, occlusion, files; textures; presets."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface.bark import StripGeometry, grow_bark, shrinking
from forest.surface.bark.dressing import Dress, Fold, grow_preset
from forest.surface.bark.light import normals, occlusion
from forest.surface.bark.maps import BarkMaps, bark_maps
from forest.surface.bark.noise import flakes, noise
from forest.surface.bark.presets import Preset, preset_names
from forest.surface.bark.recipes import Recipe
from forest.surface.bark.textures import Texture, _paint
from forest.view.bark_picture import lit

PRESETS = ("aspen", "beech", "birch", "maple", "oak", "pine", "spruce")


@pytest.fixture(scope="module")
def dresses() -> dict[str, Dress]:
    return {name: Dress.of(Preset.load(name), seed=1, size=128) for name in PRESETS}


def small(dress: Dress, girth: float = 1.5, **options: object) -> BarkMaps:
    bark = grow_preset(dress.preset, girth, width_m=0.4, length_m=0.4, seed=2)
    return bark_maps(bark, dress, 200, girth_m=girth, seed=2, **options)  # type: ignore[arg-type]


def _seam(image: np.ndarray, axis: int) -> tuple[float, float]:
    """Mean step over the seam and inside."""
    values = image.astype(np.float64)
    steps = np.abs(values - np.roll(values, 1, axis=axis))
    over = float(np.take(steps, 0, axis=axis).mean())
    return over, float(steps.mean())


@pytest.mark.parametrize("name", PRESETS)
def test_tiles_have_no_seam(dresses: dict[str, Dress], name: str) -> None:
    maps = small(dresses[name])
    assert maps.tileable
    for image in (maps.colour, maps.height, maps.roughness, maps.occlusion, maps.normal):
        for axis in (0, 1):
            over, inside = _seam(image, axis)
            assert over < 2.2 * inside + 1.0


def test_maps_repeat_exactly_when_laid_out_twice(dresses: dict[str, Dress]) -> None:
    """Normals and occlusion of two tiles by two are those of one, four times."""
    height = small(dresses["oak"]).height_m.astype(np.float32)
    twice = np.tile(height, (2, 2))
    pixel = 0.4 / 200
    for make in (normals, occlusion):
        one = make(height, np.full(200, pixel), pixel, wraps_along=True)
        four = make(twice, np.full(400, pixel), pixel, wraps_along=True)
        assert np.abs(four[:200, :200].astype(int) - one).max() <= 1
        assert np.abs(four[200:, 200:].astype(int) - one).max() <= 1


def test_normals_are_those_of_the_height(dresses: dict[str, Dress]) -> None:
    maps = small(dresses["maple"])
    vectors = maps.normal / 127.5 - 1.0
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=-1), 1.0, atol=0.015)
    assert vectors[..., 2].min() >= -0.01
    h, pixel = maps.height_m, maps.width_m / 200
    right = (np.roll(h, -1, axis=1) - np.roll(h, 1, axis=1)) / (2 * pixel)
    up = (np.roll(h, 1, axis=0) - np.roll(h, -1, axis=0)) / (2 * pixel)
    expected = np.stack((-right, -up, np.ones_like(h)), axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(vectors, expected, atol=0.03)


def test_a_pit_is_darker_the_deeper_it_is() -> None:
    height = np.zeros((64, 64), np.float32)
    height[32, 32] = -0.004
    height[10, 10] = -0.001
    seen = occlusion(height, np.full(64, 0.001), 0.001, wraps_along=False)
    assert seen[32, 32] < seen[10, 10] < seen[50, 10] == 255


def test_heights_fill_sixteen_bits_and_lie_within_the_depth(dresses: dict[str, Dress]) -> None:
    maps = small(dresses["oak"])
    assert maps.height.dtype == np.uint16
    assert (maps.height.min(), maps.height.max()) == (0, 65535)
    assert -0.05 < maps.lowest_m < -0.008 < 0.0 < maps.highest_m < 0.01


def test_files(tmp_path: Path, dresses: dict[str, Dress]) -> None:
    maps = small(dresses["birch"])
    paths = maps.save(tmp_path / "set")
    assert {path.name for path in paths} == {
        "colour.png", "normal.png", "height.png", "roughness.png", "occlusion.png", "bark.json"
    }  # fmt: skip
    with Image.open(tmp_path / "set" / "height.png") as image:
        assert image.mode.startswith("I;16")
        assert np.array_equal(np.asarray(image), maps.height)
    about = json.loads((tmp_path / "set" / "bark.json").read_text())
    assert about["width_m"] == pytest.approx(0.4)
    assert maps.occlusion_roughness_metal.shape == (200, 200, 3)
    assert np.array_equal(maps.occlusion_roughness_metal[..., 1], maps.roughness)


def test_threads_do_not_matter(dresses: dict[str, Dress]) -> None:
    with using_threads(1):
        one = small(dresses["pine"])
    with using_threads(3):
        three = small(dresses["pine"])
    for name in ("colour", "normal", "height", "roughness", "occlusion"):
        assert np.array_equal(getattr(one, name), getattr(three, name))


def test_a_trunk_is_young_at_its_top(dresses: dict[str, Dress]) -> None:
    """Old, deep bark at the foot, smooth bark above."""
    dress = dresses["oak"]
    girth = np.linspace(2.0, 0.3, 80)
    bark = grow_bark(
        StripGeometry.column(80, 0.05),
        shrinking(girth, dress.preset.remains(girth)),
        dress.preset.material(1.5),
        1,
    )
    maps = bark_maps(bark, dress, (256, 400), seed=1)
    assert not maps.tileable
    assert maps.length_m == pytest.approx(4.0)
    relief = maps.height_m.std(axis=1)
    assert relief[:50].mean() < 0.3 * relief[-50:].mean()


def test_presets_are_all_there_and_sound() -> None:
    assert tuple(preset_names()) == PRESETS
    for name in PRESETS:
        preset = Preset.load(name)
        assert preset.name == name
        remains = preset.remains(np.linspace(0.05, 3.0, 50))
        assert np.all((remains > 0.4) & (remains <= 1.0))
        assert np.all(np.diff(remains) <= 0)  # it never heals
        preset.material(0.7)


def test_barks_differ_and_age(dresses: dict[str, Dress]) -> None:
    """Share and shape of fractures, relief and colour tell the presets apart."""
    seen = {}
    for name in PRESETS:
        preset = dresses[name].preset
        bark = grow_preset(preset, 1.6, width_m=0.8, length_m=0.8, seed=3)
        lengths, widths = bark.fractures.length, bark.fractures.width
        slim = float(np.median(lengths / widths))
        maps = small(dresses[name], 1.6)
        h = maps.height_m
        grain = np.abs(np.diff(h, axis=1)).mean() / np.abs(np.diff(h, axis=0)).mean()
        young = small(dresses[name], 0.2).height_m
        assert h.std() > 1.5 * young.std()
        seen[name] = (1.0 - preset.remains(1.6), slim, grain, h.std(), maps.colour.mean())
    share, slim, grain, rough, bright = ({n: v[k] for n, v in seen.items()} for k in range(5))
    assert share["beech"] < share["spruce"] < share["maple"] < share["oak"]
    assert slim["maple"] > 1.4 * slim["oak"]
    assert grain["maple"] > 1.5 * grain["spruce"]
    assert rough["oak"] > 5 * rough["beech"]
    assert bright["birch"] > max(bright[n] for n in PRESETS if n != "birch")


def test_plates_tear_again(dresses: dict[str, Dress]) -> None:
    """Pine's plates are a second bark on the surface of the first; its skin is that surface."""
    preset = dresses["pine"].preset
    bark = grow_preset(preset, 1.8, width_m=0.5, length_m=0.5, seed=2)
    assert bark.generation == 1
    assert bark.surface is not None
    both = bark_maps(bark, dresses["pine"], 200, girth_m=1.8)
    alone = bark_maps(replace(bark, surface=None), dresses["pine"], 200, girth_m=1.8)
    assert both.height_m.std() > 1.3 * alone.height_m.std()


def test_lichen_and_folds_are_options(dresses: dict[str, Dress]) -> None:
    plain = dresses["beech"]
    none = plain.preset.lichen.model_copy(update={"cover": 0.0})
    much = plain.preset.lichen.model_copy(update={"cover": 0.5, "side": 1.0})
    without = small(plain._replace(preset=plain.preset.model_copy(update={"lichen": none})))
    grown = small(plain._replace(preset=plain.preset.model_copy(update={"lichen": much})))
    changed = (without.colour != grown.colour).any(axis=-1)
    moist, dry = (
        changed[:, 25:75].mean(),
        changed[:, 125:175].mean(),
    )  # a quarter turn from the seam
    assert moist > 0.3 > 0.05 > dry
    folded = small(plain, folds=[Fold(0.5, 0.2, 0.04, 0.02)])
    raised = folded.height_m - small(plain).height_m
    assert raised.max() > 0.01
    assert np.abs(raised[:, :10]).max() < 1e-4  # half a turn away
    row, column = np.unravel_index(np.argmax(raised), raised.shape)
    assert abs(column - 100) < 15
    assert 95 < row < 125


@pytest.mark.parametrize("name", PRESETS)
def test_textures_repeat(dresses: dict[str, Dress], name: str) -> None:
    for texture in (*dresses[name].skin, *dresses[name].inside):
        assert texture.pixels.shape == (128, 128, 5)
        for axis in (0, 1):
            over, inside = _seam(1e4 * texture.pixels[..., 3], axis)
            assert over < 2.5 * inside


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 99))
def test_noise_repeats_and_is_spread(around: int, along: int, seed: int) -> None:
    one = noise(96, around, along, octaves=2, seed=seed, serial=1)
    assert np.abs(one).max() < 2.2
    for axis in (0, 1):
        over, inside = _seam(one, axis)
        assert over < 4.0 * inside
    other = noise(96, around, along, octaves=2, seed=seed + 1, serial=1)
    assert not np.allclose(one, other)


def test_flakes_cover_everything() -> None:
    found = flakes(64, 5, 5, np.zeros((64, 64, 2), np.float32), seed=1, serial=2)
    assert 10 < len(np.unique(found.tint)) <= 25
    for column in found:
        assert 0.0 <= column.min() <= column.max() <= 1.0


def test_a_tile_is_painted_once_and_would_be_the_same_again() -> None:
    recipe = Preset.load("maple").skin[0]
    one, same, other = (Texture.of(recipe, seed=seed, size=64).pixels for seed in (3, 3, 4))
    assert same is one
    assert np.array_equal(_paint.__wrapped__(recipe, 3, 64), one)
    assert not np.array_equal(other, one)


def test_users_pictures(tmp_path: Path) -> None:
    path = tmp_path / "skin.png"
    ramp = np.linspace(0, 255, 32).astype(np.uint8)
    Image.fromarray(np.repeat(np.tile(ramp, (16, 1))[..., None], 3, axis=2)).save(path)
    recipe = Recipe(colours=((0, 0, 0), (1, 1, 1)), image=str(path), image_depth_mm=2.0, size_m=0.2)
    texture = Texture.of(recipe)
    assert texture.pixels.shape == (16, 32, 5)
    assert texture.size_m == (0.2, 0.1)
    assert np.ptp(texture.pixels[..., 3]) == pytest.approx(0.002)
    with pytest.raises(InputError, match="no picture to be read"):
        Texture.of_image(tmp_path / "none.png", 0.1)


def test_bad_presets_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'spruce'"):
        Preset.load("sprouce")
    text = (Path(__file__).parents[2] / "forest/surface/bark/presets/oak.toml").read_text()
    own = tmp_path / "own.toml"
    for old, new, problem in (
        ("fray_length_m", "fray_lenght_m", "did you mean 'fray_length_m'"),
        ("share = [[0.2, 0.0]", "share = [[0.2, -1.0]", "tearing.share: -1.0; expected 0 to 0.9"),
        ("spacing_m = [[0.2, ", "spacing_m = [[9.0, ", "girths rising"),
        ('opening = "axis"', 'opening = "slit"', "carving.opening"),
    ):
        assert old in text
        own.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError) as error:
            Preset.load(own)
        assert problem in str(error.value)
        assert "\n" not in str(error.value)
    own.write_text(text)
    assert Preset.load(own) == Preset.load("oak")


def test_bad_sizes_are_refused(dresses: dict[str, Dress]) -> None:
    bark = grow_preset(dresses["oak"].preset, 1.0, width_m=0.2, length_m=0.2)
    with pytest.raises(InputError, match="16 to 16384 pixels"):
        bark_maps(bark, dresses["oak"], 4)
    with pytest.raises(InputError, match="metres, above 0"):
        grow_preset(dresses["oak"].preset, -1.0)


def test_light_from_the_left_shades_the_right(dresses: dict[str, Dress]) -> None:
    maps = small(dresses["beech"])
    for shape in ("stem", "ball"):
        picture = lit(maps, (-70.0, 10.0), shape=shape, view_m=0.12, size=(60, 60))  # type: ignore[arg-type]
        assert picture[30, 15].mean() > 1.5 * picture[30, 44].mean()
    left = lit(maps, (-60.0, 30.0), view_m=0.2, size=(50, 50)).astype(float)
    right = lit(maps, (60.0, 30.0), view_m=0.2, size=(50, 50)).astype(float)
    assert np.abs(left - right).mean() > 0.3
