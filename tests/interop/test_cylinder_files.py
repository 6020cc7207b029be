"""Cylinder models: what is written, what is read back, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.interop import read_simpleforest, read_treeqsm, write_simpleforest, write_treeqsm
from forest.interop.cylinders import UNKNOWN_YEAR
from forest.trees.skeleton import Skeleton, skeleton_of
from tests.builders import random_arena

Writer = Callable[..., Path]
Reader = Callable[..., Skeleton]
FORMATS = pytest.mark.parametrize(
    ("write", "read", "first"),
    [(write_simpleforest, read_simpleforest, 0), (write_treeqsm, read_treeqsm, 1)],
    ids=["simpleforest", "treeqsm"],
)
# A fixture's folder is the same for all examples: each overwrites the last one's file.
PROPERTY = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def random_tree(seed: int, n: int) -> Skeleton:
    metamers, trees = random_arena(np.random.default_rng(seed), 1, n)
    return skeleton_of(metamers, trees, 0, species="oak", pipe_exponent=2.5, start_year=1900)


def fork() -> Skeleton:
    """A trunk of three internodes; the first bears a branch of two, which bears a twig."""
    joints = np.array(
        [[1, 2, 0], [1, 2, 1], [1, 2, 2], [1, 2, 3], [2, 2, 1], [3, 2, 1], [2, 3, 1]], float
    )
    lower, upper = [0, 1, 1, 2, 4, 4], [1, 2, 4, 3, 5, 6]
    return Skeleton(
        parent=np.array([-1, 0, 0, 1, 2, 2], np.int32),
        start=joints[lower],
        end=joints[upper],
        radius=np.array([0.3, 0.2, 0.15, 0.1, 0.09, 0.05]),
        axis=np.array([0, 0, 1, 0, 1, 2], np.int32),
        order=np.array([0, 0, 1, 0, 1, 2], np.int32),
        birth_year=np.array([2000, 2001, 2001, 2002, 2002, 2003], np.int32),
        leafy=np.array([False, True, True, True, False, True]),
        serial=np.arange(6, dtype=np.int32),
        tree_id=4,
        species="oak",
    )


SIMPLEFOREST = """\
ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,length,growthLength,averagePointDistance,\
segmentID,parentSegmentID,branchOrder,reverseBranchOrder,branchID
0,-1,1.000000,2.000000,0.000000,1.000000,2.000000,1.000000,0.300000,1.000000,6.000000,0.000000,\
0,-1,0,3,0
1,0,1.000000,2.000000,1.000000,1.000000,2.000000,2.000000,0.200000,1.000000,2.000000,0.000000,\
1,0,0,1,0
2,0,1.000000,2.000000,1.000000,2.000000,2.000000,1.000000,0.150000,1.000000,3.000000,0.000000,\
2,0,1,2,1
3,1,1.000000,2.000000,2.000000,1.000000,2.000000,3.000000,0.100000,1.000000,1.000000,0.000000,\
1,0,0,1,0
4,2,2.000000,2.000000,1.000000,3.000000,2.000000,1.000000,0.090000,1.000000,1.000000,0.000000,\
3,2,1,1,1
5,2,2.000000,2.000000,1.000000,2.000000,3.000000,1.000000,0.050000,1.000000,1.000000,0.000000,\
4,2,2,1,2
"""

TREEQSM = """\
radius (m)|length (m)|start_point|axis_direction|parent|extension|branch|branch_order|\
position_in_branch|mad|SurfCov|added|UnmodRadius (m)
0.300000|1.000000|1.000000|2.000000|0.000000|0.000000|0.000000|1.000000|\
0|2|1|0|1|0.000000|1.000000|0|0.300000
0.200000|1.000000|1.000000|2.000000|1.000000|0.000000|0.000000|1.000000|\
1|4|1|0|2|0.000000|1.000000|0|0.200000
0.150000|1.000000|1.000000|2.000000|1.000000|1.000000|0.000000|0.000000|\
1|5|2|1|1|0.000000|1.000000|0|0.150000
0.100000|1.000000|1.000000|2.000000|2.000000|0.000000|0.000000|1.000000|\
2|0|1|0|3|0.000000|1.000000|0|0.100000
0.090000|1.000000|2.000000|2.000000|1.000000|1.000000|0.000000|0.000000|\
3|0|2|1|2|0.000000|1.000000|0|0.090000
0.050000|1.000000|2.000000|2.000000|1.000000|0.000000|1.000000|0.000000|\
3|0|3|2|1|0.000000|1.000000|0|0.050000
""".replace("|", "\t")


@pytest.mark.parametrize(
    ("write", "text"), [(write_simpleforest, SIMPLEFOREST), (write_treeqsm, TREEQSM)]
)
def test_files_are_as_the_formats_have_them(tmp_path: Path, write: Writer, text: str) -> None:
    assert write(fork(), tmp_path / "tree.txt").read_text() == text


@FORMATS
@PROPERTY
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 60))
def test_a_tree_comes_back(
    tmp_path: Path, write: Writer, read: Reader, first: int, seed: int, n: int
) -> None:
    tree = random_tree(seed, n)
    write(tree, tmp_path / "tree.txt", overwrite=True)
    back = read(tmp_path / "tree.txt", tree_id=tree.tree_id, species="oak")
    for name in ("parent", "axis", "order"):
        np.testing.assert_array_equal(getattr(back, name), getattr(tree, name), name)
        assert getattr(back, name).dtype == getattr(tree, name).dtype
    for name in ("start", "end", "radius"):
        np.testing.assert_allclose(getattr(back, name), getattr(tree, name), rtol=0, atol=2e-6)
    assert back.serial.tolist() == list(range(first, len(tree) + first))
    assert (back.birth_year == UNKNOWN_YEAR).all()
    assert not back.leafy.any()
    assert (back.tree_id, back.species) == (tree.tree_id, "oak")


@PROPERTY
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 40))
def test_rows_may_stand_in_any_order(tmp_path: Path, seed: int, n: int) -> None:
    tree = random_tree(seed, n)
    path = write_simpleforest(tree, tmp_path / "tree.csv", overwrite=True)
    header, *rows = path.read_text().splitlines()
    np.random.default_rng(seed).shuffle(rows)
    path.write_text("\n".join([header, *rows, ""]))
    back = read_simpleforest(path)
    assert back.parent[0] == -1
    assert (back.parent < np.arange(len(back))).all()
    here = back.serial  # the index in the tree as it was
    np.testing.assert_array_equal(here[back.parent[1:]], tree.parent[here[1:]])
    np.testing.assert_array_equal(back.order, tree.order[here])
    np.testing.assert_allclose(back.end, tree.end[here], rtol=0, atol=2e-6)
    pairs = {(int(a), int(b)) for a, b in zip(back.axis, tree.axis[here], strict=True)}
    assert len(pairs) == len(set(tree.axis.tolist())) == len({a for a, _ in pairs})


def growth_length(tree: Skeleton, i: int) -> float:
    above = np.flatnonzero(tree.parent == i)
    return float(tree.length[i]) + sum(growth_length(tree, int(k)) for k in above)


def reverse_order(tree: Skeleton, i: int) -> int:
    """Count the segments from here to the furthest end, this one included."""
    above = [int(k) for k in np.flatnonzero(tree.parent == i)]
    if len(above) == 1 and tree.axis[above[0]] == tree.axis[i]:
        return reverse_order(tree, above[0])
    return 1 + max((reverse_order(tree, k) for k in above), default=0)


@PROPERTY
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 40))
def test_derived_columns_say_what_their_names_say(tmp_path: Path, seed: int, n: int) -> None:
    tree = random_tree(seed, n)
    path = write_simpleforest(tree, tmp_path / "tree.csv", overwrite=True)
    table: Any = np.genfromtxt(path, delimiter=",", names=True, ndmin=1)
    for i in range(len(tree)):
        assert table["growthLength"][i] == pytest.approx(growth_length(tree, i), abs=1e-5)
        assert table["reverseBranchOrder"][i] == reverse_order(tree, i)
        p, segment = tree.parent[i], table["segmentID"][i]
        alone = p >= 0 and (tree.parent == p).sum() == 1 and tree.axis[i] == tree.axis[p]
        assert (p >= 0 and segment == table["segmentID"][p]) == alone
        if not alone:
            assert table["parentSegmentID"][i] == (table["segmentID"][p] if p >= 0 else -1)
    write_treeqsm(tree, tmp_path / "tree.txt", overwrite=True)
    cells = np.loadtxt(tmp_path / "tree.txt", delimiter="\t", skiprows=1, ndmin=2)
    for i, (extension, place) in enumerate(cells[:, [9, 12]].astype(int)):
        on = [k for k in np.flatnonzero(tree.parent == i) if tree.axis[k] == tree.axis[i]]
        assert extension == (on[0] + 1 if on else 0)
        assert place == (tree.axis[: i + 1] == tree.axis[i]).sum()


def test_of_several_that_could_go_on_the_thickest_does(tmp_path: Path) -> None:
    text = write_simpleforest(fork(), tmp_path / "tree.csv").read_text()
    # the branch is said to belong to the trunk, as a reconstruction may have it
    (tmp_path / "tree.csv").write_text(text.replace("2,0,1,2,1\n", "2,0,0,2,0\n"))
    assert read_simpleforest(tmp_path / "tree.csv").axis.tolist() == [0, 0, 1, 0, 2, 3]


def test_an_internode_without_length_comes_back(tmp_path: Path) -> None:
    tree = fork()
    end = tree.end.copy()
    end[5] = tree.start[5]
    back = read_treeqsm(write_treeqsm(replace(tree, end=end), tmp_path / "tree.txt"))
    np.testing.assert_array_equal(back.end, end)


def test_spaces_other_columns_and_blank_lines_do_not_matter(tmp_path: Path) -> None:
    rows = [line.split(",") for line in SIMPLEFOREST.splitlines()]
    text = "\n\n".join(", ".join(["x", *reversed(row)]) for row in rows)
    (tmp_path / "tree.csv").write_text("\ufeff" + text + "\n\n", encoding="utf-8")
    back = read_simpleforest(tmp_path / "tree.csv")
    np.testing.assert_array_equal(back.end, fork().end)


def changed(old: str, new: str) -> str:
    assert old in SIMPLEFOREST
    return SIMPLEFOREST.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"tree.csv: is empty; expected a header: ID, parentID"),
        (SIMPLEFOREST.splitlines()[0], r"tree.csv: holds no cylinders"),
        (changed("parentID", "parentId"), r"line 1: no column 'parentID'; did you mean 'parentId'"),
        (changed("\n3,1,", "\n3,9,"), r"line 5: its parent is not in the file"),
        (changed("\n3,1,", "\n3,-1,"), r"line 5: a second base; expected one cylinder with par"),
        (changed("\n0,-1,", "\n0,3,"), r"line 2: no cylinder of the file is a base"),
        (changed("\n1,0,", "\n1,3,"), r"line 3: its parents run in a circle"),
        (changed("\n4,2,", "\n4,4,"), r"line 6: its parents run in a circle"),
        (changed("\n4,2,", "\n3,2,"), r"line 6: a cylinder of this number stands above"),
        (changed("\n4,2,", "\n4,1.5,"), r"line 6: 'parentID' is no whole number"),
        (changed("\n4,2,", "\n4,,"), r"line 6: '' is not a number"),
        (changed("0.090000", "wood"), r"line 6: 'wood' is not a number"),
        (changed("0.090000", "nan"), r"line 6: a value is not finite"),
        (changed("0.090000", "-0.09"), r"line 6: the radius is negative"),
        (changed("\n4,2,", "\n4,2,7,"), r"line 6: 18 values; expected 17, as the header says"),
        (b"\xff\xfe\x00", r"tree.csv: is not a text file"),
    ],
)
def test_wrong_files_are_refused_with_the_line(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    path = tmp_path / "tree.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=message) as caught:
        read_simpleforest(path)
    assert str(caught.value).startswith(str(path))


def test_wrong_treeqsm_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "tree.txt"
    with pytest.raises(InputError, match="cannot be read: no such file"):
        read_treeqsm(path)
    path.write_text(TREEQSM.replace("axis_direction", "direction"))
    with pytest.raises(InputError, match="line 1: no column 'axis_direction'; did you mean 'dir"):
        read_treeqsm(path)
    path.write_text(TREEQSM.replace("0.150000\t1.000000", "0.150000\t-1.000000", 1))
    with pytest.raises(InputError, match="line 4: the length is negative"):
        read_treeqsm(path)


@FORMATS
def test_a_file_is_replaced_only_if_asked(
    tmp_path: Path, write: Writer, read: Reader, first: int
) -> None:
    path = write(fork(), tmp_path / "tree.txt")
    with pytest.raises(InputError, match="exists already"):
        write(fork(), path)
    write(random_tree(1, 1), path, overwrite=True)
    assert len(read(path)) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["tree.txt"]
