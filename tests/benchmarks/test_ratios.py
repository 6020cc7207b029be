"""What must hold on any machine: ratios, never absolute times (`make bench`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.benchmarks.bark import measure_bark
from tests.benchmarks.costs import exponent, measure_stand, thread_counts
from tests.benchmarks.frames import measure_frames
from tests.benchmarks.machine import alone
from tests.benchmarks.runs import run_hectare
from tests.benchmarks.stands import keep_tile

pytestmark = pytest.mark.bench


@pytest.fixture(scope="module")
def stands(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Stands of about 10^5 and 10^6 metamers."""
    tile: Path = tmp_path_factory.mktemp("bench") / "tile.npz"
    alone(keep_tile, str(tile))
    return [alone(measure_stand, str(tile), across, 5) for across in (1, 3)]


def test_cost_grows_no_faster_than_the_stand(stands: list[dict[str, Any]]) -> None:
    assert all(exponent(stands, threads) <= 1.1 for threads in stands[0]["threads"])


@pytest.mark.skipif(len(thread_counts()) < 2, reason="one core")
def test_two_threads_help_and_change_nothing(stands: list[dict[str, Any]]) -> None:
    assert all(stand["same_bits"] for stand in stands)
    assert stands[-1]["gain"]["year"] >= 1.25


def test_writing_is_a_small_share_of_a_run() -> None:
    run = alone(run_hectare, ("plot.size_m=[24, 24]", "years=30"))
    assert run["writing_share"] <= 0.25  # a few milliseconds a year, whatever the size


def test_a_frame_costs_what_it_draws() -> None:
    """Ten times the trees do not make a primitive dearer, nor does shade outweigh the drawing."""
    few, many = (alone(measure_frames, trees, 3)["threads"][1] for trees in (300, 3000))
    assert many["million_cpu_s"] <= 1.5 * few["million_cpu_s"]
    assert many["shaded_s"] <= 2.5 * many["plain_s"]


def test_bark_costs_what_its_elements_do() -> None:
    """Sixteen times the strips, or four times the fractures: an element costs the same."""
    found = alone(measure_bark, 3)
    for more in ("3600 strips", "225 strips, four times the fractures"):
        assert found[more]["element_us"] <= 1.5 * found["225 strips"]["element_us"]
    assert found["225 strips"]["wall_s"] * 20 < found["paper_s"]
