"""Record of a relocation."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.som.schedule import Schedule

__all__ = ["QUALITY_RULE", "Moved", "why_still"]

QUALITY_RULE = "every move would have broken the quality rule"

Movable = TypeVar("Movable", MovableMesh, MovableSolid)


@dataclass(frozen=True)
class Moved(Generic[Movable]):
    """Movable mesh before a relocation, with a record of the changes.

    Attributes
    ----------
    before
        Mesh before the relocation.
    recycled
        Old index of every node, and an old element near each.
    quantization_errors, why_still, held_in_polish, polish_gain
        As in `Pass`; `why_still` is the reason that no node moved.
    refused
        Number of moves that the quality and the reach refused, shape (2,).
    """

    before: Movable
    recycled: Recycled
    quantization_errors: tuple[float, ...]
    why_still: str
    refused: Ints = field(default_factory=lambda: np.zeros(2, np.int64))
    held_in_polish: int = 0
    polish_gain: float = 0.0

    def changed(self, now: Movable) -> bool:
        before, after = self.before.tessellation, now.tessellation
        same = np.array_equal(before.position, after.position)
        return not (same and np.array_equal(before.elements.node, after.elements.node))


def why_still(movable: MovableMesh | MovableSolid, schedule: Schedule | None) -> str:
    if schedule is not None and not schedule.trains and not schedule.sweeps:
        return "the schedule has no rounds, no epochs and no sweeps"
    if movable.held_nodes.all():
        return "every node is a corner or pinned" if isinstance(movable, MovableMesh) else "every node is held"
    return QUALITY_RULE
