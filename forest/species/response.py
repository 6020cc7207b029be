"""How a species' production answers the climate of a year and of the two before."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from forest.species.curves import ShareCurve
from forest.species.schema import Refusal, Table, quantity

_Number = Annotated[float, Field(ge=-1e4, le=1e4)]
_Weight = Annotated[float, Field(ge=0, le=1)]
_Lags = tuple[_Weight, _Weight, _Weight]

#: The variables of the climate to which a species may respond.
RESPONDS_TO = ("temperature", "precipitation", "drought_index")

_ROUNDING = 1e-6


def _curve(what: str) -> Any:
    return quantity((), f"production by {what}, as a share of a mean year's; empty = off")


def _gaussian(what: str, unit: str) -> Any:
    return quantity(
        (),
        f"in place of the curve: [optimum, width] of a bell over {what}, 1 at the optimum, 0.61 a "
        "width away; empty = off",
        unit=unit,
        max_length=2,
    )


def _lags(what: str) -> Any:
    return quantity(
        (1.0, 0.0, 0.0),
        f"weights of the responses to {what} of this year, the last and the one before; sum 1",
    )


class Response(Table):
    """How production answers the climate: a curve or a bell per variable, this year and later.

    The responses to the variables are multiplied. A variable of which the scenario says nothing
    has no effect.
    """

    temperature_curve: ShareCurve = _curve("mean annual temperature in °C")
    temperature_gaussian: tuple[_Number, ...] = _gaussian("mean annual temperature", "°C")
    temperature_lags: _Lags = _lags("temperature")
    precipitation_curve: ShareCurve = _curve("annual precipitation in mm")
    precipitation_gaussian: tuple[_Number, ...] = _gaussian("annual precipitation", "mm")
    precipitation_lags: _Lags = _lags("precipitation")
    drought_index_curve: ShareCurve = _curve("the drought index, below 0 dry")
    drought_index_gaussian: tuple[_Number, ...] = _gaussian("the drought index", "1")
    drought_index_lags: _Lags = _lags("the drought index")
    least_share: float = quantity(
        0.1, "share of a mean year's production that the worst climate leaves", gt=0, le=1
    )

    @model_validator(mode="after")
    def _each_is_a_function(self) -> Response:
        for variable in RESPONDS_TO:
            gaussian = getattr(self, f"{variable}_gaussian")
            if gaussian and not (len(gaussian) == 2 and gaussian[1] > 0.0):
                raise Refusal(
                    f"{list(gaussian)} is no bell",
                    key=f"{variable}_gaussian",
                    expected="[optimum, width], width above 0, or []",
                )
            if gaussian and getattr(self, f"{variable}_curve"):
                raise Refusal(
                    "there is a curve already",
                    key=f"{variable}_gaussian",
                    expected=f"one of the two; {variable}_curve = [] switches the curve off",
                )
            total = sum(getattr(self, f"{variable}_lags"))
            if abs(total - 1.0) > _ROUNDING:
                raise Refusal(
                    f"the weights add up to {total:g}",
                    key=f"{variable}_lags",
                    expected="three weights of sum 1",
                )
        return self
