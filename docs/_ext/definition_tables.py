"""Tables of the documentation that are written from the program's own definitions.

`{scenario-keys}` and `{species-keys}` list every key with unit, default, range and meaning;
`{species-values}` sets the shipped species side by side, `{species-sources}` says where the values
come from. `{run-file-columns}` lists the tables of the run file, `{interop-columns}` what they give
to other programs, `{parametric-keys}` the parameters of parametric trees, `{scene-keys}` those
of a scene. `{pictures}` shows the gallery.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import forest
from forest.interop.mapping import mapping_markdown
from forest.record.schema import columns_markdown
from forest.scenario import Scenario
from forest.species import Species, describe, load_species, species_names
from forest.species.parametric import PAPER_LEVEL_NAMES, PAPER_NAMES, Parameters
from forest.view.scenery.file import SceneFile


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table in Markdown."""
    lines = [header, ["--"] * len(header), *rows]
    return "".join(
        "| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |\n" for line in lines
    )


def keys_by_table(model: Any, leave_out: tuple[str, ...] = ()) -> str:
    """List the keys of a model, one Markdown table for each table of the file.

    Tables whose dotted names start with one of `leave_out` are described elsewhere.
    """
    tables: dict[str, list[list[str]]] = {}
    for row in describe(model):
        table, _, key = row.key.rpartition(".")
        if table.startswith(leave_out):
            continue
        tables.setdefault(table, []).append(
            [
                f"`{key}`",
                row.type,
                "" if row.unit == "1" else row.unit,
                f"`{row.default}`" if row.default not in ("", "required") else row.default,
                row.range,
                row.description,
            ]
        )
    header = ["key", "type", "unit", "default", "range", "meaning"]
    return "\n".join(
        f"### {f'`[{table}]`' if table else 'Top level'}\n\n{markdown_table(header, rows)}"
        for table, rows in tables.items()
    )


def values_side_by_side() -> str:
    """Set the parameters of the shipped species side by side."""
    species = [load_species(name) for name in species_names()]
    rows = []
    for row in describe(Species):
        section, _, key = row.key.rpartition(".")
        if not section or "." in section or section.startswith("sources"):
            continue
        values = [getattr(getattr(s, section), key) for s in species]
        rows.append([f"`{row.key}`", *(_short(value) for value in values)])
    return markdown_table(["parameter", *(s.common_name for s in species)], rows)


def sources() -> str:
    """List where the values of each shipped species come from."""
    folder = Path(forest.__file__).parent / "species"
    text = ""
    for name in species_names():
        table = tomllib.loads((folder / f"{name}.toml").read_text())
        text += f"### {load_species(name).common_name}\n\n"
        text += markdown_table(["parameter", "source"], _flat(table["sources"]))
        text += "\n"
    return text


def parametric_keys() -> str:
    """List the parameters of a parametric tree with the paper's names."""
    paper = {key: name for name, key in PAPER_NAMES.items()}
    paper |= {f"level[].{key}": f"n{name}" for name, key in PAPER_LEVEL_NAMES.items()}
    rows = [
        [
            f"`{row.key}`",
            f"`{paper[row.key]}`" if row.key in paper else "",
            row.type,
            "" if row.unit == "1" else row.unit,
            f"`{row.default}`" if row.default else "",
            row.range,
            row.description,
        ]
        for row in describe(Parameters)
        if row.key != "level"
    ]
    header = ["key", "paper", "type", "unit", "default", "range", "meaning"]
    return markdown_table(header, rows)


def pictures() -> str:
    """Show every picture that `gallery/captions.toml` has a caption for, in its order."""
    folder = Path(__file__).parents[1] / "gallery"
    captions = tomllib.loads((folder / "captions.toml").read_text())
    return "\n".join(
        f"```{{figure}} gallery/{name}.png\n:alt: {name}\n\n{caption}\n```\n"
        for name, caption in captions.items()
    )


def _flat(table: dict[str, Any], prefix: str = "") -> Iterable[list[str]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield [f"`{prefix}{key}`", str(value)]


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return ", ".join(_short(item) for item in value) or "–"
    return str(value)


def _directive(text: Any) -> type[SphinxDirective]:
    class Generated(SphinxDirective):
        def run(self) -> list[nodes.Node]:
            for room in ("scenario", "species", "record", "interop", "parametric", "view/scenery"):
                for source in (Path(forest.__file__).parent / room).glob("*.*"):
                    self.env.note_dependency(str(source))
            self.env.note_dependency(str(Path(__file__).parents[1] / "gallery" / "captions.toml"))
            return self.parse_text_to_nodes(text(), allow_section_headings=True)

    return Generated


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives with Sphinx."""
    app.add_directive(
        "scenario-keys",
        _directive(
            lambda: keys_by_table(Scenario, ("species.<name>.", "residual_trees[].parameters"))
        ),
    )
    app.add_directive("species-keys", _directive(lambda: keys_by_table(Species)))
    app.add_directive("species-values", _directive(values_side_by_side))
    app.add_directive("species-sources", _directive(sources))
    app.add_directive("run-file-columns", _directive(columns_markdown))
    app.add_directive("interop-columns", _directive(mapping_markdown))
    app.add_directive("parametric-keys", _directive(parametric_keys))
    app.add_directive("scene-keys", _directive(lambda: keys_by_table(SceneFile)))
    app.add_directive("pictures", _directive(pictures))
    return {"parallel_read_safe": True}
