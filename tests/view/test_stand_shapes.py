"""What of a run stands in a view: residual trees as they are, shapes of the nearest year."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from forest.cli.viewing import _nearest_shapes
from forest.errors import InputError
from forest.parametric import load_parameters
from forest.record.checkpoint import checkpoint_paths
from forest.record.run import open_run
from forest.residual import grow_residual
from forest.view.scenery import from_run, scenery_of_run
from forest.view.scenery.build import grow_light, parametric_model
from forest.view.stand_view import draw_stand_view
from tests.tiny import forest, write_tiny

OAK = (
    'residual_trees=[{name="oak", x_m=4, y_m=6, species="lilac", height_m=6, dbh_cm=31, '
    "leaf_area_m2=17}]"
)


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    words = ("--set", OAK, "--set", "environment.canopy={}")
    assert forest("run", write_tiny(folder), "--out", folder / "run.h5", *words)[0] == 0
    return folder / "run.h5"


@pytest.mark.parametrize("most", [200_000, 500])
def test_a_residual_tree_stands_as_it_is_in_the_run(
    run_file: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr(from_run, "MOST_RESIDUAL_LEAVES", most)
    with open_run(run_file) as run:
        scenery = scenery_of_run(run, 2003)
        row = run.read("residual", years=(2003, 2003)).iloc[0]
        own = grow_residual(run.scenario.residual_trees[0])
    number = int(scenery.instances.model[-1])
    assert scenery.instances.scale[-1] == 1.0
    np.testing.assert_allclose(scenery.instances.place[-1], (4.0, 6.0, 0.0))
    description = scenery.models[number].description
    trunk = description.stems[0]
    low, high = trunk.centre[:, :, 2].T
    here = int(np.flatnonzero((low <= 1.3) & (high >= 1.3))[0])
    radius = np.linalg.norm(trunk.side[here], axis=1)
    assert radius.min() - 1e-6 <= 0.155 <= radius.max() + 1e-6
    assert description.leaves.area.sum() == pytest.approx(17.0)
    assert row["leaf_area_m2"] == pytest.approx(17.0)
    assert len(description.leaves.stem) == min(most, len(own.leaves.stem))
    assert scenery.heights[number] == pytest.approx(6.0)


def test_shapes_are_those_of_the_nearest_checkpoint(run_file: Path, tmp_path: Path) -> None:
    words = ("stand-view", run_file, "--size", "60x40", "--no-shadows", "--force")
    out = forest(*words, "--to", tmp_path / "a.png", "--year", "2005")[1]
    assert "2006" in out.split("shapes of")[1] and "0 by parametric stand-ins" in out
    out = forest(*words, "--to", tmp_path / "a.png", "--year", "2006")[1]
    assert "0 scaled from" in out


def test_a_broken_checkpoint_is_passed_over_with_a_note(run_file: Path, tmp_path: Path) -> None:
    kept = checkpoint_paths(run_file)
    for path in (run_file, *kept):
        shutil.copy(path, tmp_path)
    newest = tmp_path / kept[-1].name
    newest.write_bytes(newest.read_bytes()[:-200])
    words = ("stand-view", tmp_path / run_file.name, "--to", tmp_path / "a.png", "--size", "60x40")
    code, out, err = forest(*words)
    assert code == 0, err
    assert f"{newest.name}: is broken: its shapes are not used" in out
    with open_run(tmp_path / run_file.name) as run:
        at, shapes, _ = _nearest_shapes(tmp_path / run_file.name, run.scenario, 2008)
        assert at == 2006
        assert len(shapes) == len(run.read("trees", years=(2006, 2006)))


def test_a_sample_tree_stands_in_its_nearest_year(run_file: Path) -> None:
    with open_run(run_file) as run:
        sample = run.samples[0]
        shape = run.skeleton(sample, int(run.sample_years(sample)[0]))
        years = [int(year) for year in run.sample_years(sample)]

        class Later:
            """The same run, of which the sample tree is recorded in its first year only."""

            samples = (sample,)

            def __getattr__(self, name: str) -> object:
                return getattr(run, name)

            def sample_years(self, tree_id: int) -> list[int]:
                return years[:1]

        scenery = scenery_of_run(Later(), years[-1])  # type: ignore[arg-type]
        heights = run.read("trees", ["tree_id", "height_m"], years=(years[-1],) * 2)
    height = float(heights.set_index("tree_id").loc[sample, "height_m"])
    number = heights["tree_id"].tolist().index(sample)
    assert f"(shapes of {years[0]})" in scenery.notes[0]
    assert scenery.tree_heights[number] == pytest.approx(height, rel=1e-4)
    assert scenery.heights[scenery.instances.model[number]] == pytest.approx(
        float(shape.end[:, 2].max() - shape.start[0, 2])
    )


def test_too_many_repeats_are_refused(run_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(from_run, "MOST_TILED", 50)
    with open_run(run_file) as run:
        assert len(scenery_of_run(run, 2002, tile=2).instances.model)
        with pytest.raises(InputError, match="a tile of 2 or less"):
            scenery_of_run(run, 2002, tile=3)


def test_other_suffixes_are_refused(run_file: Path, tmp_path: Path) -> None:
    with open_run(run_file) as run, pytest.raises(InputError, match=r"unknown format '\.jpg'"):
        draw_stand_view(scenery_of_run(run, 2002), tmp_path / "x.jpg")


def test_a_cactus_has_ribs_on_all_stems_and_a_tree_on_its_trunk() -> None:
    for name, levels in (("saguaro", (0, 1)), ("quaking_aspen", (0,))):
        parameters = load_parameters(name)
        model, _ = parametric_model(grow_light(parameters, 3, 500))
        for level, part in enumerate(model.lists[:3]):
            stems = model.description.stems[level]
            if not len(stems.internode):
                continue
            rows = np.arange(part.first[0], part.first[1])
            corners = part.vertices[rows].reshape(-1, 3)
            ends = stems.centre[0]
            reach = np.linalg.norm(corners[:, None] - ends, axis=2).min(axis=1)
            reach = reach / np.linalg.norm(stems.side[0], axis=1).max()
            lobed = level in levels
            assert (reach.max() > 1.0 + 0.8 * parameters.lobe_depth) == lobed
