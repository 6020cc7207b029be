"""How bark breaks: conservation, the threshold's range, grip, weakness, time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface.bark import FRACTURE, Material, fracture_range, grow_bark, shrinking
from forest.surface.bark.material import Physics
from forest.surface.bark.rings import copied, solve_strip
from tests.reference import bark as twin
from tests.surface.bark_cases import check, column, grown, materials, statistics, strip_of, torn

STILL = {"threshold_jitter": 0.0, "place_jitter": 0.0}


@settings(max_examples=25, deadline=None)
@given(materials(), st.integers(0, 5), st.sampled_from([1, 3]), st.sampled_from([1, 16]))
def test_invariants(material: Material, seed: int, substeps: int, sectors: int) -> None:
    """Widths sum to the girth, epidermis is conserved, no fracture closes, moves or jumps."""
    strips = 12
    rng = np.random.default_rng(seed)
    girth = 0.3 * np.cumprod(1 + rng.uniform(0, 0.15, (9, strips)), axis=0)
    spread = rng.uniform(0.0, 1.0, (strips, sectors)) + 0.01
    bark = grow_bark(
        column(strips),
        girth,
        material,
        seed,
        dilatation=spread,
        substeps=substeps,
        keep=True,
    )
    check(bark)
    last: dict[int, tuple[float, float, float]] = {}
    for snapshot in bark.history:
        e = snapshot.elements
        now = {}
        for row in np.flatnonzero(e.kind == FRACTURE):
            strip = int(np.searchsorted(e.offsets, row, side="right")) - 1
            girth_now = snapshot.girth[strip]
            now[int(e.tear[row])] = (e.width[row], e.uv0[row], e.start[row] / girth_now)
        for node, (width, place, turn) in last.items():
            assert now[node][0] >= width  # never closes
            assert now[node][1] == place
            assert abs(now[node][2] - turn) < 0.2  # goes with the substrate
        last = now


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 50), st.floats(0.05, 0.6), st.floats(0.02, 0.2))
def test_a_ring_grows_like_its_twin(seed: int, jitter: float, spacing: float) -> None:
    girths = list(np.geomspace(0.5, 0.9, 9))
    material = Material(fracture_stiffness=1 / spacing, threshold_jitter=jitter)
    bark = grow_bark(column(1), np.array(girths)[:, None], material, seed)
    rings = bark._rings
    grains = [
        twin.Grain(float(np.round(a * 2.0**30) / 2.0**30), float(b))
        for a, b in zip(rings.spot, rings.drawn, strict=True)
    ]
    expected = twin.grow_ring(
        float(rings.length[0]),
        girths,
        grains,
        spacing=spacing,
        jitter=jitter,
        least_piece=material.least_piece_m,
    )
    e = bark.elements
    found = dict(zip(e.uv0[e.kind == FRACTURE], e.width[e.kind == FRACTURE], strict=True))
    assert found == pytest.approx(expected, rel=1e-6)


def test_stiffness_of_the_parts_of_a_broken_element() -> None:
    """Figure 6: R / l0 of parts in series is that of the whole."""
    bark = grown(1, 0.5, 0.51, 1, threshold_jitter=0.0)
    assert torn(bark)[0] == 0
    one = bark.trigger(0, 0.2).trigger(0, 0.4).elements
    parts = 1.0 / one.rest[one.kind == 0]
    assert 1 / np.sum(1 / parts) == pytest.approx(1 / bark.strips.rest[0], rel=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.01, 1.5), st.floats(0.01, 0.99), st.floats(1.0, 200.0), st.floats(0.1, 3.0))
def test_range_of_the_threshold(growth: float, part: float, soft: float, girth: float) -> None:
    """Homogeneous growth: none above the growth ratio, one between, refused below (3.2.3)."""
    table = np.array([[girth], [girth * growth]])

    def at(threshold: float) -> Material:
        return Material(threshold=threshold, fracture_stiffness=soft, least_piece_m=0.1, **STILL)

    (bound,) = fracture_range(at(2.0), np.array([growth]), np.array([girth]))
    assert bound == pytest.approx(1 + (growth - 1) * soft / (1 / girth + soft))
    above = grow_bark(column(1), table, at(growth + 1e-6))
    assert torn(above)[0] == 0
    between = grow_bark(column(1), table, at(bound + part * (growth - bound)))
    assert torn(between)[0] == 1
    with pytest.raises(InputError, match=r"threshold S = .*break without end.*S above 1\.\d+"):
        grow_bark(column(1), table, at(1 + (bound - 1) * part))


def test_fractures_rise_with_girth() -> None:
    bark = grown(60, 0.3, 1.2, 30, keep=True, least_piece_m=0.002)
    counts = [(s.elements.kind == FRACTURE).sum() for s in bark.history]
    assert counts[0] > 0 and counts == sorted(counts)
    assert counts[-1] > 1.5 * counts[len(counts) // 3]


def test_density_follows_the_stiffness_not_the_girth() -> None:
    """As many fractures to the metre on a thin axis as on a thick one (figure 22b)."""
    girth = np.linspace(1.5, 0.5, 80)
    bark = grow_bark(column(80), shrinking(girth, 0.6), Material())
    density = torn(bark) / girth
    assert density[:20].mean() == pytest.approx(density[-20:].mean(), rel=0.2)
    denser = grow_bark(column(80), shrinking(girth, 0.6), Material(fracture_stiffness=40.0))
    assert torn(denser).sum() > 1.4 * torn(bark).sum()


def test_grip_keeps_fractures_where_growth_is() -> None:
    """Without grip fractures come anywhere; with it where the dilatation is (5.1)."""
    spread = np.full((40, 16), 0.05)
    spread[:, 4:6] = 1.0  # a root's bulge

    def share(attachment: float) -> float:
        girth = np.geomspace(0.8, 1.2, 13)[:, None] * np.ones(40)
        material = Material(attachment=attachment)
        bark = grow_bark(column(), girth, material, 1, dilatation=spread)
        check(bark)
        e, strip = bark.elements, strip_of(bark)
        inside = total = 0.0
        for row in np.flatnonzero(e.kind == FRACTURE):
            (turn,) = bark.turns(strip[row], e.start[row] + 0.5 * e.width[row])
            total += e.width[row]
            inside += e.width[row] * (3.5 / 16 <= turn <= 6.5 / 16)
        return inside / total

    free, gripped = share(0.0), share(1e3)
    assert gripped > 0.8
    assert free < 0.75 * gripped


def test_weakness_map_draws_fractures() -> None:
    weakness = np.zeros((40, 10))
    weakness[:, 3] = 1.0
    girth = shrinking(np.full(40, 0.8), 0.8)
    material = Material(fracture_stiffness=5.0, stray_deg=0.0, place_jitter=0.3)
    bark = grow_bark(column(), girth, material, weakness=weakness)
    part = bark.tears.uv0 / bark.strips.rest[bark.tears.strip]
    assert np.mean((part >= 0.3) & (part < 0.4)) > 0.5
    plain = grow_bark(column(), girth, material)
    part = plain.tears.uv0 / plain.strips.rest[plain.tears.strip]
    assert np.mean((part >= 0.3) & (part < 0.4)) < 0.3


def test_stiffness_curve_shapes_fractures() -> None:
    """Fractures that stiffen let newer ones catch up; those that yield run away (3.2.5)."""

    def gain(curve: object) -> float:
        """Give how much an old fracture opens for each metre that a new one does."""
        bark = grown(1, 0.5, 0.51, 1, threshold=9.0).trigger(0, 0.1)
        bark = bark.grow(np.array([[0.6]])).trigger(0, 0.3)
        bark = replace(bark, material=Material(threshold=9.0, fracture_stiffness=curve))  # type: ignore[arg-type]
        before, after = bark.elements, bark.grow(np.array([[0.61]])).elements
        old, new = (after.width[after.tear == k] - before.width[before.tear == k] for k in (0, 1))
        assert before.width[before.tear == 0] > 0.014 > 0.009 > before.width[before.tear == 1]
        return float(old[0] / new[0])

    assert gain(20.0) == pytest.approx(1.0, rel=1e-6)
    assert gain(((0.009, 20.0), (0.014, 60.0))) == pytest.approx(1 / 3, rel=1e-6)
    assert gain(((0.009, 60.0), (0.014, 20.0))) == pytest.approx(3.0, rel=1e-6)


def test_narrow_sides_yield_more() -> None:
    """K = R w / l0: where a curved axis halves the strip, it opens twice as far (5.3)."""
    geometry = column(1)._replace(width_around=np.array([[1.0, 0.5]]))
    girth = np.array([[1.0], [1.01]])
    bark = grow_bark(geometry, girth, Material(threshold=9.0))
    bark = bark.trigger(0, 0.25).trigger(0, 0.75)
    before, after = bark.elements, bark.grow(np.array([[1.05]])).elements
    gains = [after.width[after.tear == k][0] - before.width[before.tear == k][0] for k in (0, 1)]
    assert gains[1] == pytest.approx(2.0 * gains[0], rel=1e-6)


def test_refracturing_tears_old_fractures() -> None:
    """Figure 9: the surface of one generation is the epidermis of the next."""
    girth = np.full(40, 1.2)
    old = grow_bark(column(), shrinking(girth * 0.8, 0.6), Material(fracture_stiffness=5.0))
    new = old.refracture(shrinking(girth, 0.8)[1:], material=Material(weakness_contrast=3.0))
    check(new)
    assert new.generation == 1 and new.surface is old
    assert (new.fractures.generation == 1).all() and (old.fractures.generation == 0).all()
    assert new.strips.rest == pytest.approx(old.strips.girth)
    inside = 0
    for strip, place in zip(new.tears.strip, new.tears.uv0, strict=True):
        rows, _ = old.elements.at(strip, np.array([place]))
        inside += old.elements.kind[rows[0]] == FRACTURE
    share = np.sum(old.fractures.length * old.fractures.width) / (0.02 * old.strips.girth.sum())
    assert inside / len(new.tears.strip) > 1.5 * share


def test_growth_in_two_goes_is_growth_in_one() -> None:
    girth = np.geomspace(0.4, 0.9, 13)[:, None] * np.ones(40)
    once = grow_bark(column(), girth, Material(), 3)
    early = grow_bark(column(), girth[:6], Material(), 3)
    twice = early.grow(girth[6:])
    for a, b in zip(once.elements, twice.elements, strict=True):
        assert (a == b).all()
    assert early.time == 5.0 and early.strips.girth[0] == girth[5, 0]  # untouched


def test_threads_change_nothing() -> None:
    def run(threads: int) -> list[np.ndarray]:  # type: ignore[type-arg]
        with using_threads(threads):
            return [*grown(70, attachment=10.0).elements]

    for a, b in zip(run(1), run(2), strict=True):
        assert a.tobytes() == b.tobytes()


def test_finer_strips_tell_the_same() -> None:
    """Strips half as wide change what one counts by less than 15 %."""
    coarse, fine = {}, {}
    for seed in range(4):
        for strips, width, into in ((120, 0.02, coarse), (240, 0.01, fine)):
            for name, value in statistics(grown(strips, 0.6, 1.2, 20, seed, width)).items():
                into[name] = into.get(name, 0.0) + value / 4
    for name, value in coarse.items():
        assert fine[name] == pytest.approx(value, rel=0.15), name


@pytest.mark.parametrize(("substeps", "soft"), [(8, 20.0), (16, 5.0)])
def test_finer_steps_tell_the_same(substeps: int, soft: float) -> None:
    """What one counts, number and length of fractures too, does not hang on the time step."""
    coarse, fine = {}, {}
    for seed in range(1, 4):
        for parts, into in ((1, coarse), (substeps, fine)):
            bark = grown(60, 0.6, 1.2, 20, seed, substeps=parts, fracture_stiffness=soft)
            for name, value in statistics(bark).items():
                into[name] = into.get(name, 0.0) + value / 3
    for name, value in coarse.items():
        assert fine[name] == pytest.approx(value, rel=0.1), name


def test_strips_that_come_later() -> None:
    """Higher strips are made later: their epidermis has the length of their first girth."""
    girth = np.array([[0.2, np.nan], [0.3, np.nan], [0.4, 0.2], [0.5, 0.3]])
    bark = grow_bark(column(2), girth, Material())
    assert bark.strips.rest == pytest.approx([0.2, 0.2])
    assert bark.tears.born[bark.tears.strip == 1].min() >= 3.0
    check(bark)


def test_shrinking_ends_with_the_tree_as_it_is() -> None:
    girth = np.array([1.0, 0.5])
    table = shrinking(girth, 0.5, 10)
    assert (table[-1] == girth).all() and table[0] == pytest.approx(girth / 2)
    assert np.diff(np.log(table), axis=0) == pytest.approx(np.log(2) / 10)
    even = shrinking(girth, 0.4 / girth, 10)  # figure 22c
    assert even[0] == pytest.approx([0.4, 0.4])


@pytest.mark.parametrize(
    ("girth", "said"),
    [
        ([[1.0], [0.9]], "girth of strip 0 shrinks in step 0"),
        ([[1.0, 1.0]], r"table of \(1, 2\)"),
        ([[0.0], [1.0]], "not above 0"),
        ([[np.nan], [np.nan]], "strip 0 has no girth"),
    ],
)
def test_bad_girths(girth: list[list[float]], said: str) -> None:
    with pytest.raises(InputError, match=said):
        grow_bark(column(1), np.array(girth))


def test_bad_fields() -> None:
    girth = np.array([[1.0], [1.1]])
    with pytest.raises(InputError, match=r"weakness.*0 to 1"):
        grow_bark(column(1), girth, weakness=np.full((1, 3), 2.0))
    with pytest.raises(InputError, match=r"dilatation.*below 0"):
        grow_bark(column(1), girth, dilatation=np.full((1, 3), -1.0))
    with pytest.raises(InputError, match=r"dilatation.*a table of \(2, 3\); expected \(1, 3\)"):
        grow_bark(column(1), girth, dilatation=np.ones((2, 3)))
    with pytest.raises(InputError, match="shrink"):
        shrinking(np.ones(2), 1.5)
    with pytest.raises(InputError, match="steps"):
        shrinking(np.ones(2), 0.5, 0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("stiffness", 0.0),
        ("threshold", 1.0),
        ("stray_deg", 85.0),
        ("arrest", -1.0),
        ("grain_m", np.nan),
        ("fracture_stiffness", ((0.1, 1.0), (0.1, 2.0))),
        ("fracture_stiffness", 0.0),
    ],
)
def test_bad_materials(name: str, value: object) -> None:
    with pytest.raises(InputError, match=f"bark material: {name} = "):
        Material(**{name: value})  # type: ignore[arg-type]


def test_strips_without_width_are_refused() -> None:
    for width in (0.0, -0.01, np.nan):
        with pytest.raises(InputError, match="strips of"):
            column(3, width)
        geometry = column(3)._replace(width=np.array([0.02, width, 0.02]))
        with pytest.raises(InputError, match="strip 1 has no width"):
            grow_bark(geometry, np.ones((2, 3)))
    around = column(3)._replace(width_around=np.array([[1.0], [1.0], [0.0]]))
    with pytest.raises(InputError, match="strip 2 has no width"):
        grow_bark(around, np.ones((2, 3)))


@pytest.mark.parametrize("attachment", [0.0, 50.0])
def test_all_strips_lie_at_equilibrium_after_a_trigger(attachment: float) -> None:
    """Only the strips that tear are solved anew; the springs of the others stay as they were."""
    bark = grown(12, 0.4, 0.6, 4, attachment=attachment, run_m=0.04)
    (strip,) = np.flatnonzero(torn(bark) == torn(bark).max())[:1]
    widest = bark.elements.of(strip)
    row = int(np.argmax(np.where(widest.kind == FRACTURE, 0.0, widest.width)))
    after = bark.trigger(int(strip), float(widest.start[row] + 0.5 * widest.width[row]))
    touched = torn(after) > torn(bark)
    assert touched.any() and not touched.all()
    solved = copied(after._rings)
    physics = Physics.of(after.material)
    for s in range(12):
        solve_strip(solved, physics, np.int64(s))
    assert solved.left == pytest.approx(after._rings.left, abs=1e-9)
    assert solved.open == pytest.approx(after._rings.open, abs=1e-9)
    untouched = ~touched[strip_of(bark)]
    assert np.array_equal(
        after.elements.rest[~touched[strip_of(after)]], bark.elements.rest[untouched]
    )


def test_plates_tear_where_the_girth_grows() -> None:
    """A next generation stretches by sectors too, from where they lie on the surface that tore."""
    spread = np.where(np.arange(8) < 4, 3.0, 1.0) * np.ones((12, 1))
    girth = np.full(12, 1.2)
    old = grow_bark(column(12), shrinking(girth * 0.8, 0.6), Material(), dilatation=spread)
    wider = shrinking(girth, 0.8)[1:]
    new = old.refracture(wider, dilatation=spread, substeps=2)
    check(new)
    assert np.array_equal(new._rings.edges[:, -1], girth)
    begin, end = (b._rings.edges[:, 4] / b.strips.girth for b in (old, new))
    assert (begin > 0.5).all() and (end > begin).all()
    even = old.refracture(wider)
    assert even._rings.edges[:, 4] / girth == pytest.approx(begin)
    with pytest.raises(InputError, match="a table of"):
        old.refracture(wider, dilatation=spread[:, :6])
    with pytest.raises(InputError, match="a table of"):
        even.grow(1.1 * girth[None], dilatation=spread[:, :2])
