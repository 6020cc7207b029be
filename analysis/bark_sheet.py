"""Draw all bark presets at three ages under a moving light: `python analysis/bark_sheet.py`.

The picture goes to docs/gallery. Names of presets as arguments draw these alone, to
`bark_sheet_NAMES.png` in the folder where you are.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
from matplotlib import get_data_path  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402

from forest.surface.bark.dressing import Dress, grow_preset  # noqa: E402
from forest.surface.bark.maps import BarkMaps, bark_maps  # noqa: E402
from forest.surface.bark.presets import Preset, preset_names  # noqa: E402
from forest.view.bark_picture import lit  # noqa: E402

TO = ROOT / "docs" / "gallery"

GIRTHS_M = (0.4, 1.0, 1.8)  # about 13, 32 and 57 cm of diameter
LIGHTS_DEG = ((-65.0, 25.0), (0.0, 65.0), (65.0, 25.0))
_PANEL = (210, 250)
_VIEW_M = 0.62
_PIXELS = 1024
_LEFT, _TOP, _GAP = 96, 44, 6
_DARK = (40, 40, 40)


def dressed(preset: Preset, seed: int = 5) -> list[BarkMaps]:
    """Give the maps of a preset at all girths."""
    dress = Dress.of(preset, seed=seed)
    maps = []
    for girth in GIRTHS_M:
        bark = grow_preset(preset, girth, length_m=0.9, seed=seed)
        size = (_PIXELS, round(_PIXELS * 0.9 / girth))
        maps.append(bark_maps(bark, dress, size, girth_m=girth, seed=seed))
    return maps


def panels(preset: Preset) -> list[NDArray[np.uint8]]:
    """Draw the row of a preset: stems at three ages, then the oldest bark as the light moves."""
    maps = dressed(preset)
    stems = [lit(one, (-50.0, 35.0), shape="stem", view_m=_VIEW_M, size=_PANEL) for one in maps]
    return stems + [lit(maps[-1], light, view_m=_VIEW_M, size=_PANEL) for light in LIGHTS_DEG]


def sheet(names: list[str]) -> Image.Image:
    """Draw a row for each preset."""
    font = ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 14)
    width, height = _PANEL
    heads = [f"girth {girth:g} m" for girth in GIRTHS_M]
    heads += ["light from the left", "from above", "from the right"]
    whole = Image.new(
        "RGB",
        (_LEFT + len(heads) * (width + _GAP), _TOP + len(names) * (height + _GAP)),
        (255, 255, 255),
    )
    draw = ImageDraw.Draw(whole)
    for k, head in enumerate(heads):
        draw.text((_LEFT + k * (width + _GAP) + 4, _TOP - 24), head, _DARK, font)
    for row, name in enumerate(names):
        y = _TOP + row * (height + _GAP)
        preset = Preset.load(name)
        draw.text((6, y + 8), preset.name, _DARK, font)
        for k, panel in enumerate(panels(preset)):
            whole.paste(Image.fromarray(panel), (_LEFT + k * (width + _GAP), y))
    return whole


def main() -> None:
    """Draw the sheet."""
    chosen = sys.argv[1:]
    picture = sheet(chosen or list(preset_names()))
    to = Path(f"bark_sheet_{'_'.join(chosen)}.png") if chosen else TO / "bark_sheet.png"
    picture.quantize(256, kmeans=2, dither=Image.Dither.NONE).save(to, optimize=True)
    print(to)


if __name__ == "__main__":
    main()
