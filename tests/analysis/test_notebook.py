"""The notebook of the documentation: executed, up to date, and its cells run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

from docs.notebooks.make_notebook import HERE, cells_of

SMALLER = {
    "years = 80": "years = 45",
    "[15, 15]": "[10, 10]",
    "density_ha = 4000": "density_ha = 6000",
    "n_trees=8": "n_trees=3",
}


@pytest.fixture(scope="module")
def notebook() -> Any:
    return json.loads((HERE / "rings.ipynb").read_text(encoding="utf-8"))


def test_a_script_is_split_at_its_marks():
    script = "x = 0\n# %% [markdown]\n# # Head\n#\n# Text.\n\n# %%\nx = 1  # %%\n\n# %%\nx\n"
    assert cells_of(script) == [
        ("markdown", "# Head\n\nText."),
        ("code", "x = 1  # %%"),
        ("code", "x"),
    ]


def test_the_notebook_holds_the_cells_of_its_script(notebook: Any):
    """If not: make notebook."""
    stored = [(cell["cell_type"], "".join(cell["source"])) for cell in notebook["cells"]]
    assert stored == cells_of((HERE / "rings.py").read_text(encoding="utf-8"))


def test_the_notebook_was_executed_and_is_small(notebook: Any):
    outputs = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(outputs)
    kinds = [output["output_type"] for cell in outputs for output in cell]
    assert "error" not in kinds
    assert "display_data" in kinds
    assert (HERE / "rings.ipynb").stat().st_size < 300_000


def test_its_cells_run(notebook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    code = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    text = "\n\n".join(code)
    for old, new in SMALLER.items():
        assert old in text
        text = text.replace(old, new)
    exec(text, names)
    plt.close("all")
    names["run"].close()
    assert names["cores"].widths.shape[1] == 6
    assert names["chronology"].corr(names["weather"]) > 0.3
    assert len(names["profiles"])
