"""Development stages: each by an example, and against the rule told one stand at a time."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.measure.stages import STAGES, development_stage

NAN = math.nan


def slowly(height: float, qmd: float, ground: float) -> str:
    if math.isnan(height):
        return "bare"
    if height < 3 or ground < 2:
        return "regeneration"
    if height >= 10 and 100 * height / qmd >= 150:
        return "layered"
    for least, name in ((50, "old"), (35, "mature"), (20, "timber"), (7, "pole")):
        if qmd >= least:
            return name
    return "thicket"


@pytest.mark.parametrize(
    ("height", "qmd", "ground", "stage"),
    [
        (NAN, NAN, 0.0, "bare"),
        (0.4, NAN, 0.0, "regeneration"),
        (28.0, 45.0, 1.5, "regeneration"),  # a few seed trees over it
        (4.0, 3.5, 6.0, "thicket"),
        (8.4, 8.7, 20.6, "pole"),  # pines at 20, 60 and 100 years
        (21.5, 22.7, 30.3, "timber"),
        (34.0, 38.0, 40.0, "mature"),
        (40.0, 50.0, 40.0, "old"),
        (20.0, 9.0, 25.0, "layered"),
    ],
)
def test_stages_by_example(height, qmd, ground, stage):
    assert development_stage([height], [qmd], [ground]).tolist() == [stage]
    assert slowly(height, qmd, ground) == stage
    assert stage in STAGES


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 50), st.floats(0.1, 90), st.floats(0, 60)), max_size=20))
def test_stages_equal_their_slow_twin(stands):
    height, qmd, ground = zip(*stands, strict=True) if stands else ((), (), ())
    assert development_stage(height, qmd, ground).tolist() == [slowly(*of) for of in stands]
