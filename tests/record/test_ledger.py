"""A year whose trees or whose dry mass do not add up is not written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from forest.record.ledger import LedgerError
from forest.record.run import open_run
from forest.record.schema import EVENT_KINDS, STATUS, STAYING_KINDS
from tests.record.years import FIRST_YEAR, Columns, append, create, make_year

Tables = dict[str, Columns]


def lose_a_tree(tables: Tables) -> None:
    tables["trees"] = {name: column[1:] for name, column in tables["trees"].items()}


def call_a_tree_dead(tables: Tables) -> None:
    tables["trees"]["status"][0] = STATUS.index("dead")


def forget_a_death(tables: Tables) -> None:
    tables["events"] = {name: column[:0] for name, column in tables["events"].items()}


def grow_from_nothing(tables: Tables) -> None:
    tables["carbon"]["ring"][1] += 1e-4


def lose_count_of_carbon(tables: Tables) -> None:
    tables["carbon"]["income"][2] = np.nan


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lose_a_tree, "population ledger of 2001 .* 30 living before .* 1 died .* not 28 living"),
        (call_a_tree_dead, "not 28 living"),
        (forget_a_death, "0 died .* not 29 living"),
        (grow_from_nothing, "carbon ledger of 2001 does not balance in row 1"),
        (lose_count_of_carbon, "carbon ledger of 2001 does not balance in row 2"),
    ],
)
def test_faults_are_named_and_not_written(
    tmp_path: Path, fault: Callable[[Tables], None], message: str
) -> None:
    path = tmp_path / "run.h5"
    with create(path) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR)
        wrong = make_year(FIRST_YEAR + 1)
        fault(wrong)
        with pytest.raises(LedgerError, match=message):
            writer.append_year(FIRST_YEAR + 1, wrong)
        append(writer, FIRST_YEAR + 1, FIRST_YEAR + 1)
    with open_run(path) as run:
        assert run.years.tolist() == [FIRST_YEAR, FIRST_YEAR + 1]


@pytest.mark.parametrize("kind", EVENT_KINDS)
def test_every_kind_of_event_moves_the_count_as_it_should(tmp_path: Path, kind: str) -> None:
    change = 0 if kind in STAYING_KINDS else {"planted": 1, "recruited": 1}.get(kind, -1)
    tables = make_year(FIRST_YEAR + 1)
    tables["events"]["kind"][:] = EVENT_KINDS.index(kind)
    whole = make_year(FIRST_YEAR)["trees"]
    twice = {name: np.concatenate((column, column[:1])) for name, column in whole.items()}
    tables["trees"] = {name: column[: 30 + change] for name, column in twice.items()}
    with create(tmp_path / "run.h5") as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR)
        writer.append_year(FIRST_YEAR + 1, tables)
        assert writer.living == 30 + change


def test_a_gap_of_rounding_is_allowed(tmp_path: Path) -> None:
    tables = make_year(FIRST_YEAR)
    tables["carbon"]["income"] *= 1.0 + 5e-7
    with create(tmp_path / "run.h5") as writer:
        writer.append_year(FIRST_YEAR, tables)
        assert writer.years_done == 1


def test_a_missing_column_stops_the_writer(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    writer = create(path)
    append(writer, FIRST_YEAR, FIRST_YEAR)
    tables = make_year(FIRST_YEAR + 1)
    del tables["rings"]["width_mm"]
    with pytest.raises(KeyError, match="width_mm"):
        writer.append_year(FIRST_YEAR + 1, tables)
    with open_run(path) as run:
        assert run.years.tolist() == [FIRST_YEAR]
        assert len(run.trees) == len(make_year(FIRST_YEAR)["trees"]["year"])
