"""What a tool can be told in the panel beside the view."""

from __future__ import annotations

from typing import Any, Protocol


class Options(Protocol):
    """The controls of one tool.

    Attributes
    ----------
    tool : str
        Its name.
    """

    @property
    def tool(self) -> str:
        """Its name."""

    def build(self, v: Any, html: Any) -> None:
        """Make its widgets, of vuetify and plain HTML."""

    def refresh(self) -> None:
        """Bring them up to date with the stand."""


def number_field(v: Any, state: str, label: str, **more: Any) -> None:
    """Make a field for a number that the page's state holds."""
    v.VTextField(
        v_model_number=(state,),
        label=label,
        type="number",
        density="compact",
        variant="outlined",
        hide_details=True,
        classes="mb-2",
        id=state.replace("_", "-"),
        **more,
    )


def choice_field(v: Any, state: str, label: str, items: Any) -> None:
    """Make a field for a choice that the page's state holds."""
    v.VSelect(
        v_model=(state,),
        items=items,
        label=label,
        density="compact",
        variant="outlined",
        hide_details=True,
        classes="mb-2",
        id=state.replace("_", "-"),
    )


def as_number(value: Any, what: str) -> float:
    """Read a number that was typed.

    Raises
    ------
    InputError
        If it is none.
    """
    from forest.errors import InputError

    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} is no number: {value!r}"[:200]) from None
