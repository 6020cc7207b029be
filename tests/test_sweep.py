"""Sweeps on real clusters: one file per run, failures apart, killed workers, resume."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pandas as pd
import psutil
import pytest
from distributed import LocalCluster
from pandas.testing import assert_frame_equal

import forest as public
from forest.ensemble.bar import RunsBar
from forest.ensemble.design import plan, read_settings
from forest.ensemble.manifest import Manifest
from forest.ensemble.sweep import Sweep, open_sweep, sweep
from forest.ensemble.worker import grow
from forest.errors import InputError
from forest.record.run import open_run
from forest.simulation import simulate
from tests.tiny import assert_same_runs, forest, tiny, write_tiny

YEARS = 2
REPLICATES = 3
MESHES = 'obstacles=[],[{ kind = "mesh", file = "broken.stl" }]'  # the second cannot be read


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str, str]:
    """A folder with a sweep of six runs, of which three fail, and what the command said."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "broken.stl").write_text("no mesh")
    words = ["sweep", write_tiny(folder), *_words(folder)]
    return folder, *forest(*words, "--workers", "2", "--plot", folder / "means.png")


def _words(folder: Path) -> list[str | Path]:
    return ["--set", MESHES, "--replicates", str(REPLICATES), "--years", str(YEARS), "--out",
            folder / "out"]  # fmt: skip


@pytest.fixture(scope="module")
def swept(answer: tuple[Path, int, str, str]) -> Sweep:
    return open_sweep(answer[0] / "out")


def _assert_as_alone(path: Path, tmp_path: Path, *overrides: str) -> None:
    """Compare a run of a sweep with the same run made alone."""
    with (
        open_run(path) as run,
        simulate(tiny(*overrides), tmp_path / f"alone_{path.name}", threads=1) as alone,
    ):
        assert run.complete
        assert_same_runs(run, alone)


# --- what a sweep leaves -------------------------------------------------------------------------


def test_the_command_tells_means_and_failures(answer: tuple[Path, int, str, str]) -> None:
    folder, code, out, err = answer
    assert code == 1
    assert "2002" in out
    assert "1000–1000" in out
    failures = [line for line in err.splitlines() if line.startswith("forest: failed:")]
    assert len(failures) == REPLICATES
    assert all("broken.stl" in line for line in failures)
    assert f"{2 * REPLICATES} of {2 * REPLICATES}: " in err
    assert (folder / "means.png").stat().st_size > 10_000


def test_manifest_lists_every_run(swept: Sweep) -> None:
    table = swept.manifest
    assert swept.parameters == ("obstacles", "years")
    assert table["run"].is_unique
    assert table["status"].tolist() == ["done"] * REPLICATES + ["failed"] * REPLICATES
    assert table["seed"].tolist() == [1, 2, 3] * 2
    assert table["replicate"].tolist() == [0, 1, 2] * 2
    assert table["elapsed_s"].notna().tolist() == [True] * REPLICATES + [False] * REPLICATES
    assert swept.failed["error"].str.contains("broken.stl").all()
    assert not swept.failed["error"].str.contains("\n").any()
    readable = pd.read_csv(swept.folder / "manifest.csv", keep_default_na=False)
    assert readable["error"].tolist() == table["error"].tolist()


def test_only_whole_runs_have_their_name(swept: Sweep) -> None:
    done = swept.manifest.loc[swept.manifest["status"] == "done", "file"]
    assert {path.name for path in swept.folder.iterdir()} == {
        *done,
        "manifest.csv",
        "manifest.parquet",
    }


def test_replicates_are_runs_of_the_next_seeds(swept: Sweep, tmp_path: Path) -> None:
    for file, seed in zip(swept.manifest["file"][:2], (1, 2), strict=True):
        _assert_as_alone(swept.folder / file, tmp_path, f"years={YEARS}", f"seed={seed}")


def test_runs_have_one_thread(swept: Sweep) -> None:
    with open_run(swept.folder / swept.manifest["file"][0]) as run:
        assert run.provenance["sessions"][0]["environment"]["threads"] == 1


def test_means_and_bands(swept: Sweep) -> None:
    values = []
    for file in swept.manifest["file"][:REPLICATES]:
        with open_run(swept.folder / file) as run:
            last = run.stand.query("species == 'all' and year == 2002")
            values.append(last["lai"].item())
    means = swept.means("lai").query("species == 'all' and year == 2002").squeeze()
    assert means["n"] == REPLICATES
    np.testing.assert_allclose(
        means[["mean", "sd", "low", "high"]].to_numpy(float),
        [np.mean(values), np.std(values, ddof=1), *np.quantile(values, [0.05, 0.95])],
    )
    assert means["sd"] > 0
    with pytest.raises(InputError, match="did you mean 'lai'"):
        swept.means("lia")


def test_public_names() -> None:
    assert public.sweep is sweep
    assert public.open_sweep is open_sweep


# --- resume and killed workers -------------------------------------------------------------------


