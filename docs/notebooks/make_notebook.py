"""Turn rings.py into rings.ipynb and execute it: `make notebook`."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

HERE = Path(__file__).parent


def cells_of(script: str) -> list[tuple[str, str]]:
    """Split a script at its `# %%` marks into cells: `code` or `markdown`, and the text."""
    cells = []
    for mark, text in re.findall(r"^# %%(.*)\n((?:(?!# %%).*\n?)*)", script, re.M):
        if mark.strip() == "[markdown]":
            cells.append(("markdown", re.sub(r"^# ?", "", text, flags=re.M).strip()))
        else:
            cells.append(("code", text.strip()))
    return cells


def main() -> None:
    """Execute the cells with Jupyter, in a folder of their own; store them with their output."""
    import nbformat
    from nbclient import NotebookClient

    make = {"code": nbformat.v4.new_code_cell, "markdown": nbformat.v4.new_markdown_cell}
    cells = [
        make[kind](text, id=f"cell-{k}")
        for k, (kind, text) in enumerate(cells_of((HERE / "rings.py").read_text(encoding="utf-8")))
    ]
    notebook = nbformat.v4.new_notebook(cells=cells)
    os.environ["PYTHONPATH"] = str(HERE.parents[1])  # for analysis
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=600, resources=resources).execute()
    for cell in notebook.cells:
        cell["metadata"] = {}  # times of execution
    notebook.metadata = {
        "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"},
        "language_info": {"name": "python"},
    }
    nbformat.write(notebook, HERE / "rings.ipynb")


if __name__ == "__main__":
    main()
