"""The house itself: what the documents say is there, kernels are pure, commands start quickly."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from forest.scenario import Scenario

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "forest").rglob("*.py"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.M | re.S)


def _imports(path: Path) -> list[tuple[str, str]]:
    """List what a module imports, as (module, name)."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [(node.module, alias.name) for alias in node.names]
    return found


def test_kernels_reach_numba_through_jit() -> None:
    """A kernel compiled past forest._jit would be cached where a change is not noticed."""
    for path in SOURCES:
        if path.name != "_jit.py":
            assert all(module.split(".")[0] != "numba" for module, _ in _imports(path)), path


def test_files_hold_one_idea() -> None:
    too_long = {p.name: n for p in SOURCES if (n := len(p.read_text().splitlines())) > 500}
    assert not too_long


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_names_in_the_documents_exist(page: Path) -> None:
    """Every `forest.x.y` between backticks is a module or something in one."""
    for name in re.findall(r"`(forest(?:\.\w+)+)(?:\([^`]*\))?`", page.read_text()):
        parts = name.split(".")
        thing = importlib.import_module("forest")
        for k, part in enumerate(parts[1:], start=2):
            if not hasattr(thing, part):
                importlib.import_module(".".join(parts[:k]))
            thing = getattr(thing, part)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_files_in_the_documents_exist(page: Path) -> None:
    text = page.read_text()
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
        assert (page.parent / target).exists(), target
    for target in re.findall(r"`((?:forest|tests|scenarios|docs)/[\w./]*)`", text):
        assert (ROOT / target).exists(), target


@pytest.mark.parametrize("page", [*PAGES, ROOT / "Makefile"], ids=lambda p: p.name)
def test_commands_in_the_documents_exist(page: Path) -> None:
    """Every `forest ...` line names a command and options that the program has."""
    from typer.main import get_command

    from forest.cli import app

    commands: dict[str, Any] = vars(get_command(app))["commands"]
    text = page.read_text() if page.name == "Makefile" else "\n".join(_blocks(page, "sh"))
    for line in re.findall(r"^(?:\t@\$\(BIN\)/)?forest (\w.*)$", text, re.M):
        words = line.split("#")[0].split()
        assert words[0] in commands, line
        known = {option for p in commands[words[0]].params for option in p.opts}
        assert {w for w in words if w.startswith("--")} <= known, line


def test_every_room_is_in_the_architecture() -> None:
    page = (ROOT / "docs" / "ARCHITECTURE.md").read_text()
    rooms = {p.parent.name + "/" for p in SOURCES if p.name == "__init__.py"} - {"forest/"}
    assert not {room for room in rooms if f"`{room}`" not in page}


def test_guide_scenario_is_complete() -> None:
    (text,) = _blocks(ROOT / "docs" / "guide.md", "toml")
    assert Scenario.from_toml(text).years == 60


def test_readme_scripts_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The README's Python, as it stands there, on the first years of its scenario."""
    scenario = Scenario.load(ROOT / "scenarios" / "saxony_spruce.toml")
    (tmp_path / "scenarios").mkdir()
    short = scenario.with_overrides(["years=3"]).to_toml()
    (tmp_path / "scenarios" / "saxony_spruce.toml").write_text(short)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for script in _blocks(ROOT / "README.md", "python"):
        exec(script.replace("range(30)", "range(3)"), names)
    assert list(names["run"].years) == [scenario.start_year + k for k in range(3)]
    assert names["stand"].year == scenario.start_year + 2


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda p: p.stem)
def test_shipped_scenarios_are_sound(path: Path) -> None:
    scenario = Scenario.load(path)
    x, _, species = scenario.planting_positions()
    assert len(x) == len(species)
    assert len(x) or scenario.regeneration is not None


def test_help_starts_without_heavy_imports() -> None:
    """`forest --help` must answer at once: no numba, pandas, VTK or plotting."""
    script = (
        "import sys\nfrom forest.cli import main\nsys.argv = ['forest', '--help']\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "heavy = {'numba', 'pandas', 'pyvista', 'vtk', 'matplotlib', 'scipy', 'h5py', 'pyarrow'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    answer = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert answer.stderr.strip() == "[]"
    assert "run" in answer.stdout
