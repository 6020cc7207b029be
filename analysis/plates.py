"""Draw the plates of Weber & Penn 1995 with this program: `python analysis/plates.py`.

Pictures go to docs/gallery; the numbers of each tree are printed. Names as arguments draw these
alone: `python analysis/plates.py plate_5 sassafras`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
from matplotlib import get_data_path  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402

from analysis import detail  # noqa: E402
from forest.parametric import ParametricTree, grow, load_parameters  # noqa: E402
from forest.surface import Drawing, Sight, describe, fractions  # noqa: E402
from forest.surface.description import LEAF_ITEM  # noqa: E402
from forest.view.parametric_picture import TreeScene  # noqa: E402
from forest.view.scene import open_plotter, pixels  # noqa: E402
from forest.view.shading import shade  # noqa: E402

TO = ROOT / "docs" / "gallery"

#: What of Table 2 Plate 4 shows, and the power of two by which each is enlarged.
RANGES_M = (30, 60, 120, 240, 600, 1200)

#: Which tree of each species is shown: one of middle size.
SEED = 8

_GAP_M = 0.6
_FOOT = 46  # pixels below a panel
_DARK = (40, 40, 40)


class Plate(NamedTuple):
    """One species as it is shown: where the paper has it, and with what changes."""

    where: str
    changes: tuple[str, ...] = ()


#: The willow as printed has some 140 m2 of leaf over each m2 of ground: too much to look into.
WILLOW = ("3Branches=20",)

SPECIES = {
    "quaking_aspen": Plate("Plate 1 (q, r)"),
    "black_tupelo": Plate("Plate 2"),
    "weeping_willow": Plate("Plate 5", WILLOW),
    "california_black_oak": Plate("Plate 1 (a, b)"),
    "lombardy_poplar": Plate("Plate 1 (i, j)"),
    "balsam_fir": Plate("Plate 1 (s)"),
    "sassafras": Plate("Plate 1 (c, d)"),
    "queen_palm": Plate("Plate 1 (k)"),
    "fan_palm": Plate("palms, section 4.5"),
    "lilac": Plate("shrubs, section 1"),
    "saguaro": Plate("Plate 1 (l)"),
}


def tree_of(name: str, *changes: str) -> ParametricTree:
    """Grow the tree that stands for a species, with changes of its parameters."""
    plate = SPECIES[name]
    parameters = load_parameters(name).with_changes([*plate.changes, *changes])
    return grow(parameters, SEED)


def tell(title: str, tree: ParametricTree) -> None:
    """Print what the captions say."""
    low, high = extent(tree)
    foot = tree.nodes.radius[:2].max()
    print(
        f"{title} | height {high[2]:.1f} m, crown {high[0] - low[0]:.1f} by "
        f"{high[1] - low[1]:.1f} m, trunk {200.0 * foot:.0f} cm at the ground, "
        f"stems by level {np.bincount(tree.stems.level).tolist()}, leaves {len(tree.leaves.stem)}, "
        f"leaf area {tree.leaves.area.sum():.0f} m2",
        flush=True,
    )


def extent(tree: ParametricTree) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of the box around stems and leaves, m."""
    leaves = tree.leaves
    tips = leaves.position + leaves.direction * leaves.length[:, None]
    points = np.concatenate((tree.nodes.position, tips, np.zeros((1, 3))))
    return points.min(axis=0), points.max(axis=0)


def panel(
    tree: ParametricTree,
    px_per_m: float,
    *,
    leaves: bool = True,
    season: str = "summer",
    box: tuple[float, float, float, float] | None = None,
) -> Image.Image:
    """Draw a tree from the front without perspective; `box` is left, right, bottom, top, m."""
    low, high = extent(tree)
    left, right, bottom, top = box or (low[0] - 0.2, high[0] + 0.2, min(low[2], 0.0), high[2] + 0.2)
    window = (round((right - left) * px_per_m), round((top - bottom) * px_per_m))
    plotter = open_plotter(window)
    plotter.set_background("white")
    TreeScene(tree, leaves=leaves, season=season).add_to(plotter)
    across, up = 0.5 * (left + right), 0.5 * (bottom + top)
    camera = plotter.camera
    camera.position, camera.focal_point = (across, -500.0, up), (across, 0.0, up)
    camera.up = (0.0, 0.0, 1.0)
    plotter.enable_parallel_projection()
    camera.parallel_scale = 0.5 * (top - bottom)
    plotter.renderer.ResetCameraClippingRange()
    return Image.fromarray(pixels(plotter))


