"""The pieces of a page: text is escaped here, pictures become part of the page."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, NamedTuple


class Picture(NamedTuple):
    """A picture of the page.

    Attributes
    ----------
    data : bytes
        The file.
    kind : str
        Its media type after ``image/``.
    alt : str
        What it says, for those who do not see it.
    caption : str
        The line below it.
    """

    data: bytes
    kind: str
    alt: str
    caption: str = ""


class Section(NamedTuple):
    """A part of the page with a heading of its own."""

    title: str
    html: str


def text(words: object) -> str:
    """Write words as a paragraph."""
    return f"<p>{escape(str(words))}</p>"


def figure(picture: Picture) -> str:
    """Write a picture with its caption."""
    source = f"data:image/{picture.kind};base64,{b64encode(picture.data).decode()}"
    image = f'<img src="{source}" alt="{escape(picture.alt)}">'
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>" if picture.caption else ""
    return f"<figure>{image}{caption}</figure>"


def gallery(pictures: Iterable[Picture], *, name: str = "") -> str:
    """Write pictures side by side; the name says how large they are."""
    return f'<div class="gallery {name}">{"".join(map(figure, pictures))}</div>'


def table(
    headings: Sequence[str], rows: Iterable[Sequence[object]], *, caption: str, name: str = ""
) -> str:
    """Write a table; the first cell of a row is its heading."""
    head = "".join(f'<th scope="col">{escape(heading)}</th>' for heading in headings)
    body = []
    for first, *others in rows:
        cells = "".join(f"<td>{escape(str(cell))}</td>" for cell in others)
        body.append(f'<tr><th scope="row">{escape(str(first))}</th>{cells}</tr>')
    mark = f' id="{escape(name)}"' if name else ""
    return (
        f'<div class="scroll"><table{mark}><caption>{escape(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def pairs(lines: Iterable[tuple[str, str]]) -> str:
    """Write labels and what belongs to them."""
    items = "".join(f"<dt>{escape(label)}</dt><dd>{escape(said)}</dd>" for label, said in lines)
    return f"<dl>{items}</dl>"


def number(value: Any, digits: int) -> str:
    """Write a number with so many digits; a dash if it is missing."""
    value = float(value)
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
