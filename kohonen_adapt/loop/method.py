"""Parts of the adaptive loop that depend on the dimension of the mesh."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.polishing.polish import Descent
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocation_record import Moved
from kohonen_adapt.som.schedule import Schedule

__all__ = ["Method"]


class Method(ABC):
    """Movement and polish of the nodes of meshes of one dimension.

    Attributes
    ----------
    dim
        Dimension of the meshes.
    schedule_before_polish
        Schedule of the map in passes that recycle and polish, None for the default.
    passes_by_density
        Number of passes with recycling by density; later passes recycle by energy alone.
    """

    dim: ClassVar[int]
    schedule_before_polish: ClassVar[Schedule | None] = None
    # A density without directions moves a fifth of all nodes in every pass to positions from which the energy removes
    # them again, if long elements have the lowest energy. With directions, too, further passes by density gain nothing
    # (`python -m benchmarks space-passes`).
    passes_by_density: ClassVar[int]

    @abstractmethod
    def open(self, mesh: Mesh, rules: Rules, curved: bool | None) -> Any:
        """Return the movable mesh, with sides as in the input if `curved` is None."""

    @abstractmethod
    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        """Return the groups of `kernels/entries.py` that a relocation needs."""

    @abstractmethod
    def polish_kernels(self, problem: CheckedProblem) -> tuple[str, ...]: ...

    @property
    @abstractmethod
    def transfer_kernels(self) -> tuple[str, ...]: ...

    @abstractmethod
    def move(
        self,
        movable: Any,
        density: ArrayLike | Callable[[Floats], ArrayLike],
        schedule: Schedule | None,
        topology: str,
        rng: np.random.Generator,
        nodes: int,
        recycles: bool = True,
        longest: Floats | None = None,
    ) -> Moved[Any]:
        """Relocate to a density or to tensors, with `nodes` nodes.

        Nodes are exchanged only if the pass `recycles`. Sides on curves are at most as long as `longest`.
        """

    def longest_sides(self, movable: Any, functional: Any, estimate: float) -> Floats | None:
        # of sides on curves, at each node
        return None

    @abstractmethod
    def split(self, movable: Any, density: ArrayLike, nodes: int) -> Moved[Any]: ...

    @abstractmethod
    def functional(self, ritz: Ritz, movable: Any, mesh: Mesh) -> Any:
        """Return the functional that the polish lowers, for a solution on `mesh`."""

    @abstractmethod
    def value(self, functional: Any, ritz: Ritz, movable: Any, mesh: Mesh) -> float:
        """Return the value of the functional, up to the curves and surfaces."""

    @abstractmethod
    def carry(self, functional: Any, before: Any, movable: Any, start_element: Ints) -> Any: ...

    @abstractmethod
    def reasons(self, movable: Any) -> list[str]:
        """Return why each node is held, an empty string for nodes that move or slide."""

    @abstractmethod
    def held_in_polish(self, movable: Any, functional: Any) -> Mask:
        """Return the mask (n,) of nodes held by the polish alone."""

    @abstractmethod
    def polish_reasons(self, movable: Any, functional: Any) -> list[str]:
        """Return why the polish alone holds each node, else an empty string."""

    @abstractmethod
    def descent(self, movable: Any, functional: Any, trial: Any, recycled: Recycled) -> Descent:
        """Return the descent for the polish, which changes `movable`."""

    @abstractmethod
    def takes_directions(self, settings: Settings, last: Pass) -> bool:
        """Return True if elements get directions with ``anisotropic="auto"``."""

    @abstractmethod
    def stalls(self, passes: tuple[Pass, ...]) -> bool: ...

    def corrects(self, problem: CheckedProblem) -> bool:
        return False
