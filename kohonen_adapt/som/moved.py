"""Record of a relocation."""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh, Work
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.som.schedule import Schedule

__all__ = ["Moved", "why_still"]

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
    quantization_errors, why_still
        As in `Work`; `why_still` is the reason that no node moved.
    """

    before: Movable
    recycled: Recycled
    quantization_errors: tuple[float, ...]
    why_still: str

    def changed(self, now: Movable) -> bool:
        before, after = self.before.tessellation, now.tessellation
        same = np.array_equal(before.position, after.position)
        return not (same and np.array_equal(before.elements.node, after.elements.node))

    def work(self, now: Movable, polish_gain: float = 0.0) -> Work:
        old, position = self.recycled.old, now.tessellation.position
        survives = old >= 0
        distance = np.sqrt(np.sum((position[survives] - self.before.tessellation.position[old[survives]]) ** 2, axis=1))
        moved = int(np.count_nonzero(distance) + np.count_nonzero(~survives))
        return Work(
            quantization_errors=self.quantization_errors,
            max_displacement=float(distance.max()),
            moved=moved,
            why_still="" if moved else with_remedy(self.why_still, now),
            splits=self.recycled.splits,
            collapses=self.recycled.collapses,
            polish_gain=polish_gain,
        )


def why_still(movable: MovableMesh | MovableSolid, schedule: Schedule | None) -> str:
    if schedule is not None and not schedule.trains and not schedule.sweeps:
        return "the schedule has no rounds, no epochs and no sweeps"
    if not movable.can_move():
        return "every node is a corner or pinned" if isinstance(movable, MovableMesh) else "every node is held"
    return QUALITY_RULE


def with_remedy(why: str, movable: MovableMesh | MovableSolid) -> str:
    worst = float(quality(movable.input_mesh).min())
    if why != QUALITY_RULE or worst >= movable.floor:
        return why
    return (
        f"{why}: the worst element has a quality of {worst:.2g}, min_quality is {movable.floor:g}, and nothing below "
        f"that may get worse. Give min_quality={0.5 * worst:.2g}"
    )
