"""The errors that a user's input can cause, and silence for what libraries say beside them."""

from __future__ import annotations

import difflib
import errno
import logging
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Input that the program refuses: what is wrong, where, and what was expected.

    The message is one line. The command line prints it and exits with code 2.

    Parameters
    ----------
    what : str
        What is wrong, e.g. ``"unknown key 'yeers'"``.
    where : str, optional
        File and key, e.g. ``"stand.toml: plot.size_m"``.
    expected : str, optional
        What would have been right, e.g. ``"a number of years, 1 to 10000"``.
    """

    def __init__(self, what: str, *, where: str = "", expected: str = "") -> None:
        parts = [f"{where}: " if where else "", what]
        if expected:
            parts.append(f"; expected {expected}")
        super().__init__(" ".join("".join(parts).split()))


class ActError(InputError):
    """An act of the scenario that cannot be done in its year; nothing of that year was done."""


class OutputError(InputError):
    """Output that cannot be written: the folder, the rights, or the room on the disk."""

    @classmethod
    def of(cls, error: OSError, path: object) -> OutputError:
        """Say in one line what the operating system refused."""
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            return cls("no room left on the disk", where=str(path))
        reason = error.strerror or "failed"
        return cls(f"cannot be written: {reason[:1].lower()}{reason[1:]}", where=str(path))


def span_of(first: int, last: int) -> str:
    """Say which years there are."""
    return f"a year from {first} to {last}" if first != last else f"{first}, the only year"


def years_of(count: int) -> str:
    """Say how many years."""
    return "1 year" if count == 1 else f"{count} years"


def nearest(name: str, known: Iterable[str]) -> str:
    """Give a hint that names the known word closest to `name`, or list the known words."""
    choices = sorted(known)
    close = difflib.get_close_matches(name, choices, n=1, cutoff=0.5)
    if close:
        return f"did you mean '{close[0]}'?"
    return "one of " + ", ".join(choices)


@contextmanager
def libraries_silenced() -> Iterator[None]:
    """Keep what libraries warn of off the screen: what a user must know comes as an error."""
    logging.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