def compose(
    rows: Sequence[Sequence[tuple[Image.Image, str]]], px_per_m: float, *, bar_m: float, title: str
) -> Image.Image:
    """Put rows of panels on one ground line each, with words below, title and scale bar."""
    gap = round(_GAP_M * px_per_m) + 8
    wide = [[max(image.width, _width(words)) for image, words in row] for row in rows]
    width = max(sum(row) + gap * (len(row) + 1) for row in wide)
    width = max(width, _width(title, 17) + 28)
    bar_m = bar_m if bar_m * px_per_m < 0.8 * width else 1.0
    heights = [max(image.height for image, _ in row) + _FOOT for row in rows]
    sheet = Image.new("RGB", (width, sum(heights) + 64), "white")
    pen = ImageDraw.Draw(sheet)
    pen.text((14, 8), title, fill=_DARK, font=_font(17))
    ground = 34
    for row, slots, height in zip(rows, wide, heights, strict=True):
        ground += height
        x = gap + (width - sum(slots) - gap * (len(row) + 1)) // 2
        for (image, words), slot in zip(row, slots, strict=True):
            sheet.paste(image, (x + (slot - image.width) // 2, ground - _FOOT - image.height))
            middle = (x + slot // 2, ground - _FOOT + 8)
            pen.multiline_text(
                middle, words, fill=_DARK, font=_font(14), anchor="ma", align="center"
            )
            x += slot + gap
    y, end = sheet.height - 16, width - 14
    start = end - bar_m * px_per_m
    pen.line([(start, y), (end, y)], fill=_DARK, width=3)
    pen.text((start - 8, y), f"{bar_m:g} m", fill=_DARK, font=_font(14), anchor="rm")
    return sheet


def write(sheet: Image.Image, name: str, to: Path) -> None:
    """Write a small PNG."""
    few = sheet.quantize(160, dither=Image.Dither.NONE)
    few.save(to / f"{name}.png", optimize=True)


def draw_species(name: str, to: Path = TO, *, height_px: int = 560) -> None:
    """Draw a species leafless and in leaf."""
    tree = tree_of(name)
    tell(name, tree)
    low, high = extent(tree)
    plate, parameters = SPECIES[name], tree.parameters
    shown = [(False, "summer", "without leaves")]
    if len(tree.leaves.stem):
        shown.append((True, "summer", "in leaf"))
    if not parameters.evergreen:
        shown.append((True, "fall", "in fall"))
    room = 1.9 * height_px / (len(shown) * (high[0] - low[0] + 1.0))
    px_per_m = min(height_px / high[2], room)
    panels = [
        (panel(tree, px_per_m, leaves=leaves, season=season), words if len(shown) > 1 else "")
        for leaves, season, words in shown
    ]
    title = f"{parameters.common_name.capitalize()} ({plate.where})"
    write(compose([panels], px_per_m, bar_m=_bar(high[2]), title=title), f"plate_{name}", to)


def draw_plate_1(to: Path = TO) -> None:
    """Draw all species at one scale."""
    px_per_m, shown = 18.0, []
    for name in SPECIES:
        tree = tree_of(name)
        words = tree.parameters.common_name.split(",")[0].replace(" ", "\n", 1)
        shown.append((panel(tree, px_per_m), words))
    title = "After Plate 1: all species at one scale"
    rows = [shown[:5], shown[5:]]
    write(compose(rows, px_per_m, bar_m=5.0, title=title), "plate_1", to)


def draw_plate_2(to: Path = TO) -> None:
    """Draw the black tupelo with and without leaves."""
    tree = tree_of("black_tupelo")
    px_per_m = 620.0 / extent(tree)[1][2]
    panels = [(panel(tree, px_per_m), "(a) with leaves")]
    panels.append((panel(tree, px_per_m, leaves=False), "(b) without leaves"))
    title = "After Plate 2: black tupelo"
    write(compose([panels], px_per_m, bar_m=5.0, title=title), "plate_2", to)


def draw_plate_4(to: Path = TO) -> None:
    """Draw the aspen at the ranges of Table 2 from 30 m, zoomed by powers of two."""
    tree = tree_of("quaking_aspen")
    lobes = (tree.parameters.lobes, tree.parameters.lobe_depth)
    whole = describe(tree.skeleton(), tree.leaves, lobes=lobes)
    top, panels = extent(tree)[1][2], []
    for power, range_m in enumerate(RANGES_M):
        shares = fractions(range_m, Sight(season="summer"), evergreen=False)
        drawing = whole.drawn(shares)
        counts = [len(part.vertices) for part in drawing]
        print(f"plate_4 | {range_m} m | triangles, lines, points {counts}", flush=True)
        size = 30.0 * 2**power / range_m
        image = _from_afar(tree, drawing, 330.0 * size / top)
        panels.append((image, f"{range_m} m × {2**power}\n{sum(counts):,} elements"))
    title = "After Plate 4: quaking aspen at the ranges of Table 2, zoomed by powers of two"
    write(compose([panels[:3], panels[3:]], 330.0 / top, bar_m=5.0, title=title), "plate_4", to)


def _from_afar(tree: ParametricTree, drawing: Drawing, px_per_m: float) -> Image.Image:
    """Draw primitives; a point is as large as the leaves that it stands for."""
    low, high = extent(tree)
    middle, half = 0.5 * (low + high), 0.5 * (high[2] + 0.4)
    plotter = open_plotter((round((high[0] - low[0] + 0.4) * px_per_m), round(2 * half * px_per_m)))
    plotter.set_background("white")
    scene = TreeScene(tree)
    sun, sky = scene.light.at(tree.leaves.position)
    leaf = shade(scene.leaves.colour, sun, sky) / 255.0
    stands_for = len(tree.leaves.stem) / max(len(drawing.points.vertices), 1)
    dot = 2.0 * px_per_m * float(np.sqrt(tree.leaves.area.mean() * stands_for))
    looks = {"lighting": False, "line_width": 3, "point_size": dot}
    for primitives in drawing:
        element = np.where(primitives.item == LEAF_ITEM, primitives.element, 0)
        leafy = (primitives.item == LEAF_ITEM)[:, None]
        detail.add(plotter, primitives, np.where(leafy, leaf[element], scene.bark), **looks)
    plotter.camera_position = [middle - np.array([0.0, 500.0, 0.0]), middle, (0, 0, 1)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = half
    return Image.fromarray(pixels(plotter))


def draw_plate_5(to: Path = TO) -> None:
    """Draw the weeping willow."""
    tree = tree_of("weeping_willow")
    px_per_m = 640.0 / extent(tree)[1][2]
    title = "After Plate 5: weeping willow"
    panels = [(panel(tree, px_per_m), "")]
    write(compose([panels], px_per_m, bar_m=1.0, title=title), "plate_5", to)


def draw_plate_6(to: Path = TO) -> None:
    """Draw the sassafras with its leaves as they come and turned to the light."""
    panels, px_per_m = [], 0.0
    bend = load_parameters("sassafras").leaf_bend
    for letter, value in (("a", 0.0), ("b", bend)):
        tree = tree_of("sassafras", f"bend={value}")
        px_per_m = px_per_m or 560.0 / extent(tree)[1][2]
        up = tree.leaves.normal[:, 2]
        print(f"plate_6 | bend {value} | upper faces' mean vertical part {up.mean():.2f}")
        panels.append((panel(tree, px_per_m), f"({letter}) leaf_bend {value:g}"))
        print(f"plate_6 | bend {value} | mean brightness {_brightness(panels[-1][0]):.0f} of 255")
    title = "After Plate 6: sassafras, leaves unmodified and re-oriented"
    write(compose([panels], px_per_m, bar_m=5.0, title=title), "plate_6", to)


def draw_plate_7(to: Path = TO) -> None:
    """Draw the willow unpruned and pruned."""
    trees = [tree_of("weeping_willow", f"PruneRatio={ratio}") for ratio in (0.0, 1.0)]
    boxes = [extent(tree) for tree in trees]
    low = min(low[2] for low, _ in boxes)
    px_per_m = 560.0 / (max(high[2] for _, high in boxes) - low)
    panels = []
    for tree, (first, last), words in zip(trees, boxes, ("unpruned", "pruned"), strict=True):
        tell(f"plate_7 {words}", tree)
        box = (first[0] - 0.2, last[0] + 0.2, low, last[2] + 0.2)
        panels.append((panel(tree, px_per_m, box=box), words))
    title = "After Plate 7: weeping willow"
    write(compose([panels], px_per_m, bar_m=5.0, title=title), "plate_7", to)


def _brightness(image: Image.Image) -> float:
    """Mean grey of what is not background."""
    grey: Any = np.asarray(image.convert("L"), np.float64)
    return float(grey[grey < 250.0].mean())


def _bar(height_m: float) -> float:
    return 5.0 if height_m > 6.0 else 1.0


def _font(size: int) -> Any:
    return ImageFont.truetype(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def _width(words: str, size: int = 14) -> int:
    return max(int(_font(size).getlength(line)) for line in words.split("\n"))


PLATES: dict[str, Callable[[], None]] = {
    "plate_1": draw_plate_1,
    "plate_2": draw_plate_2,
    "plate_4": draw_plate_4,
    "plate_5": draw_plate_5,
    "plate_6": draw_plate_6,
    "plate_7": draw_plate_7,
}


def main(names: list[str]) -> None:
    """Draw the plates and species of these names, or all."""
    TO.mkdir(parents=True, exist_ok=True)
    for name in names or [*SPECIES, *PLATES]:
        PLATES.get(name, lambda name=name: draw_species(name))()


if __name__ == "__main__":
    main(sys.argv[1:])
