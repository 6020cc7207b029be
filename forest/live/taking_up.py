"""A session's file, taken up again: its years are grown anew, its last acts wait as they did."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forest.errors import InputError
from forest.live.session import HEADING, NOT_YET, LiveSession
from forest.scenario import Scenario
from forest.scenario.timing import Timing

if TYPE_CHECKING:
    from forest.scenario.acts import Act

_TIME = frozenset(Timing.model_fields) - {"kind"}


def take_up(
    scenario: Scenario,
    file: Path,
    *,
    say: Callable[[str], None] = lambda _: None,
) -> LiveSession:
    """Go on with the session in a file, or begin one that is kept there.

    Parameters
    ----------
    scenario : Scenario
        What the session started from.
    file : path
        The session's scenario file; it is written only when the session has come to where it was.
    say : callable, optional
        Is told of each year, and of the nursery where there is one.

    Raises
    ------
    InputError
        If the file holds anything but a session of that scenario; then it stays as it is.
    """
    session = LiveSession(scenario, say=say)
    if file.exists():
        kept = Scenario.load(file)
        text = file.read_text(encoding="utf-8")
        if not text.startswith(HEADING):
            raise InputError(
                "exists already and is no live session", where=str(file), expected="another file"
            )
        done = 0 if text.startswith(HEADING + NOT_YET) else kept.years
        _replay(session, scenario, kept, done, str(file), say)
    session.keep_in(file)
    return session


def _replay(
    session: LiveSession,
    scenario: Scenario,
    kept: Scenario,
    done: int,
    where: str,
    say: Callable[[str], None],
) -> None:
    strange = InputError(
        "is not a session of this scenario",
        where=where,
        expected="another --session file, or the scenario as it was",
    )
    acts = [(act.year, _keys(act)) for act in kept.acts[len(scenario.acts) :]]
    try:
        dated = [{**keys, "year": year} for year, keys in acts]
        as_told = scenario.lived(dated, years=kept.years, planned=done + 1)
    except InputError:
        raise strange from None
    if as_told != kept:
        raise strange
    for step in range(done + 1):
        for year, keys in acts:
            if year == session.next_year:
                session.act(**keys)
        if step < done:
            say(f"{session.next_year}: year {step + 1} of {done} of the session in {where}")
            session.step()


def _keys(act: Act) -> dict[str, Any]:
    """Give what an act says, without its time."""
    told = act.model_dump(mode="json", exclude_none=True, exclude=set(_TIME))
    return {**told, "kind": act.kind}
