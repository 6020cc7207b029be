"""Form fields of the page, all of one look, and what is read from them."""

from __future__ import annotations

from typing import Any

from forest.errors import InputError

#: How all fields look.
LOOK = {"density": "compact", "variant": "outlined", "hide_details": True}


def text_field(v: Any, state: str, label: str, *, enter: str = "", **more: Any) -> None:
    """Make a field for words that the page's state holds; `enter` is done at the key Enter."""
    _field(v, {"v_model": (state,)}, state, label, enter, more)


def number_field(v: Any, state: str, label: Any, *, enter: str = "", **more: Any) -> None:
    """Make a field for a number that the page's state holds; `enter` is done at the key Enter."""
    more = {"type": "number", "classes": "mb-2", **more}
    _field(v, {"v_model_number": (state,)}, state, label, enter, more)


def _field(
    v: Any, model: dict[str, Any], state: str, label: Any, enter: str, more: dict[str, Any]
) -> None:
    if enter:
        more = {**more, "raw_attrs": [f'@keydown.enter="{enter}"']}
    v.VTextField(**model, label=label, id=id_of(state), **LOOK, **more)


def choice_field(v: Any, state: str, label: str, items: Any, **more: Any) -> None:
    """Make a field for a choice that the page's state holds."""
    more = {"classes": "mb-2", **more}
    v.VSelect(v_model=(state,), items=items, label=label, id=id_of(state), **LOOK, **more)


def switch(v: Any, state: str, label: str) -> None:
    """Make a switch for what the page's state holds to be so or not."""
    v.VSwitch(
        v_model=(state,),
        label=label,
        density="compact",
        hide_details=True,
        color="primary",
        id=id_of(state),
    )


def id_of(state: str) -> str:
    """Give the id of the field of a part of the page's state."""
    return state.replace("_", "-")


def choices(named: dict[str, str]) -> list[dict[str, str]]:
    """Give the items of a choice: what the state holds, and what people read."""
    return [{"title": label, "value": name} for name, label in named.items()]


def as_number(value: Any, what: str) -> float:
    """Read a number that was typed.

    Raises
    ------
    InputError
        If it is none.
    """
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} is no number: {value!r}"[:200]) from None
