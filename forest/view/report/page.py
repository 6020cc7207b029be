"""A report of a run: one HTML file that holds all it shows."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from pathlib import Path
from string import Template

from forest.errors import InputError
from forest.record.export import whole_file
from forest.record.run import Run
from forest.view.report import sections
from forest.view.report.parts import Section, number
from forest.view.report.warnings import warnings_of

_TEMPLATE = Path(__file__).with_name("page.html")

_Make = Callable[[Run], Section | None]
_SECTIONS: tuple[tuple[str, _Make], ...] = (
    ("stand table", sections.stand_section),
    ("pictures of the stand", sections.picture_section),
    ("charts", sections.development_section),
    ("comings and goings", sections.ledger_section),
    ("treatments", sections.treatment_section),
    ("storms", sections.storm_section),
    ("climate and balances", sections.flow_section),
    ("sample trees", sections.sample_section),
    ("provenance", sections.provenance_section),
)


def write_report(
    run: Run,
    to: str | Path,
    *,
    overwrite: bool = False,
    say: Callable[[str], object] = lambda line: None,
) -> tuple[str, ...]:
    """Write a report of a run.

    The page needs nothing beside it: pictures are part of it, and it asks no other place for
    anything. A section whose part of the file cannot be read is left out with a warning.

    Parameters
    ----------
    run : Run
        An open run, finished or not.
    to : path
        The .html file.
    overwrite : bool
        Whether to replace a file.
    say : callable
        Is told which section is being made.

    Returns
    -------
    tuple of str
        The warnings that stand at the top of the page.

    Raises
    ------
    InputError
        If the run has no whole year, the suffix is another one, or the file exists.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    to = Path(to)
    if to.suffix.lower() != ".html":
        raise InputError(
            f"unknown format '{to.suffix}'", where=str(to), expected="a name that ends in .html"
        )
    if not len(run.years):
        raise InputError("holds no years yet", where=str(run.path))
    with whole_file(to, overwrite=overwrite) as draft:
        page, warnings = _page(run, say)
        draft.write_text(page, encoding="utf-8")
    return warnings


def _page(run: Run, say: Callable[[str], object]) -> tuple[str, tuple[str, ...]]:
    warnings = warnings_of(run)
    made = []
    for name, make in _SECTIONS:
        say(name)
        try:
            section = make(run)
        except InputError as error:
            warnings.append(f"The {name} are left out: {error}")
            continue
        if section:
            made.append(section)
    first, last = int(run.years[0]), int(run.years[-1])
    width, depth = run.scenario.plot.size_m
    lead = (
        f"{len(run.years)} years, {first} to {last}, on {width:g} × {depth:g} m: "
        f"{', '.join(name.replace('_', ' ') for name in run.species_names)}. "
        f"Seed {run.provenance['seed']}, file {run.path.name}."
    )
    fills = {
        "title": escape(run.scenario.title or run.path.stem),
        "lead": escape(lead),
        "warnings": _warned(warnings),
        "figures": _figures(run),
        "contents": "\n".join(
            f'<li><a href="#s{k}">{escape(section.title)}</a></li>'
            for k, section in enumerate(made)
        ),
        "sections": "\n".join(
            f'<section id="s{k}"><h2>{escape(section.title)}</h2>{section.html}</section>'
            for k, section in enumerate(made)
        ),
    }
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(fills), tuple(warnings)


def _warned(warnings: list[str]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<li>{escape(warning)}</li>" for warning in warnings)
    return f'<aside class="warnings" aria-label="Warnings"><b>Note</b><ul>{items}</ul></aside>'


def _figures(run: Run) -> str:
    """Show the stand's main numbers of its last year."""
    if "stand" not in run.tables:
        return ""
    whole = run.stand[run.stand["species"].astype(str) == "all"].iloc[-1]
    items = "".join(
        f"<li>{escape(heading)}<b>{number(whole[name], digits)}</b></li>"
        for name, (heading, digits) in list(sections.STAND_COLUMNS.items())[:6]
    )
    return (
        f'<p>At the end of {int(whole["year"])}:</p><ul class="figures" id="last-year">{items}</ul>'
    )
