"""Ids of series that every program reads: at most six letters and digits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: Most characters in an id; the field of the Tucson format has eight, some programs read six.
MAX_LENGTH = 6


def short_ids(names: Sequence[str]) -> list[str]:
    """Shorten names to ids of at most six letters and digits, each of them unique.

    A name that is such an id already keeps it. Of any other, what is not an ASCII letter or digit
    is dropped; if that is too long or taken, its end gives way to a number (base 36). Ids differ by
    more than the case of their letters, since some programs do not tell it.

    Parameters
    ----------
    names : sequence of str
        Names, in the order in which they choose; a repeated name gets another id.

    Returns
    -------
    list of str
        The id of each name.
    """
    cleaned = ["".join(c for c in name if c.isascii() and c.isalnum()) for name in names]
    ids: list[str | None] = [None] * len(names)
    taken: set[str] = set()
    # Names that may stay choose first, so that no shortened one takes their place.
    for may_change in (False, True):
        for i, (name, plain) in enumerate(zip(names, cleaned, strict=True)):
            fits = 0 < len(plain) <= MAX_LENGTH and plain.upper() not in taken
            if ids[i] is None and fits and (may_change or plain == name):
                ids[i] = plain
                taken.add(plain.upper())
    next_number: dict[str, int] = {}
    return [
        _numbered(plain or "S", taken, next_number) if id_ is None else id_
        for id_, plain in zip(ids, cleaned, strict=True)
    ]


def _numbered(plain: str, taken: set[str], next_number: dict[str, int]) -> str:
    """Put a number in place of the end of a name: the first that makes a free id."""
    key = plain[:MAX_LENGTH].upper()
    number = next_number.get(key, 1)
    while True:
        digits = np.base_repr(number, 36)
        id_ = plain[: MAX_LENGTH - len(digits)] + digits
        number += 1
        if id_.upper() not in taken:
            taken.add(id_.upper())
            next_number[key] = number
            return id_
