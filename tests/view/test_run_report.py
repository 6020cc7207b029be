"""`forest report`: one page, nothing from elsewhere, and the numbers of the run file."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from forest.errors import InputError
from forest.record.run import Run, open_run
from forest.view.report import sections
from forest.view.report.parts import number
from forest.view.report.sections import STAND_COLUMNS
from tests.everything import TOML as EVERYTHING
from tests.tiny import TOML, forest

TITLE = "<script>alert(1)</script> & 'ten' \\\"young\\\" trees"
ACT = 'acts=[{kind="thin", year=2005, method="below", share_n=0.4}]'
VOID = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Takes a page apart: tags that are closed, text by element, tables by id."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.text: list[str] = []
        self._table: list[list[str]] | None = None
        self.feed(source)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.tags.append((tag, given))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self._table = self.tables.setdefault(given.get("id", ""), [])
        if tag == "tr" and self._table is not None:
            self._table.append([])
        if tag in ("td", "th") and self._table:
            self._table[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        if tag == "table":
            self._table = None

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.text.append(data)
        if self._table and self.open[-1] in ("td", "th"):
            self._table[-1][-1] += data


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run file and its report."""
    folder = tmp_path_factory.mktemp("report")
    toml = folder / "tiny.toml"
    toml.write_text(TOML.replace("ten young trees", TITLE))
    code, _, err = forest("run", toml, "--set", ACT, "--out", folder / "run.h5")
    assert code == 0, err
    code, out, err = forest("report", folder / "run.h5", "--to", folder / "report.html")
    assert code == 0, err
    assert "MB" in out
    assert "Only 6 trees live" in err
    return folder / "run.h5", folder / "report.html"


@pytest.fixture(scope="module")
def page(made: tuple[Path, Path]) -> Page:
    return Page(made[1].read_text(encoding="utf-8"))


def test_the_page_needs_nothing_from_elsewhere(made: tuple[Path, Path], page: Page) -> None:
    source = made[1].read_text(encoding="utf-8")
    assert len(source) < 3_000_000
    assert not re.search(r"(https?:)?//[a-z]", re.sub(r"base64,[\w+/=]+", "", source))
    assert {tag for tag, _ in page.tags}.isdisjoint({"script", "link", "iframe", "object"})
    for tag, given in page.tags:
        for name in ("src", "href", "srcset", "data", "action"):
            if name in given:
                start = "data:image/" if tag == "img" else "#"
                assert given[name].startswith(start), (tag, name)
        assert not any(name.startswith("on") for name in given)
    for kind, data in re.findall(r'src="data:image/([\w+]+);base64,([^"]+)"', source):
        bytes_ = base64.b64decode(data, validate=True)
        if kind == "svg+xml":
            svg = bytes_.decode()
            assert "<svg" in svg
            assert "<image" not in svg and "<script" not in svg
            assert not re.search(r'href="(?!#)', svg)
        else:
            assert np.asarray(Image.open(io.BytesIO(bytes_)).convert("RGB")).std() > 2.0


def test_the_page_can_be_read_without_pictures(page: Page) -> None:
    alts = [given.get("alt", "") for tag, given in page.tags if tag == "img"]
    assert len(alts) > 15
    assert all(len(alt) > 10 for alt in alts)
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert max(np.diff(levels)) <= 1
    targets = {given["id"] for _, given in page.tags if "id" in given}
    links = [given["href"][1:] for tag, given in page.tags if tag == "a"]
    assert len(links) >= 7 and set(links) <= targets
    ids = [given["id"] for _, given in page.tags if "id" in given]
    assert len(set(ids)) == len(ids)


def test_text_of_the_file_is_only_text(made: tuple[Path, Path], page: Page) -> None:
    said = "<script>alert(1)</script> & 'ten' \"young\" trees"
    assert said in "".join(page.text)
    assert "<script" not in made[1].read_text(encoding="utf-8")


def test_numbers_are_those_of_the_run_file(made: tuple[Path, Path], page: Page) -> None:
    with open_run(made[0]) as run:
        whole = run.stand[run.stand["species"].astype(str) == "all"]
        wanted = [
            [
                str(int(row["year"])),
                *(number(row[name], digits) for name, (_, digits) in STAND_COLUMNS.items()),
            ]
            for _, row in whole.iterrows()
        ]
        ledger = run.ledger
        treatments = run.treatments
        dbh = run.trees.query("tree_id == 1")["dbh_cm"].iloc[-1]
        digest = run.digest
    assert page.tables["stand-table"][1:] == wanted
    rows = {row[0]: row[1] for row in page.tables["ledger"][1:]}
    assert rows["planted"] == str(int(ledger["planted"].sum()))
    assert rows["felled (thinning)"] == str(int(ledger["felled_thinning"].sum())) == "4"
    assert rows["living at the end"] == str(int(ledger["living"].iloc[-1]))
    whole = treatments[treatments["species"].astype(str) == "all"]
    before, after = whole["n_ha"].tolist()
    assert page.tables["treatments"][1][2] == f"{before:.0f} → {after:.0f}"
    said = "".join(page.text)
    assert f"{dbh:.4g}" in said
    assert digest in said


def test_the_same_run_gives_the_same_page(made: tuple[Path, Path], tmp_path: Path) -> None:
    to = tmp_path / "again.html"
    assert forest("report", made[0], "--to", to)[0] == 0
    assert to.read_bytes() == made[1].read_bytes()


