"""How many nodes the mesh of every pass has when the loop is to grow it."""

from dataclasses import dataclass

from skfem import MeshTri

from .schedule import is_count

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
    def of(cls, mesh: MeshTri, target: int | None, passes: int) -> "Growth":
        """Check the target.

        Raises
        ------
        ValueError
            If it is not an integer, or below the number of nodes that there are.
        """
        start = mesh.p.shape[1]
        if target is not None and not (is_count(target) and target >= start):
            raise ValueError(
                f"target_nodes must be an integer of at least the {start} nodes of the mesh, or None; got {target!r}. "
                "Start from a coarser mesh."
            )
        return cls(start, start if target is None else int(target), max(1, passes - 1))

    def nodes(self, number: int) -> int:
        """Nodes of the mesh of pass `number`."""
        share = min(1.0, number / self.steps)
        return self.target if share == 1.0 else round(self.start * (self.target / self.start) ** share)
