"""Counter-based random numbers in plain integers: Salmon et al. 2011, section 3.3 (Philox)."""

from __future__ import annotations

from collections.abc import Sequence

WORD = 2**32


def philox4x32(counter: Sequence[int], key: Sequence[int]) -> tuple[int, ...]:
    """Ten rounds: two multiplications, their high and low halves swapped and mixed with the key."""
    x0, x1, x2, x3 = (c % WORD for c in counter)
    k0, k1 = (k % WORD for k in key)
    for _ in range(10):
        high0, low0 = divmod(0xD2511F53 * x0, WORD)
        high1, low1 = divmod(0xCD9E8D57 * x2, WORD)
        x0, x1, x2, x3 = high1 ^ x1 ^ k0, low1, high0 ^ x3 ^ k1, low0
        k0, k1 = (k0 + 0x9E3779B9) % WORD, (k1 + 0xBB67AE85) % WORD
    return x0, x1, x2, x3


def uniforms(seed: int, stream: int, tree_id: int, serial: int, year: int) -> tuple[float, ...]:
    """Four numbers in (0, 1) for one place and year."""
    words = philox4x32((tree_id, serial, year, stream), (seed, seed // WORD))
    return tuple((w + 0.5) / WORD for w in words)
