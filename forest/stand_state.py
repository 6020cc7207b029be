"""What a checkpoint holds of a stand: everything that the next year needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from forest.trees import table
from forest.yearbook import Event, Loss

if TYPE_CHECKING:
    from forest.stand import Stand


class Memory(Protocol):
    """A part of a stand that remembers something from one year to the next."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Give all that it remembers, by names without its own."""

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""


def take_state(stand: Stand) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Give a stand's arrays, and a few numbers that JSON can hold."""
    rows = stand.rows
    arrays = {f"tree_{name}": column for name, column in rows._asdict().items()}
    spans = [(int(s), int(s) + int(n)) for s, n in zip(rows.start, rows.size, strict=True)]
    for name, field in _metamer_fields(stand):
        parts = [field[a:b] for a, b in spans]
        arrays[name] = np.concatenate(parts) if parts else field[:0]
    for name, part in stand.memories.items():
        arrays.update({f"{name}_{key}": array for key, array in part.state().items()})
    meta = {
        "step": stand.steps,
        "next_id": stand.next_id,
        "sample_ids": list(stand.sample_ids),
        "pending": [
            [None if value != value else value for value in event] for event in stand.pending
        ],
        "losses": {str(tree_id): list(loss) for tree_id, loss in stand.losses.items()},
    }
    return arrays, meta


def put_state(stand: Stand, arrays: dict[str, NDArray[Any]], meta: dict[str, Any]) -> None:
    """Fill a stand that has been started but not planted."""
    stand.steps = int(meta["step"])
    stand.next_id = int(meta["next_id"])
    stand.sample_ids = [int(i) for i in meta["sample_ids"]]
    stand.pending = [
        Event._make(np.nan if value is None else value for value in event)
        for event in meta["pending"]
    ]
    stand.losses = {int(i): Loss._make(loss) for i, loss in meta["losses"].items()}
    stand.rows = table.Trees(
        **{name: np.array(arrays[f"tree_{name}"]) for name in table.Trees._fields}
    )
    rows = stand.rows
    size = rows.size.copy()
    rows.size[:] = 0
    rows.room[:] = 0
    stand.arena.make_room(rows.start, rows.size, rows.room, size.astype(np.int64))
    at = 0
    for row, n in enumerate(size):
        s = int(rows.start[row])
        for name, field in _metamer_fields(stand):
            field[s : s + n] = arrays[name][at : at + n]
        at += int(n)
    rows.size[:] = size
    for name, part in stand.memories.items():
        start = f"{name}_"
        part.restore({k[len(start) :]: v for k, v in arrays.items() if k.startswith(start)})


def _metamer_fields(stand: Stand) -> list[tuple[str, NDArray[Any]]]:
    """Name the arrays of the arena as checkpoints do."""
    groups = {"metamer": stand.arena.metamers, "companion": stand.arena.companions}
    return [
        (f"{group}_{name}", field)
        for group, fields in groups.items()
        for name, field in zip(getattr(fields, "_fields", ()), fields, strict=True)
    ]
