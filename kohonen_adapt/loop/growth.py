"""Node counts of the passes of an adaptive loop."""

from dataclasses import dataclass
from math import ceil

from kohonen_adapt.checks import is_count

__all__ = ["Growth"]

# Least number of nodes for the estimate of the last pass, and largest factor of the last pass. With fewer nodes or a
# larger factor the polish does not always correct misplaced nodes. Cost of another pass: `python -m benchmarks growth`.
MIN_PLACING_NODES = 500
MAX_LAST_FACTOR = 3


@dataclass(frozen=True)
class Growth:
    """Geometric growth from `start` to `target` nodes.

    The estimate on the mesh of the last pass but one, with `placing` nodes, places the nodes of the last pass.

    Attributes
    ----------
    start, placing, target
        Number of nodes of the input, of the last pass but one, and of the last pass.
    passes
        Maximum number of passes.
    """

    start: int
    placing: int
    target: int
    passes: int

    @classmethod
    def of(cls, start: int, target: int | None, passes: int, corrected: bool) -> "Growth":
        """Return the growth for a target, None for no growth.

        If the polish corrects misplaced nodes (`corrected`), the last pass but one has fewer nodes than the target,
        which saves a pass over all nodes. Raises ValueError if `target` is no integer or less than `start`.
        """
        if target is not None and not is_count(target):
            raise ValueError(f"target_nodes must be an integer >= 0, or None; got {target!r}.")
        if target is not None and target < start:
            raise ValueError(
                f"target_nodes must be at least the number of nodes of the mesh, {start}; got {target}. "
                "Start from a coarser mesh."
            )
        target = start if target is None else int(target)
        if not corrected:
            return cls(start, target, target, passes)
        evenly = round(target * (start / target) ** (1 / max(1, passes)))
        return cls(start, min(target, max(MIN_PLACING_NODES, ceil(target / MAX_LAST_FACTOR), evenly)), target, passes)

    def nodes(self, number: int, polished: bool = True) -> int:
        """Return the number of nodes of pass `number`.

        Without a polish the last pass adds no nodes, because nothing would correct their positions.
        """
        if number >= self.passes:
            return self.target
        fraction, placing = number / max(1, self.passes - 1), self.placing if polished else self.target
        wanted = round(self.start * (placing / self.start) ** fraction)
        return min(self.target, max(wanted, self.start + number))

    def grows_after(self, number: int) -> bool:
        return self.nodes(number) < self.target

    def shortfall_message(self, nodes: int) -> str:
        if nodes >= self.target:
            return ""
        return (
            f"The mesh has {nodes} of {self.target} nodes, because further splits would break the quality rule or the "
            "passes ended too early. Decrease `min_quality`, improve the input mesh or increase `passes`."
        )
