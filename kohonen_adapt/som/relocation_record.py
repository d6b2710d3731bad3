"""Record of a relocation."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.geometry.movable import Recycled, Work
from kohonen_adapt.geometry.plane.movable import MovableMesh
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
    quantization_errors, why_still, held_in_polish
        As in `Work`; `why_still` is the reason that no node moved.
    refused
        Number of moves that the quality and the reach refused, shape (2,).
    """

    before: Movable
    recycled: Recycled
    quantization_errors: tuple[float, ...]
    why_still: str
    refused: Ints = field(default_factory=lambda: np.zeros(2, dtype=np.int64))
    held_in_polish: int = 0

    def changed(self, now: Movable) -> bool:
        before, after = self.before.tessellation, now.tessellation
        same = np.array_equal(before.position, after.position)
        return not (same and np.array_equal(before.elements.node, after.elements.node))

    def work(self, now: Movable, polish_gain: float = 0.0) -> Work:
        old, position = self.recycled.old, now.tessellation.position
        survives = old >= 0
        distance = np.sqrt(np.sum((position[survives] - self.before.tessellation.position[old[survives]]) ** 2, axis=1))
        moved = int(np.count_nonzero(distance) + np.count_nonzero(~survives))
        unmoved = np.count_nonzero((distance == 0.0) & ~now.held_nodes[survives])
        return Work(
            quantization_errors=self.quantization_errors,
            max_displacement=float(distance.max()),
            moved=moved,
            unmoved=int(unmoved),
            refused_by_quality=int(self.refused[0]),
            refused_by_reach=int(self.refused[1]),
            held_in_polish=self.held_in_polish,
            why_still="" if moved else with_remedy(self.why_still, now),
            splits=self.recycled.splits,
            collapses=self.recycled.collapses,
            polish_gain=polish_gain,
        )


def why_still(movable: MovableMesh | MovableSolid, schedule: Schedule | None) -> str:
    if schedule is not None and not schedule.trains and not schedule.sweeps:
        return "the schedule has no rounds, no epochs and no sweeps"
    if movable.held_nodes.all():
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
