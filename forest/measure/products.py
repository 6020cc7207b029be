"""What buyers take, from a file: lists of products as TOML or CSV."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

from forest.errors import InputError, nearest
from forest.measure.bucking import Product
from forest.species.text import parse_toml, read_text

#: Cut where no list is given; prices are plain settings, not a market's.
DEFAULT_PRODUCTS = (
    Product.between("sawlog", 4.0, 6.0, 20.0, 90.0),
    Product.between("small_sawlog", 3.0, 5.0, 12.0, 65.0),
    Product.between("pulpwood", 2.0, 3.0, 7.0, 35.0, over_bark=True),
)

_KEYS = (
    "name",
    "lengths_m",
    "shortest_m",
    "longest_m",
    "top_diameter_cm",
    "price_m3",
    "over_bark",
)
_READERS = (".toml", ".csv")
_TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False, "": False}


def read_products(path: str | Path) -> list[Product]:
    """Read a list of products.

    Parameters
    ----------
    path : path
        TOML with a table ``[[products]]`` for each, or CSV with a row for each. Keys or columns:
        `name`, `top_diameter_cm`, `price_m3`; `lengths_m` (in CSV separated by spaces) or
        `shortest_m` and `longest_m`; `over_bark`, if the top diameter is.

    Returns
    -------
    list of Product
        In the order of the file.

    Raises
    ------
    InputError
        If the file is missing or something in it is not right.
    """
    path = Path(path)
    if path.suffix.lower() not in _READERS:
        raise InputError(
            f"unknown format '{path.suffix}'",
            where=str(path),
            expected=f"a name that ends in {' or '.join(_READERS)}",
        )
    text = read_text(path, where="")
    rows = _toml_rows(text, path) if path.suffix.lower() == ".toml" else _csv_rows(text, path)
    if not rows:
        raise InputError("no product", where=str(path), expected="at least one")
    products = [_product(row, where) for where, row in rows]
    for k, product in enumerate(products):
        if product.name in {other.name for other in products[:k]}:
            raise InputError(f"two products '{product.name}'", where=rows[k][0])
    return products


def _toml_rows(text: str, path: Path) -> list[tuple[str, dict[str, Any]]]:
    content = parse_toml(text, where=str(path))
    for key in content:
        if key != "products":
            raise InputError(f"unknown key '{key}'", where=str(path), expected="[[products]]")
    rows = content.get("products", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError("products is no list of tables", where=str(path), expected="[[products]]")
    return [(f"{path}: products[{k}]", row) for k, row in enumerate(rows)]


def _csv_rows(text: str, path: Path) -> list[tuple[str, dict[str, Any]]]:
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True, skipinitialspace=True)
    rows: list[tuple[str, dict[str, Any]]] = []
    try:
        for row in reader:
            where = f"{path} line {reader.line_num}"
            if None in row or None in row.values():
                raise InputError(
                    "has another number of columns than the header",
                    where=where,
                    expected=f"{len(reader.fieldnames or ())} columns",
                )
            rows.append((where, {key.strip(): cell.strip() for key, cell in row.items()}))
    except csv.Error as error:
        raise InputError(f"not CSV: {error}", where=f"{path} line {reader.line_num}") from None
    for where, row in rows:
        if row.get("lengths_m"):
            row["lengths_m"] = row["lengths_m"].split()
        truth = row.get("over_bark", "").lower()
        if truth not in _TRUTHS:
            raise InputError(f"over_bark is '{truth}'", where=where, expected="true or false")
        row["over_bark"] = _TRUTHS[truth]
    # an empty cell is as if the key were not there
    return [(where, {k: v for k, v in row.items() if v != ""}) for where, row in rows]


def _product(row: dict[str, Any], where: str) -> Product:
    for key in row:
        if key not in _KEYS:
            raise InputError(f"unknown key '{key}'; {nearest(key, _KEYS)}", where=where)
    name = row.get("name")
    if not isinstance(name, str) or not name:
        raise InputError("no name", where=where, expected="name, e.g. sawlog")
    over_bark = row.get("over_bark", False)
    if not isinstance(over_bark, bool):
        raise InputError(f"over_bark is {over_bark!r}", where=where, expected="true or false")
    top, price = (_number(row, key, where) for key in ("top_diameter_cm", "price_m3"))
    ranged = {"shortest_m", "longest_m"} & row.keys()
    if ("lengths_m" in row) == bool(ranged):
        both = "both lengths_m and a range" if ranged else "no length"
        raise InputError(both, where=where, expected="lengths_m, or shortest_m and longest_m")
    if ranged:
        shortest, longest = (_number(row, key, where) for key in ("shortest_m", "longest_m"))
        if shortest > longest:
            raise InputError(
                f"shortest_m {shortest:g} above longest_m {longest:g}",
                where=where,
                expected="a range",
            )
        return Product.between(name, shortest, longest, top, price, over_bark=over_bark)
    lengths = row["lengths_m"]
    if not isinstance(lengths, list) or not lengths:
        raise InputError(f"lengths_m is {lengths!r}", where=where, expected="a list of lengths")
    long = tuple(_number({"lengths_m": one}, "lengths_m", where) for one in lengths)
    return Product(name, long, top, price, over_bark)


def _number(row: dict[str, Any], key: str, where: str) -> float:
    """Give a positive number; CSV has it as text."""
    given = row.get(key)
    try:
        value = math.nan if isinstance(given, bool | None) else float(given)
    except (TypeError, ValueError):
        value = math.nan
    if not 0.0 < value < 1e6:
        what = f"no {key}" if given is None else f"{key} is {given!r}"
        raise InputError(what, where=where, expected="a number above 0")
    return value
