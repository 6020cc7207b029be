"""Films: numbered frames into an .mp4 or a .gif, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.export import whole_file

SUFFIXES = (".mp4", ".gif")

_PALETTE = 255
_SAMPLES = 9  # frames from which a .gif's palette is made
_QUALITY = 8  # of imageio-ffmpeg, 0 to 10
_TICK_MS = 10  # a .gif counts in hundredths of a second

Frame = NDArray[np.uint8]
_Tell = Callable[[], object]


MOST_FRAMES = 20_000


@dataclass(frozen=True)
class FilmSettings:
    """How a film is made.

    Attributes
    ----------
    fps : float
        Frames per second.
    seconds : float, optional
        How long it lasts; by the number of years if not given.
    size : (int, int)
        Width and height, pixels.
    """

    fps: float = 20.0
    seconds: float | None = None
    size: tuple[int, int] = (960, 600)

    def count(self, usual_seconds: float) -> int:
        """Count the frames.

        Raises
        ------
        InputError
            If there would be more than `MOST_FRAMES`.
        """
        seconds = usual_seconds if self.seconds is None else self.seconds
        frames = max(2, round(seconds * self.fps))
        if frames > MOST_FRAMES:
            raise InputError(
                f"{seconds:g} s at {self.fps:g} frames per second are {frames:,} frames",
                expected=f"{MOST_FRAMES:,} at most",
            )
        return frames


def check_film(to: Path, size: tuple[int, int]) -> None:
    """Refuse what cannot be written before anything is rendered.

    Parameters
    ----------
    to : path
        The film.
    size : (int, int)
        Width and height, pixels.

    Raises
    ------
    InputError
        If the suffix is not one of `SUFFIXES`, an .mp4 has an odd side, or its writer is not
        installed.
    """
    suffix = to.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"unknown format '{to.suffix}'",
            where=str(to),
            expected=f"a name that ends in {' or '.join(SUFFIXES)}",
        )
    if suffix == ".mp4":
        if size[0] % 2 or size[1] % 2:
            raise InputError(
                f"an .mp4 cannot be {size[0]}x{size[1]}", where=str(to), expected="even sides"
            )
        _ffmpeg(to)


def write_film(
    frame: Callable[[int], Frame],
    count: int,
    to: str | Path,
    *,
    fps: float,
    overwrite: bool = False,
    begin: Callable[[int], object] = lambda count: None,
    done: _Tell = lambda: None,
) -> None:
    """Render frames and write them as a film.

    Parameters
    ----------
    frame : callable
        Gives frame number k, 0 to `count` - 1, as uint8 (height, width, 3). A .gif asks for a few
        of them first, to choose its colours.
    count : int
        Number of frames.
    to : path
        An .mp4 (H.264) or a .gif that runs for ever.
    fps : float
        Frames per second.
    overwrite : bool
        Whether to replace a file.
    begin, done : callable
        Told the number of frames; called after each of them.

    Raises
    ------
    InputError
        See `check_film`; or the file exists.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    to = Path(to)
    begin(count)
    first = frame(0)
    check_film(to, (first.shape[1], first.shape[0]))

    def frames() -> Iterator[Frame]:
        for k in range(count):
            yield first if k == 0 else frame(k)
            done()

    with whole_file(to, overwrite=overwrite) as draft:
        if to.suffix.lower() == ".mp4":
            _write_mp4(frames(), first.shape, draft, fps)
        else:
            samples = [frame(int(k)) for k in np.linspace(0, count - 1, _SAMPLES)]
            _write_gif(frames(), samples, draft, fps)


def _ffmpeg(to: Path) -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise InputError(
            "an .mp4 is written by imageio-ffmpeg, which is not installed",
            where=str(to),
            expected="pip install 'forest-stand[view]', or a name that ends in .gif",
        ) from error
    return imageio_ffmpeg


def _write_mp4(frames: Iterator[Frame], shape: tuple[int, ...], draft: Path, fps: float) -> None:
    size = (shape[1], shape[0])
    writer = _ffmpeg(draft).write_frames(
        str(draft), size, fps=fps, quality=_QUALITY, macro_block_size=2, ffmpeg_log_level="error"
    )
    writer.send(None)
    try:
        for picture in frames:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()


def _write_gif(frames: Iterator[Frame], samples: list[Frame], draft: Path, fps: float) -> None:
    """Write all frames in one palette, so that colours do not flicker."""
    from PIL import Image

    whole = Image.fromarray(np.concatenate(samples))
    palette = whole.quantize(_PALETTE, method=Image.Quantize.MAXCOVERAGE)
    pictures = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in frames
    )
    next(pictures).save(
        draft,
        format="GIF",
        save_all=True,
        append_images=pictures,
        duration=max(2 * _TICK_MS, round(1000.0 / fps / _TICK_MS) * _TICK_MS),
        loop=0,
    )
