"""Thinning and harvest as a scenario says them: which trees go, by rule."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from forest.errors import nearest
from forest.scenario.model import Plot
from forest.scenario.regions import Region, check_region
from forest.scenario.timing import Timing
from forest.species.schema import Refusal, Table, quantity

_Name = Annotated[str, Field(min_length=1, max_length=60)]

#: What a thinning leaves, or takes.
TARGETS = ("n_ha", "basal_area_m2ha", "sdi", "relative_density", "share_n", "share_g")

_DENSEST = 1e7


class Rule(Table):
    """What thinnings, harvests and prunings by rule share: the trees that they may touch."""

    species: tuple[_Name, ...] | None = quantity(
        None, "only trees of this species, or of these", unit="", min_length=1, max_length=200
    )
    min_dbh_cm: float | None = quantity(
        None, "only trees at least so thick", unit="cm", ge=0, le=1000
    )
    max_dbh_cm: float | None = quantity(
        None, "only trees at most so thick; also those without a dbh", unit="cm", ge=0, le=1000
    )

    @field_validator("species", "crop_species", mode="before", check_fields=False)
    @classmethod
    def _one_name(cls, species: Any) -> Any:
        return (species,) if isinstance(species, str) else species

    @model_validator(mode="after")
    def _from_thin_to_thick(self) -> Self:
        low, high = self.min_dbh_cm, self.max_dbh_cm
        if low is not None and high is not None and high < low:
            raise Refusal(
                f"{high:g} lies below min_dbh_cm", key="max_dbh_cm", expected=f"{low:g} or more"
            )
        return self


def _only_of(rule: Table, method: str, keys: dict[str, tuple[str, ...]]) -> None:
    """Refuse the keys of other methods."""
    for other, names in keys.items():
        for name in names:
            if getattr(rule, name) is not None and name not in keys[method]:
                raise Refusal(
                    f"does not belong to method {method!r}", key=name, expected=f"method {other!r}"
                )


class Thinning(Rule):
    """Which trees a thinning takes."""

    method: Literal["below", "above", "random", "geometric", "selective"] = quantity(
        ...,
        "below: the thinnest first; above: the thickest first; random; geometric: whole rows or "
        "strips; selective: what presses crop trees",
        unit="",
    )
    cause: Literal["thinning", "tending"] = quantity(
        "thinning", "why, in the events; what tending fells is left lying", unit=""
    )
    n_ha: float | None = quantity(None, "trees left", unit="1/ha", ge=0, le=_DENSEST)
    basal_area_m2ha: float | None = quantity(None, "basal area left", unit="m2/ha", ge=0, le=1000)
    sdi: float | None = quantity(
        None, "stand density index (Reineke) left", unit="1/ha", ge=0, le=10000
    )
    relative_density: float | None = quantity(
        None, "left: SDI per the species' `max_sdi`, added up over species", ge=0, le=10
    )
    share_n: float | None = quantity(None, "share of the trees that goes", ge=0, le=1)
    share_g: float | None = quantity(None, "share of the basal area that goes", ge=0, le=1)
    every_row: int | None = quantity(
        None, "geometric: one row of so many goes", unit="", ge=1, le=10000
    )
    first_row: int | None = quantity(
        None,
        "the first row that goes, counted from 1; default: `every_row`",
        unit="",
        ge=1,
        le=10000,
    )
    row_spacing_m: float | None = quantity(
        None,
        "distance between rows; default: that of the scenario's regular planting",
        unit="m",
        ge=0.05,
        le=10000,
    )
    rows_along: Literal["x", "y"] | None = quantity(
        None, "where rows or strips run; default: x", unit=""
    )
    strip_width_m: float | None = quantity(
        None, "geometric, in place of rows: width of strips that go", unit="m", gt=0, le=10000
    )
    strip_spacing_m: float | None = quantity(
        None, "from the middle of one strip to the next", unit="m", gt=0, le=10000
    )
    crop_trees_ha: float | None = quantity(
        None, "selective: the thickest trees that are favoured", unit="1/ha", gt=0, le=_DENSEST
    )
    crop_spacing_m: float | None = quantity(
        None, "least distance between crop trees; default: 0", unit="m", ge=0, le=1000
    )
    crop_species: tuple[_Name, ...] | None = quantity(
        None,
        "only trees of these species are crop trees; default: all",
        unit="",
        min_length=1,
        max_length=200,
    )
    competitors: int | None = quantity(
        None,
        "the strongest competitors of each that go; default: 1, or with a target all until it is "
        "met",
        unit="",
        ge=1,
        le=100,
    )
    within_m: float | None = quantity(
        None, "distance within which trees compete; default: 6", unit="m", gt=0, le=100
    )

    @model_validator(mode="after")
    def _keys_of_method(self) -> Self:
        by_target = dict.fromkeys(("below", "above", "random"), TARGETS)
        rows = ("every_row", "first_row", "row_spacing_m", "rows_along")
        strips = ("strip_width_m", "strip_spacing_m")
        crop = ("crop_trees_ha", "crop_spacing_m", "crop_species", "competitors", "within_m")
        _only_of(
            self,
            self.method,
            {**by_target, "geometric": rows + strips, "selective": crop + TARGETS},
        )
        given = [key for key in TARGETS if getattr(self, key) is not None]
        if len(given) > 1 or (self.method in by_target and not given):
            what = " and ".join(given) + " exclude each other" if given else "no target given"
            raise Refusal(what, expected="one of " + ", ".join(TARGETS))
        if self.method == "selective" and self.crop_trees_ha is None:
            raise Refusal("missing key 'crop_trees_ha'", expected="crop trees per ha")
        if self.method == "geometric":
            self._rows_or_strips()
        return self

    def _rows_or_strips(self) -> None:
        strips = self.strip_width_m is not None or self.strip_spacing_m is not None
        if strips == (self.every_row is not None):
            what = "rows and strips exclude each other" if strips else "neither rows nor strips"
            raise Refusal(what, expected="every_row, or strip_width_m and strip_spacing_m")
        for key in ("first_row", "row_spacing_m"):
            if strips and getattr(self, key) is not None:
                raise Refusal("given beside strips", key=key, expected="every_row")
        if strips:
            for key in ("strip_width_m", "strip_spacing_m"):
                if getattr(self, key) is None:
                    raise Refusal(f"missing key {key!r}", expected="both of strips")
            assert self.strip_width_m is not None and self.strip_spacing_m is not None
            if self.strip_spacing_m <= self.strip_width_m:
                raise Refusal(
                    f"{self.strip_spacing_m:g} leaves nothing",
                    key="strip_spacing_m",
                    expected=f"above strip_width_m, {self.strip_width_m:g}",
                )

    @property
    def target(self) -> tuple[str, float] | None:
        """What is left or taken, and how much; None without a target."""
        given = [(key, value) for key in TARGETS if (value := getattr(self, key)) is not None]
        return given[0] if given else None

    @property
    def in_words(self) -> str:
        """Say which trees go."""
        of = f" of {', '.join(self.species)}" if self.species else ""
        if self.method == "geometric":
            if self.every_row is not None:
                return f"thin{of} one row of {self.every_row}"
            return f"thin{of} strips {self.strip_width_m:g} m wide"
        how = "at random" if self.method == "random" else f"from {self.method}"
        if self.method == "selective":
            how = f"around {self.crop_trees_ha:g} crop trees/ha"
        if self.target is None:
            return f"thin{of} {how}"
        key, value = self.target
        return f"thin{of} {how} {'by' if key.startswith('share') else 'to'} {key} {value:g}"


class Harvesting(Rule):
    """Which trees a harvest takes."""

    method: Literal["diameter_limit", "clearcut", "shelterwood", "gap"] = quantity(
        ...,
        "diameter_limit: all trees at least so thick; clearcut: all; shelterwood: all that have a "
        "dbh but seed trees; gap: all inside a shape",
        unit="",
    )
    limit_cm: float | None = quantity(
        None, "diameter_limit: least dbh that goes", unit="cm", gt=0, le=1000
    )
    keep_share: float | None = quantity(
        None,
        "shelterwood: share of the basal area that stays, the thickest trees first",
        ge=0,
        le=1,
    )
    seed_spacing_m: float | None = quantity(
        None,
        "shelterwood: least distance between trees that stay, though fewer may stay for it; "
        "default: 0",
        unit="m",
        ge=0,
        le=1000,
    )
    gap: Region | None = quantity(None, "the gap", unit="")

    @model_validator(mode="after")
    def _keys_of_method(self) -> Self:
        keys: dict[str, tuple[str, ...]] = {
            "diameter_limit": ("limit_cm",),
            "clearcut": (),
            "shelterwood": ("keep_share", "seed_spacing_m"),
            "gap": ("gap",),
        }
        _only_of(self, self.method, keys)
        for key in keys[self.method][:1]:
            if getattr(self, key) is None:
                raise Refusal(f"missing key {key!r}", expected=f"what {self.method!r} needs")
        return self

    @property
    def in_words(self) -> str:
        """Say which trees go."""
        of = f" of {', '.join(self.species)}" if self.species else ""
        how = {
            "diameter_limit": f"from {self.limit_cm or 0:g} cm",
            "clearcut": "by clear-cut",
            "shelterwood": f"but for a shelterwood of {100 * (self.keep_share or 0):g} % of G",
            "gap": f"in a gap ({self.gap.kind if self.gap else ''})",
        }
        return f"harvest{of} {how[self.method]}"


class Thin(Thinning, Timing):
    """Fell the trees that a rule chooses, so that others grow better."""

    kind: Literal["thin"] = quantity("thin", "kind of act", unit="")


class Harvest(Harvesting, Timing):
    """Fell the trees that a rule chooses, for their wood or for those that come after."""

    kind: Literal["harvest"] = quantity("harvest", "kind of act", unit="")


def check_rule(rule: Rule, key: str, plot: Plot, known: Iterable[str], rows_m: bool) -> None:
    """Refuse a rule that does not fit the stand.

    Parameters
    ----------
    rule : Rule
    key : str
        Where it stands; `""` by hand.
    plot : Plot
    known : iterable of str
        The scenario's species.
    rows_m : bool
        Whether the distance between rows is known of the planting.
    """
    start = f"{key}." if key else ""
    for field in ("species", "crop_species"):
        for i, name in enumerate(getattr(rule, field, None) or ()):
            if name not in known:
                raise Refusal(
                    f"unknown species {name[:60]!r}, {nearest(name, known)}",
                    key=f"{start}{field}[{i}]",
                )
    if isinstance(rule, Harvesting) and rule.gap is not None:
        check_region(rule.gap, plot.size_m, plot.boundary == "periodic", f"{start}gap")
    rows = isinstance(rule, Thinning) and rule.every_row is not None and rule.row_spacing_m is None
    if rows and not rows_m:
        raise Refusal(
            "the scenario's planting is not regular",
            key=f"{start}row_spacing_m",
            expected="the distance between rows, m",
        )
