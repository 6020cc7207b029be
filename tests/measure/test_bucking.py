"""Bucking: a stem by hand, and every possible cutting of small ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.measure.bucking import Product, assortments, buck
from tests.measure.test_stem import upright
from tests.reference.mensuration import best_value

SAW = Product("saw", (4.0,), 20.0, 100.0)
PULP = Product("pulp", (2.0,), 8.0, 40.0)


def test_a_stem_by_hand():
    # 0.3 m stump, 4 m of saw log, 0.7 m too thin for more, then two pulp logs, and waste
    stems = upright(([5.0, 9.2, 11.0], [0.3, 0.1, 0.05]))
    logs = buck(stems, [SAW, PULP])
    assert logs["product"].tolist() == ["saw", "pulp", "pulp"]
    assert logs["log"].tolist() == [1, 2, 3]
    # waste of 0.9 m lies where wood is thin: the pulp logs begin in the thick part
    assert logs["from_m"].tolist() == pytest.approx([0.3, 4.3, 6.3])
    thick, thin = math.pi / 4 * 0.09, math.pi / 4 * 0.01
    volume = [4 * thick, 0.7 * thick + 1.3 * thin, 2 * thin]
    assert logs["volume_m3"].tolist() == pytest.approx(volume)
    assert logs["value"].tolist() == pytest.approx(
        [100 * volume[0], 40 * volume[1], 40 * volume[2]]
    )
    assert logs["top_diameter_cm"].tolist() == pytest.approx([30, 10, 10])
    sums = assortments(logs)
    assert sums["product"].tolist() == ["saw", "pulp"]
    assert sums["logs"].tolist() == [1, 2]
    assert sums["volume_m3"].tolist() == pytest.approx([volume[0], volume[1] + volume[2]])


def test_a_cheap_log_gives_way_to_two_dear_ones():
    stems = upright(([6.0], [0.2]))
    long = Product("long", (5.0,), 10.0, 50.0)
    short = Product("short", (3.0,), 10.0, 45.0)
    assert buck(stems, [long, short], stump_m=0.0)["product"].tolist() == ["short", "short"]
    assert buck(stems, [long], stump_m=0.0)["length_m"].tolist() == [5.0]


def test_bark_counts_where_the_buyer_counts_it():
    stems = upright(([3.0], [0.18]), bark_factor=0.1)
    under = Product("a", (2.0,), 19.0, 50.0)
    assert len(buck(stems, [under])) == 0
    assert len(buck(stems, [under._replace(over_bark=True)])) == 1


def test_ranges_of_lengths():
    product = Product.between("a", 2.0, 2.5, 8.0, 50.0)
    assert product.lengths_m == pytest.approx((2.0, 2.1, 2.2, 2.3, 2.4, 2.5))
    stems = upright(([2.7], [0.2]), ([1.0], [0.2]))
    logs = buck(stems, [product])
    assert logs["stem"].tolist() == [0]
    assert logs["length_m"].tolist() == pytest.approx([2.4])


def test_refusals():
    stems = upright(([3.0], [0.18]))
    with pytest.raises(InputError, match="no product"):
        buck(stems, [])
    with pytest.raises(InputError, match=r"'saw': a length of 4.05 m; expected multiples of 0.1 m"):
        buck(stems, [SAW._replace(lengths_m=(4.05,))])
    with pytest.raises(InputError, match="above 0 per m3"):
        buck(stems, [SAW._replace(price_m3=0.0)])
    with pytest.raises(InputError, match="no length"):
        buck(stems, [SAW._replace(lengths_m=())])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_equals_trying_every_cut(seed):
    rng = np.random.default_rng(seed)
    shapes = []
    for _ in range(3):
        k = int(rng.integers(1, 5))
        ends = np.cumsum(rng.uniform(0.2, 1.6, k))
        shapes.append((ends.tolist(), np.sort(rng.uniform(0.05, 0.4, k))[::-1].tolist()))
    goods = [
        Product("a", (1.5, 2.0), float(rng.uniform(10, 30)), float(rng.uniform(50, 100))),
        Product("b", (0.5, 1.0), float(rng.uniform(5, 20)), float(rng.uniform(20, 80))),
    ]
    logs = buck(upright(*shapes), goods, stump_m=0.2, module_m=0.5)
    value = logs.groupby("stem")["value"].sum().reindex(range(3), fill_value=0.0)
    of = [
        ([round(h / 0.5) for h in p.lengths_m], 0.01 * p.top_diameter_cm, p.price_m3) for p in goods
    ]
    for stem, (ends, diameters) in enumerate(shapes):
        assert value[stem] == pytest.approx(best_value(ends, diameters, of, 0.2, 0.5))
    # logs lie one after the other, and each is as thick as its buyer wants
    for _, own in logs.groupby("stem"):
        end = own["from_m"] + own["length_m"]
        assert (own["from_m"].to_numpy()[1:] >= end.to_numpy()[:-1] - 1e-9).all()


def test_lengths_lie_within_the_product() -> None:
    """The shortest is rounded up to a multiple of the module, the longest down."""
    product = Product.between("x", 2.05, 2.35, 10.0, 50.0)
    assert product.lengths_m == pytest.approx((2.1, 2.2, 2.3))
    with pytest.raises(InputError, match="no multiple of"):
        Product.between("x", 2.05, 2.05, 10.0, 50.0)