class Tables:
    """Tables of a run, by hand."""

    def __init__(self, **frames: pd.DataFrame) -> None:
        self.tables = tuple(frames)
        self._frames = frames

    def __getattr__(self, name: str) -> pd.DataFrame:
        return self._frames[name]

    def count(self, table: str) -> int:
        return len(self._frames[table])


def test_storms_by_hand() -> None:
    storms = pd.DataFrame(
        {
            "year": [2003] * 5 + [2005] * 2,
            "storm": [1, 1, 1, 2, 2, 1, 1],
            "storm_m_s": [20.0] * 3 + [25.0] * 2 + [30.0] * 2,
            "direction_deg": 90.0,
            "outcome": ["stood", "broken", "uprooted", "broken", "broken", "stood", "stood"],
        }
    )
    section = sections.storm_section(Tables(storms=storms))
    assert section is not None
    (rows,) = Page(section.html).tables.values()
    assert rows[1:] == [
        ["2003, 1", "20.0", "90", "3", "1", "1"],
        ["2003, 2", "25.0", "90", "2", "2", "0"],
        ["2005, 1", "30.0", "90", "2", "0", "0"],
    ]
    assert sections.storm_section(Tables(storms=storms[:0])) is None


def test_balances_by_hand() -> None:
    years = [2001, 2002, 2003]
    deadwood = pd.DataFrame(
        {"year": years, "species": "all", "standing_m3ha": [0.0, 4.0, 2.0], "lying_m3ha": 1.5}
    )
    regeneration = pd.DataFrame(
        {
            "year": years * 2,
            "species": ["picea_abies"] * 3 + ["fagus_sylvatica"] * 3,
            "n_ha": [100.0, 200.0, 50.0, 10.0, 20.0, 30.0],
            "recruits_ha": 0.0,
        }
    )
    climate = pd.DataFrame(
        {
            "year": years,
            "species": "picea_abies",
            "temperature_c": [8.0, 9.5, 7.0],
            "precipitation_mm": float("nan"),
            "drought_index": float("nan"),
            "factor": 1.0,
        }
    )
    tables = Tables(deadwood=deadwood, regeneration=regeneration, climate=climate)
    section = sections.flow_section(tables)
    assert section is not None
    alts = [given["alt"] for tag, given in Page(section.html).tags if tag == "img"]
    assert len(alts) == 3  # no curve for what is not known, none for a factor that stays
    assert "9.5" in alts[0] and "temperature" in alts[0]
    assert "standing: 0 in 2001, 2 in 2003, lowest 0, highest 4" in alts[1]
    assert "seedlings: 110 in 2001, 80 in 2003, lowest 80, highest 220" in alts[2]


@pytest.mark.stand
def test_everything_is_reported(tmp_path: Path) -> None:
    toml = tmp_path / "everything.toml"
    toml.write_text(EVERYTHING)
    run, to = tmp_path / "run.h5", tmp_path / "report.html"
    assert forest("run", toml, "--out", run)[0] == 0
    code, _, err = forest("report", run, "--to", to)
    assert code == 0, err
    assert "left out" not in err
    said = "".join(Page(to.read_text(encoding="utf-8")).text)
    for title in ("Storms", "Treatments", "Climate and balances", "Sample trees", "Provenance"):
        assert title in said


def test_a_run_of_few_tables_and_years(tmp_path: Path) -> None:
    toml = tmp_path / "tiny.toml"
    toml.write_text(TOML)
    run, to = tmp_path / "run.h5", tmp_path / "report.html"
    words = ("--set", "output.tables=['stand']", "--set", "years=1")
    assert forest("run", toml, "--out", run, *words)[0] == 0
    code, _, err = forest("report", run, "--to", to)
    assert code == 0, err
    assert "no table of trees" in err and "no table of events" in err
    assert Page(to.read_text(encoding="utf-8")).tables["stand-table"]


def test_what_cannot_be_read_is_left_out_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    toml, path = tmp_path / "tiny.toml", tmp_path / "run.h5"
    toml.write_text(TOML)
    few = ("--set", "years=2", "--set", "output.sample_trees={}")
    assert forest("run", toml, "--out", path, *few)[0] == 0

    def damaged(run: Run) -> None:
        raise InputError("is damaged: <events>", where=str(run.path))

    monkeypatch.setattr(Run, "ledger", property(damaged))
    to = tmp_path / "report.html"
    code, _, err = forest("report", path, "--to", to)
    assert code == 0
    assert "left out" in err
    page = Page(to.read_text(encoding="utf-8"))
    assert "is damaged: <events>" in "".join(page.text)
    assert page.tables["stand-table"]


def test_what_is_refused(made: tuple[Path, Path], tmp_path: Path) -> None:
    old = tmp_path / "old.html"
    old.write_text("older")
    for to, said in (
        (tmp_path / "report.pdf", ".html"),
        (tmp_path / "nowhere" / "report.html", "there is no folder"),
        (old, "--force"),
    ):
        code, _, err = forest("report", made[0], "--to", to)
        assert code == 2 and said in err and err.count("\n") == 1
    assert forest("report", tmp_path / "no.h5", "--to", tmp_path / "a.html")[0] == 2
    assert old.read_text() == "older"
    assert [path.name for path in tmp_path.iterdir()] == ["old.html"]
