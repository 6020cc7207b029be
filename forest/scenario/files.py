"""The files that a scenario names: stem maps, climates, marker clouds, meshes."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from forest.errors import InputError, nearest
from forest.species.schema import Refusal
from forest.species.text import read_bytes, read_text

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".vtp")
_LIMIT_M = 1e5
_BRUSH_M = (1e-3, 1000.0)


def locate(file: str, context: Any) -> Path:
    """Find a file that is named relative to the scenario's folder."""
    folder = context["folder"] if context else Path()
    try:
        return folder / Path(file).expanduser()
    except RuntimeError:
        return folder / file


def _rows(
    file: str, context: Any, columns: tuple[str, ...]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Read a CSV's rows with their line numbers; `columns` must be there."""
    path = locate(file, context)
    try:
        text = read_text(path, where="")
    except InputError as error:
        raise Refusal(str(error)) from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    header: list[str] | None = None
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if header is None:
                header = [cell.strip() for cell in cells]
                _check_header(file, reader.line_num, header, columns)
            elif len(cells) != len(header):
                raise Refusal(
                    f"{file!r} line {reader.line_num} has {len(cells)} columns",
                    expected=f"{len(header)} as in its header",
                )
            else:
                row = dict(zip(header, (cell.strip() for cell in cells), strict=True))
                yield reader.line_num, row
    except csv.Error as error:
        raise Refusal(f"{file!r} line {reader.line_num} is not CSV: {error}") from None
    if header is None:
        raise Refusal(f"{file!r} is empty", expected="columns " + ", ".join(columns))


def _check_header(file: str, line: int, header: list[str], columns: tuple[str, ...]) -> None:
    for column in columns:
        if column not in header:
            there = ", ".join(header)
            raise Refusal(
                f"{file!r} line {line} has no column '{column}' (it has {there[:80]})",
                expected="columns " + ", ".join(columns),
            )
    if len(set(header)) < len(header):
        raise Refusal(f"{file!r} line {line} names a column twice")


def as_number(cell: str) -> float:
    """Read a number as people write it; Python's own float also takes `1_000`."""
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


def as_whole_number(cell: str) -> int:
    """Read a whole number as people write it."""
    if "_" in cell:
        raise ValueError(cell)
    return int(cell)


def _number(
    file: str,
    line: int,
    row: dict[str, str],
    column: str,
    limits: tuple[float, float] = (-_LIMIT_M, _LIMIT_M),
) -> float:
    try:
        value = as_number(row[column])
    except ValueError:
        value = math.nan
    low, high = limits
    if not low <= value <= high:
        raise Refusal(
            f"{file!r} line {line}, column '{column}': {row[column][:40]!r} is not allowed",
            expected=f"a number, {low:g} to {high:g}",
        )
    return value


def read_rows(
    file: str, context: Any, columns: tuple[str, ...]
) -> list[tuple[int, dict[str, str]]]:
    """Read the line number and the cells, by column, of every row of a CSV file.

    `columns` must be there, and a row at least.
    """
    rows = list(_rows(file, context, columns))
    if not rows:
        raise Refusal(f"{file!r} holds no row", expected="at least one below its header")
    return rows


def read_stem_map(
    file: str, default_species: str, context: Any
) -> list[tuple[int, float, float, str]]:
    """Read line number, x_m, y_m and species of every tree of a stem map."""
    trees = []
    for line, row in _rows(file, context, ("x_m", "y_m")):
        x, y = (_number(file, line, row, column) for column in ("x_m", "y_m"))
        trees.append((line, x, y, row.get("species") or default_species))
    if not trees:
        raise Refusal(f"{file!r} holds no tree", expected="at least one row")
    return trees


def read_inventory(file: str, numbers: tuple[str, ...], context: Any) -> list[dict[str, Any]]:
    """Read the trees of an inventory; an empty cell is left out, and so is a dbh of 0.

    `numbers` are the columns that may be missing or empty; `age` is a whole number.
    """
    trees = []
    for line, row in _rows(file, context, ("x_m", "y_m")):
        tree: dict[str, Any] = {"line": line, "species": row.get("species", "")}
        for column in ("x_m", "y_m"):
            tree[column] = _number(file, line, row, column)
        for column in numbers:
            if row.get(column):
                tree[column] = _number(file, line, row, column)
        if tree.get("dbh_cm") == 0.0:
            del tree["dbh_cm"]
        if "age" in tree and tree["age"].is_integer():
            tree["age"] = int(tree["age"])
        trees.append(tree)
    if not trees:
        raise Refusal(f"{file!r} holds no tree", expected="at least one row")
    return trees


def read_climate(
    file: str, variables: Mapping[str, tuple[float, float]], context: Any
) -> list[tuple[int, dict[str, float]]]:
    """Read the years of a climate, in the order of years: each year and its variables.

    `variables` are the columns that may be there, each with its least and greatest value.
    """
    years: dict[int, tuple[int, dict[str, float]]] = {}
    for line, row in _rows(file, context, ("year",)):
        names = [name for name in row if name != "year"]
        unknown = [name for name in names if name not in variables]
        if unknown or not names:
            what = f"has an unknown column '{unknown[0][:40]}'" if unknown else "has only years"
            hint = nearest(unknown[0], variables) if unknown else "one of " + ", ".join(variables)
            raise Refusal(f"{file!r} {what}, {hint}")
        number = _number(file, line, row, "year")
        year = int(number)
        if year != number:
            raise Refusal(
                f"{file!r} line {line}, column 'year': {row['year'][:40]!r} is not allowed",
                expected="a whole number",
            )
        if year in years:
            raise Refusal(f"{file!r} line {line}: {year} stands in line {years[year][0]} already")
        values = {name: _number(file, line, row, name, variables[name]) for name in names}
        years[year] = line, values
    if not years:
        raise Refusal(f"{file!r} holds no year", expected="at least one row")
    ordered = sorted(years)
    for before, after in pairwise(ordered):
        if after != before + 1:
            raise Refusal(
                f"{file!r} line {years[after][0]}: {after} does not follow {before}",
                expected="every year between the first and the last",
            )
    return [(year, years[year][1]) for year in ordered]


def read_cloud(file: str, context: Any) -> list[tuple[float, float, float]]:
    """Read the points of a marker cloud."""
    return [
        (
            _number(file, line, row, "x_m"),
            _number(file, line, row, "y_m"),
            _number(file, line, row, "z_m"),
        )
        for line, row in _rows(file, context, ("x_m", "y_m", "z_m"))
    ]


def read_stroke(
    file: str, context: Any
) -> tuple[list[tuple[float, float, float]], list[float] | None]:
    """Read the points of a brush's path, and its radii where there is a column radius_m."""
    points = []
    radii = []
    for line, row in _rows(file, context, ("x_m", "y_m", "z_m")):
        x, y, z = (_number(file, line, row, column) for column in ("x_m", "y_m", "z_m"))
        points.append((x, y, z))
        if "radius_m" in row:
            radii.append(_number(file, line, row, "radius_m", _BRUSH_M))
    if not points:
        raise Refusal(f"{file!r} holds no point", expected="at least one row")
    return points, radii or None


def find_mesh(file: str, context: Any) -> str:
    """Check that a mesh file exists and is of a known kind; give its absolute path."""
    path = locate(file, context)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise Refusal(f"{file!r} is no mesh", expected=" | ".join(MESH_SUFFIXES))
    try:
        there = path.is_file()
    except (OSError, ValueError):
        there = False
    if not there:
        raise Refusal(f"no such file {str(path)!r}", expected="a mesh file")
    return str(path.absolute())


def digest(file: str) -> str:
    """Hash a file's contents: SHA-256, in hexadecimal."""
    try:
        return hashlib.sha256(read_bytes(Path(file), where="")).hexdigest()
    except InputError as error:
        raise Refusal(str(error)) from None
