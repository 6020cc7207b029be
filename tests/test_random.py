"""Random numbers: published vectors, the slow twin, and the ranges that kernels rely on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest._jit import njit
from forest.random import normals, philox, uniforms
from tests.reference import random as slow

word = st.integers(0, 2**32 - 1)
whole = st.integers(0, 2**31 - 1)

# Random123 (Salmon et al. 2011), kat_vectors: philox4x32, 10 rounds
KNOWN = [
    ("0 0 0 0", "0 0", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    (" ".join(["ffffffff"] * 4), "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    (
        "243f6a88 85a308d3 13198a2e 03707344",
        "a4093822 299f31d0",
        "d16cfe09 94fdcceb 5001e420 24126ea1",
    ),
]


def _words(text: str) -> list[int]:
    return [int(part, 16) for part in text.split()]


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_published_vectors(counter: str, key: str, expected: str) -> None:
    arguments = [np.uint64(w) for w in _words(counter) + _words(key)]
    assert [int(w) for w in philox(*arguments)] == _words(expected)
    assert list(slow.philox4x32(_words(counter), _words(key))) == _words(expected)


@given(st.tuples(*[word] * 6))
def test_philox_equals_its_twin(words: tuple[int, ...]) -> None:
    got = philox(*(np.uint64(w) for w in words))
    assert tuple(int(w) for w in got) == slow.philox4x32(words[:4], words[4:])


@given(st.integers(0, 2**63 - 1), st.integers(1, 20), whole, whole, st.integers(0, 3000))
def test_uniforms_equal_their_twin(
    seed: int, stream: int, tree: int, serial: int, year: int
) -> None:
    got = uniforms(seed, stream, tree, serial, year)
    assert got == slow.uniforms(seed, stream, tree, serial, year)
    assert all(0.0 < u < 1.0 for u in got)


def test_narrow_integers_draw_the_same() -> None:
    """Kernels pass int32 ids and serials; the number may not hang on their width."""
    wide = uniforms(7, 4, 12, 34, 56)
    assert uniforms(7, 4, np.int32(12), np.int32(34), 56) == wide


@njit
def _many(n):  # type: ignore[no-untyped-def]
    u = np.empty((n, 4))
    z = np.empty((n, 2))
    for k in range(n):
        u[k] = uniforms(1, 2, 3, k, 4)
        z[k] = normals(1, 2, 3, k, 4)
    return u, z


def test_distributions() -> None:
    u, z = _many(20000)
    assert np.abs(u.mean(axis=0) - 0.5).max() < 0.01  # five standard errors
    assert np.abs(u.var(axis=0) - 1 / 12).max() < 0.004
    assert np.abs(z.mean(axis=0)).max() < 0.035
    assert np.abs(z.var(axis=0) - 1.0).max() < 0.05
    together = np.corrcoef(np.hstack((u[:, 2:], z)).T) - np.eye(4)
    assert np.abs(together).max() < 0.035


def test_streams_and_years_differ() -> None:
    draws = {uniforms(1, stream, 2, 3, year)[0] for stream in range(1, 10) for year in range(5)}
    assert len(draws) == 45
