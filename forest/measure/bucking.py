"""Bucking: the cuts that make the most of a stem, by dynamic programming.

A stem is cut from the stump up at multiples of a module (0.1 m unless told otherwise). Of the value
that the stem above each place can still give, the greatest is found from the top down: leave one
module as waste, or cut one of the logs that fit. All stems are worked on together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.measure.stem import Stems

if TYPE_CHECKING:
    import pandas as pd

#: Cuts fall on multiples of this length above the stump, m.
MODULE_M = 0.1

_WASTE = -1
_EQUAL = 1e-9


class Product(NamedTuple):
    """What a buyer takes.

    Attributes
    ----------
    name : str
        Name of the assortment.
    lengths_m : tuple of float
        Lengths of a log that are taken; `Product.between` makes a range.
    top_diameter_cm : float
        Least diameter at the thin end.
    price_m3 : float
        What a cubic metre under bark brings, in any currency.
    over_bark : bool
        Whether the top diameter is measured over bark.
    """

    name: str
    lengths_m: tuple[float, ...]
    top_diameter_cm: float
    price_m3: float
    over_bark: bool = False

    @classmethod
    def between(
        cls,
        name: str,
        shortest_m: float,
        longest_m: float,
        top_diameter_cm: float,
        price_m3: float,
        *,
        over_bark: bool = False,
        module_m: float = MODULE_M,
    ) -> Product:
        """Make a product of any length from the shortest to the longest, in steps of the module.

        Lengths are multiples of the module: the shortest is rounded up to one, the longest down.
        """
        tiny = 1e-9
        first = math.ceil(shortest_m / module_m - tiny)
        last = math.floor(longest_m / module_m + tiny)
        if last < first:
            raise InputError(
                f"no multiple of {module_m:g} m lies from {shortest_m:g} to {longest_m:g} m",
                where=f"product '{name}'",
                expected="a range of lengths that holds one",
            )
        steps = np.arange(first, last + 1)
        lengths = tuple((steps * module_m).tolist())
        return cls(name, lengths, top_diameter_cm, price_m3, over_bark)


class _Cut(NamedTuple):
    """A log that may be cut: product, length in modules."""

    product: int
    modules: int


def buck(
    stems: Stems,
    products: Sequence[Product],
    *,
    stump_m: ArrayLike = 0.3,
    module_m: float = MODULE_M,
) -> pd.DataFrame:
    """Cut stems into the logs that together bring the most.

    Parameters
    ----------
    stems : Stems
        n stems.
    products : sequence of Product
        What can be sold; of equal values the product named first, and its longest log, is cut.
    stump_m : float or (n,)
        Height of the stump, along the stem.
    module_m : float
        Cuts fall on multiples of it above the stump.

    Returns
    -------
    pandas.DataFrame
        A row per log, from the butt up: `stem` (its number), `log` (1, 2, ...), `product`,
        `from_m` (along the stem, from its base), `length_m`, `top_diameter_cm` (under bark),
        `volume_m3` (under bark, the exact integral), `value`.

    Raises
    ------
    InputError
        If there is no product, or one has no length, a length that is no multiple of the module,
        or no price.
    """
    import pandas as pd

    cuts = _possible_cuts(products, module_m)
    n = len(stems)
    stump = np.broadcast_to(np.asarray(stump_m, np.float64), n)
    modules = np.floor((stems.length_m - stump) / module_m + 1e-9).astype(np.int64)
    most = max(int(modules.max(initial=0)), 0)
    place = stump[:, None] + np.arange(most + 1) * module_m  # (n, most + 1)
    whole = np.repeat(np.arange(n), most + 1)
    volume = stems.volume_below(whole, place.ravel(), over_bark=False).reshape(place.shape)
    under = stems.diameter_along(whole, place.ravel(), over_bark=False).reshape(place.shape)
    choice = _best_cuts(stems, products, cuts, modules, volume, under)

    rows = []
    at = np.zeros(n, np.int64)
    log = np.zeros(n, np.int64)
    while (going := np.flatnonzero(at < modules)).size:
        made = choice[going, at[going]]
        waste = made == _WASTE
        at[going[waste]] += 1
        tree, made = going[~waste], made[~waste]
        here = at[tree]
        end = here + np.array([cut.modules for cut in cuts])[made]
        log[tree] += 1
        rows.append(np.column_stack((tree, log[tree], made, here, end)))
        at[tree] = end
    stem, number, made, here, end = np.concatenate([np.empty((0, 5), np.int64), *rows]).T
    product = np.array([cut.product for cut in cuts])[made]
    names = [p.name for p in products]
    cubic = volume[stem, end] - volume[stem, here]
    logs = pd.DataFrame(
        {
            "stem": stem,
            "log": number,
            "product": pd.Categorical([names[k] for k in product], list(dict.fromkeys(names))),
            "from_m": place[stem, here],
            "length_m": (end - here) * module_m,
            "top_diameter_cm": 100.0 * under[stem, end],
            "volume_m3": cubic,
            "value": cubic * np.array([p.price_m3 for p in products])[product],
        }
    )
    return logs.sort_values(["stem", "log"], ignore_index=True)


def assortments(logs: pd.DataFrame) -> pd.DataFrame:
    """Sum logs by product: `logs` (their number), `volume_m3` and `value`."""
    by_product = logs.groupby("product", observed=True)
    return by_product.agg(
        logs=("log", "size"), volume_m3=("volume_m3", "sum"), value=("value", "sum")
    ).reset_index()


def _best_cuts(
    stems: Stems,
    products: Sequence[Product],
    cuts: list[_Cut],
    modules: NDArray[np.int64],
    volume: NDArray[np.float64],
    under: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Find the best cut at each place of each stem: an index of `cuts`, or waste.

    `volume` and `under` are the volume below each place and the diameter there, (n, places).
    """
    n, places = volume.shape
    over = under / (1.0 - stems.bark_factor[:, None])
    with np.errstate(invalid="ignore"):
        thick = [(over if p.over_bark else under) >= 0.01 * p.top_diameter_cm for p in products]
    best = np.zeros((n, places))
    choice = np.full((n, places), _WASTE)
    for here in range(places - 2, -1, -1):
        value = np.zeros(n)
        made = np.full(n, _WASTE)
        for k, cut in enumerate(cuts):
            end = here + cut.modules
            if end >= places:
                continue
            price = products[cut.product].price_m3
            worth = price * (volume[:, end] - volume[:, here]) + best[:, end]
            more = worth > value * (1.0 + _EQUAL)
            better = thick[cut.product][:, end] & (end <= modules) & more
            value[better] = worth[better]
            made[better] = k
        left = best[:, here + 1]
        wasted = left > value * (1.0 + _EQUAL)  # of equal values, the log is cut further down
        best[:, here] = np.where(wasted, left, value)
        choice[:, here] = np.where(wasted, _WASTE, made)
    return choice


def _possible_cuts(products: Sequence[Product], module_m: float) -> list[_Cut]:
    """List the logs that may be cut, the products as they are named, the longest first."""
    if not products:
        raise InputError("no product", where="bucking", expected="at least one")
    if not module_m > 0.0:
        raise InputError(f"a module of {module_m} m", where="bucking", expected="above 0 m")
    cuts = []
    for number, product in enumerate(products):
        where = f"product '{product.name}'"
        if not product.price_m3 > 0.0:
            raise InputError(f"price {product.price_m3}", where=where, expected="above 0 per m3")
        if not product.lengths_m:
            raise InputError("no length", where=where, expected="at least one, in m")
        for length in sorted(product.lengths_m, reverse=True):
            modules = round(length / module_m)
            if modules < 1 or abs(modules * module_m - length) > 1e-6:
                raise InputError(
                    f"a length of {length:g} m",
                    where=where,
                    expected=f"multiples of {module_m:g} m",
                )
            cuts.append(_Cut(number, modules))
    return cuts
