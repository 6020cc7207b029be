"""Every series gets an id of its own that every program reads."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from forest.dendro import short_ids

names = st.lists(st.text("abAB019_ é", max_size=10), max_size=40)


@settings(max_examples=50, deadline=None)
@given(names)
def test_ids_are_short_plain_and_unique_whatever_the_names(some):
    ids = short_ids(some)
    assert len(ids) == len(some)
    assert all(0 < len(i) <= 6 and i.isascii() and i.isalnum() for i in ids)
    assert len({i.upper() for i in ids}) == len(ids)


@settings(max_examples=25, deadline=None)
@given(st.sets(st.from_regex(r"[A-Z0-9]{1,6}", fullmatch=True), max_size=20), names)
def test_a_sound_id_is_kept_wherever_it_stands(sound, others):
    mixed = [*others, *sorted(sound)]
    ids = short_ids(mixed)
    # Two others may be sound too, and come first, with the same letters in another case.
    first = {name.upper() for name in others if 0 < len(name) <= 6 and name.isalnum()}
    for name, id_ in zip(mixed[len(others) :], ids[len(others) :], strict=True):
        assert id_ == name or name in first


def test_shortening_by_hand():
    names = ["picea_abies_1", "picea_abies_2", "piceaa", "T12", "t12", "é", "T-9"]
    assert short_ids(names) == ["picea1", "picea2", "piceaa", "T12", "t121", "S1", "T9"]


def test_thousands_of_names_with_one_beginning():
    ids = short_ids([f"spruce_stand_{k}" for k in range(3000)])
    assert len(set(ids)) == 3000
    assert max(map(len, ids)) == 6
