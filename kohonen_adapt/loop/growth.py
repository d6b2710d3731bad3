"""How many nodes the mesh of every pass has when the loop is to grow it."""

from dataclasses import dataclass

from kohonen_adapt.checks import is_count

__all__ = ["Growth"]


@dataclass(frozen=True)
class Growth:
    """From the nodes of the input to those wanted, by the same factor in every pass but the last.

    The last pass has all nodes from the start, so that the estimate that places them is made with as many.
    """

    start: int
    target: int
    steps: int

    @classmethod
    def of(cls, start: int, target: int | None, passes: int) -> "Growth":
        """Check the target of a mesh that starts with so many nodes.

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
        return cls(start, start if target is None else int(target), max(1, passes - 1))

    def nodes(self, number: int) -> int:
        """Nodes of the mesh of pass `number`, more than of the one before until all are there."""
        share = min(1.0, number / self.steps)
        wanted = self.target if share == 1.0 else round(self.start * (self.target / self.start) ** share)
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
