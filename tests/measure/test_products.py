"""Lists of products from files, and what is refused in them."""

from __future__ import annotations

from pathlib import Path

import pytest

from forest.errors import InputError
from forest.measure.bucking import Product
from forest.measure.products import DEFAULT_PRODUCTS, read_products

TOML = """
[[products]]
name = "sawlog"
lengths_m = [4.0, 5]
top_diameter_cm = 20
price_m3 = 90

[[products]]
name = "pulpwood"
shortest_m = 2.0
longest_m = 3.0
top_diameter_cm = 8
price_m3 = 35.5
over_bark = true
"""
CSV = """name,lengths_m,shortest_m,longest_m,top_diameter_cm,price_m3,over_bark
sawlog,4.0 5,,,20,90,
pulpwood,,2,3,8,35.5,yes
"""
BOTH = [
    Product("sawlog", (4.0, 5.0), 20.0, 90.0),
    Product.between("pulpwood", 2.0, 3.0, 8.0, 35.5, over_bark=True),
]


@pytest.mark.parametrize(("name", "text"), [("p.toml", TOML), ("p.csv", CSV)])
def test_a_list_is_read(tmp_path: Path, name: str, text: str):
    (tmp_path / name).write_text(text)
    assert read_products(tmp_path / name) == BOTH


@pytest.mark.parametrize(
    ("name", "old", "new", "says"),
    [
        (
            "p.toml",
            "price_m3 = 90",
            "prize_m3 = 90",
            "products[0]: unknown key 'prize_m3'; did you",
        ),
        ("p.toml", "price_m3 = 90", "", "products[0]: no price_m3; expected a number above 0"),
        ("p.toml", "price_m3 = 90", "price_m3 = -1", "price_m3 is -1; expected a number above 0"),
        ("p.toml", "price_m3 = 90", "price_m3 = true", "price_m3 is True"),
        ("p.toml", "[4.0, 5]", "[]", "lengths_m is []"),
        ("p.toml", "[4.0, 5]", "[4.0, 'x']", "lengths_m is 'x'"),
        ("p.toml", "longest_m = 3.0", "longest_m = 1.0", "shortest_m 2 above longest_m 1"),
        ("p.toml", "longest_m = 3.0", "lengths_m = [3.0]", "both lengths_m and a range"),
        ("p.toml", "lengths_m = [4.0, 5]", "", "products[0]: no length"),
        ("p.toml", "pulpwood", "sawlog", "products[1]: two products 'sawlog'"),
        ("p.toml", "[[products]]", "[[product]]", "unknown key 'product'"),
        ("p.toml", "over_bark = true", "over_bark = 1", "over_bark is 1"),
        ("p.toml", "[4.0", "[4.0,,", "not TOML"),
        ("p.csv", "sawlog,4.0", "sawlog", "line 2: has another number of columns"),
        ("p.csv", "yes", "perhaps", "line 3: over_bark is 'perhaps'; expected true or false"),
        ("p.csv", "sawlog", "", "line 2: no name"),
        ("p.csv", "90", "ninety", "price_m3 is 'ninety'"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, old: str, new: str, says: str):
    text = TOML if name.endswith("toml") else CSV
    assert old in text
    path = tmp_path / name
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as refused:
        read_products(path)
    assert says in str(refused.value)
    assert str(path) in str(refused.value)


def test_files_that_are_none(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_products(tmp_path / "none.toml")
    with pytest.raises(InputError, match=r"unknown format '.txt'; expected a name that ends in"):
        read_products(tmp_path / "p.txt")
    (tmp_path / "empty.csv").write_text("name,price_m3\n")
    with pytest.raises(InputError, match="no product; expected at least one"):
        read_products(tmp_path / "empty.csv")


def test_the_default_list_falls_in_value_with_diameter():
    tops = [product.top_diameter_cm for product in DEFAULT_PRODUCTS]
    prices = [product.price_m3 for product in DEFAULT_PRODUCTS]
    assert tops == sorted(tops, reverse=True)
    assert prices == sorted(prices, reverse=True)
