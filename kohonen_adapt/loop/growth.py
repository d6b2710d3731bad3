"""Say how many nodes the mesh of every pass has, from those of the input to those wanted."""

from dataclasses import dataclass
from math import ceil

from kohonen_adapt.checks import is_count

__all__ = ["Growth"]

# Least nodes of the mesh whose estimate places those of the last pass, and how many times as many that has at most:
# with fewer, or more at once, a polish does not always put them right. What one more pass would take off:
# `python -m benchmarks growth`.
LEAST = 500
ONCE = 3


@dataclass(frozen=True)
class Growth:
    """From the nodes of the input to those wanted: by the same factor from pass to pass, up to those of the last but
    one, whose estimate places those of the last.

    Attributes
    ----------
    start, placing, target
        Nodes of the input, of the last pass but one, and of the last.
    passes
        How many there are at most.
    """

    start: int
    placing: int
    target: int
    passes: int

    @classmethod
    def of(cls, start: int, target: int | None, passes: int, corrected: bool) -> "Growth":
        """Check the target of a mesh that starts with so many nodes.

        The last pass has all nodes from the start, so that the estimate that places them is made with as many; where
        what it misplaces is `corrected`, that is one pass over all of them too many.

        Raises
        ------
        ValueError
            If it is not an integer, or below the number of nodes that there are.
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
        return cls(start, min(target, max(LEAST, ceil(target / ONCE), evenly)), target, passes)

    def nodes(self, number: int, polished: bool = True) -> int:
        """Nodes of the mesh of pass `number`, more than of the one before until all are there.

        Where it turns out not to be `polished` nothing corrects the last pass, which has all nodes from the start.
        """
        if number >= self.passes:
            return self.target
        share, placing = number / max(1, self.passes - 1), self.placing if polished else self.target
        wanted = round(self.start * (placing / self.start) ** share)
        return min(self.target, max(wanted, self.start + number))

    def goes_on(self, number: int) -> bool:
        """Whether there are nodes to come after pass `number`."""
        return self.nodes(number) < self.target

    def shortfall(self, nodes: int) -> str:
        """What to say where that many nodes is what it came to."""
        if nodes >= self.target:
            return ""
        return (
            f"the mesh has {nodes} of {self.target} nodes, for every further split would have broken the quality rule "
            "or the passes ended before: lower min_quality, improve the input, or ask for more passes"
        )