def test_resume_verifies_what_is_there(swept: Sweep, tmp_path: Path) -> None:
    """On a cluster that runs already: one file is missing, one is cut short, one is whole."""
    folder = tmp_path / "out"
    shutil.copytree(swept.folder, folder)
    files = [folder / file for file in swept.manifest["file"][:REPLICATES]]
    files[0].unlink()
    whole = files[1].read_bytes()
    files[1].write_bytes(whole[: len(whole) // 2])
    kept = files[2].stat().st_mtime_ns
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        again = sweep(
            {"tiny": tiny()},
            settings={"obstacles": [[]], "years": [YEARS]},
            replicates=REPLICATES,
            out=_without_failures(folder),
            scheduler=cluster.scheduler_address,
            resume=True,
        )
    assert again.manifest["status"].tolist() == ["done"] * REPLICATES
    assert files[2].stat().st_mtime_ns == kept
    assert_frame_equal(again.stand, swept.stand)
    _assert_as_alone(files[1], tmp_path, f"years={YEARS}", "seed=2")


def _without_failures(folder: Path) -> Path:
    path = folder / "manifest.parquet"
    table = pd.read_parquet(path)
    table[table["status"] == "done"].to_parquet(path, index=False)
    return folder


class Killer(threading.Thread):
    """Kills the process that writes a run file, once the run has a checkpoint."""

    def __init__(self, part: Path) -> None:
        super().__init__(daemon=True)
        self.killed = 0
        self._part = part

    def run(self) -> None:
        end = time.monotonic() + 60
        while not self.killed and time.monotonic() < end:
            time.sleep(0.001)
            if any(self._part.parent.glob(f"{self._part.name}.checkpoint-*.npz")):
                self.killed = self._kill()

    def _kill(self) -> int:
        for child in psutil.Process().children(recursive=True):
            try:
                if any(file.path == str(self._part) for file in child.open_files()):
                    child.kill()
                    return child.pid
            except psutil.Error:
                continue
        return 0


def test_killed_worker_changes_no_bit(tmp_path: Path) -> None:
    scenario = tiny("years=20", "output.checkpoint_every_years=1", "output.sample_trees={}")
    names = [run.name for run in plan({"long": scenario}, {}, 2)]
    killer = Killer(tmp_path / "out" / f"{names[0]}.h5.part")
    killer.start()
    done = sweep({"long": scenario}, replicates=2, out=tmp_path / "out", workers=2)
    killer.join()
    assert killer.killed
    assert done.failed.empty
    path = done.folder / done.manifest["file"][0]
    with open_run(path) as run:
        sessions = run.provenance["sessions"]
        assert len(sessions) == 2  # it went on; it did not start over
        assert sessions[1]["years_before"] > 0
        with simulate(scenario, tmp_path / "alone.h5", threads=1) as alone:
            assert_same_runs(run, alone)
    assert not list(done.folder.glob("*.npz"))


def grow_unless_first(scenario_toml: str, digest: str, path: str) -> float:
    """Die as out of memory if it is the first replicate."""
    if path.endswith("r0.h5"):
        os.kill(os.getpid(), signal.SIGKILL)
    return grow(scenario_toml, digest, path)


def test_run_that_always_kills_its_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forest.ensemble.sweep.grow", grow_unless_first)
    scenarios = {"tiny": tiny("years=1")}
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}):  # each costs a process
        done = sweep(scenarios, replicates=2, out=tmp_path / "out", workers=1)
    assert done.manifest["status"].tolist() == ["failed", "done"]
    assert done.failed["error"].item() == "its process died again and again (out of memory?)"


def test_nothing_to_do_starts_no_processes(
    swept: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(swept.folder, folder)
    monkeypatch.setattr("forest.ensemble.sweep.processes", None)
    again = sweep(
        {"tiny": tiny()},
        settings={"obstacles": [[]], "years": [YEARS]},
        replicates=REPLICATES,
        out=_without_failures(folder),
        resume=True,
    )
    assert_frame_equal(again.manifest, swept.manifest[:REPLICATES])


# --- what is refused at the door -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"settings": {"site.productivty": [1]}}, "did you mean 'productivity'"),
        ({"settings": {"site.productivity": [1, -1]}}, "tiny__site.productivity=-1__r0: "),
        ({"settings": {"site.productivity": [1.0, 1.0]}}, "two runs are called"),
        ({"settings": {"site.productivity": []}}, "expected a list of one value"),
        ({"settings": {"mode": "paper"}}, "'paper' is no list"),
        ({"settings": {"mode": [None]}}, "None is no value"),
        ({"settings": {"seed": [1, 2]}}, "expected --replicates"),
        ({"replicates": 0}, "replicates: 0 replicates"),
        ({"workers": 0}, "workers: 0 workers"),
        ({"workers": 1, "scheduler": "tcp://127.0.0.1:1"}, "exclude each other"),
        ({"scenarios": tiny()}, "a scenario without a name"),
        ({"scenarios": []}, "no scenario to run"),
        ({"scenarios": "missing.toml"}, "no such file"),
    ],
)
def test_refused_before_anything_starts(
    words: dict[str, Any], message: str, tmp_path: Path
) -> None:
    scenarios = words.pop("scenarios", {"tiny": tiny()})
    with pytest.raises(InputError) as refusal:
        sweep(scenarios, out=tmp_path / "out", **words)
    assert message in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_no_scheduler_at_the_address(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no scheduler answers"):
        sweep({"tiny": tiny("years=1")}, out=tmp_path / "out", scheduler="nowhere://at-all")


def test_workers_of_several_threads(tmp_path: Path) -> None:
    scenarios = {"tiny": tiny("years=1")}
    with (
        LocalCluster(1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        pytest.raises(InputError, match="expected one thread each"),
    ):
        sweep(scenarios, out=tmp_path / "out", scheduler=cluster.scheduler_address)


def test_without_dask_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"forest-stand\[cluster\]"):
        sweep({"tiny": tiny()}, out=tmp_path / "out")


def test_a_folder_holds_one_sweep(swept: Sweep, tmp_path: Path) -> None:
    settings = {"obstacles": [[]], "years": [YEARS]}
    with pytest.raises(InputError, match="is not empty; expected a new folder, or --resume"):
        sweep({"tiny": tiny()}, out=swept.folder)
    with pytest.raises(InputError, match="lists a run"):
        sweep({"tiny": tiny()}, settings=settings, out=swept.folder, resume=True)
    folder = tmp_path / "out"
    shutil.copytree(swept.folder, folder)
    other = {"tiny": tiny("site.productivity=1.5")}
    with pytest.raises(InputError, match="was made by a different scenario"):
        sweep(
            other,
            settings=settings,
            replicates=REPLICATES,
            out=_without_failures(folder),
            resume=True,
        )
    with pytest.raises(InputError, match="holds no sweep"):
        open_sweep(tmp_path)


def test_the_command_refuses_with_2(tmp_path: Path) -> None:
    words = "sweep", write_tiny(tmp_path), "--out", tmp_path / "out"
    assert forest(*words, "--set", "mode=")[0] == 2
    assert forest(*words, "--set", "mode=papre,mass_balance")[0] == 2
    assert forest(*words, "--set", "years=1", "--years", "2")[0] == 2
    assert not (tmp_path / "out").exists()


# --- settings and names --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1,2.5", [1, 2.5]),
        ("paper, mass_balance", ["paper", "mass_balance"]),
        ('"a,b",true', ["a,b", True]),
        ("'a]',[1, [2, 3]],[]", ["a]", [1, [2, 3]], []]),
        ("{ x = 1, y = 2 },{}", [{"x": 1, "y": 2}, {}]),
    ],
)
def test_commas_inside_brackets_and_quotes_do_not_split(text: str, values: list[Any]) -> None:
    assert read_settings([f"a.b={text}", "c=1"]) == {"a.b": values, "c": [1]}


@pytest.mark.parametrize("texts", [["a"], ["=1"], ["a=1,,2"], ["a="], ["a=1", "a=2"]])
def test_settings_that_are_none(texts: list[str]) -> None:
    with pytest.raises(InputError, match="--set: "):
        read_settings(texts)


def test_runs_are_the_product_in_order() -> None:
    settings = {"site.productivity": np.array([0.8, 1.2]), "mode": ["paper", "mass_balance"]}
    runs = plan({"a": tiny(), "b": tiny("seed=7")}, settings, 2)
    assert len(runs) == 16
    assert [run.name for run in runs[:3]] == [
        "a__site.productivity=0.8__mode=paper__r0",
        "a__site.productivity=0.8__mode=paper__r1",
        "a__site.productivity=0.8__mode=mass_balance__r0",
    ]
    assert (runs[-1].scenario.seed, runs[-1].scenario.mode) == (8, "mass_balance")
    assert runs[-1].scenario.site.productivity == 1.2


def test_names_fit_any_file_system_and_differ() -> None:
    titles = ["a/b", "a:b", "../x", "x" * 900, "x" * 901, "ä", "1", "a b", "a\nb"]
    names = [run.name for run in plan({"tiny": tiny()}, {"title": titles}, 1)]
    assert len({name.lower() for name in names}) == len(titles)
    assert all(re.fullmatch(r"[\w.=+,-]{1,200}", name, re.ASCII) for name in names)


def test_species_may_be_varied(tmp_path: Path) -> None:
    """The column of the settings leaves the tables' own column its name."""
    settings = {"species": [{"picea_abies": {}}, {"fagus_sylvatica": {}}]}
    runs = plan({"tiny": tiny()}, settings, 1)
    assert [list(run.scenario.species) for run in runs] == [["picea_abies"], ["fagus_sylvatica"]]
    Manifest(tmp_path, runs).write()
    assert open_sweep(tmp_path).parameters == ("set.species",)


def test_bar_says_what_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr("sys.stderr", screen)
    bar = RunsBar()
    bar.begin(3, 1)
    bar.run_ended("b", failed=True)
    bar.run_ended("c", failed=False)
    bar.end()
    assert screen.getvalue().splitlines() == [
        "1 of 3 runs are done already",
        "2 of 3: b failed",
        "3 of 3: c",
    ]
