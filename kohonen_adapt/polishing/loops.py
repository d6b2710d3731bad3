"""Compiled loops of the energy descent on triangles.

Functions that are affine on every element have loops in closed form, which are several times faster.
"""

import numpy as np

from kohonen_adapt.arrays import Int32s, Ints, Mask
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.triangle.arrays import WITH, WITHOUT, Descents, Offers, OpenMesh, Shapes, Trial
from kohonen_adapt.kernels.triangle.polish import descend, exchange, flips
from kohonen_adapt.mesh.elements.polynomials import quadrature_points, reference
from kohonen_adapt.polishing.elements import FEW, UNKNOWNS, without_modes

__all__ = ["Loops"]

NO_SHAPES = Shapes(np.empty((0, 3, 2)), np.empty(0, bool), False)


class Loops:
    """Loops on a function of one order, with scratch for every thread.

    Attributes
    ----------
    few
        Minimum number of elements per thread.
    """

    def __init__(
        self,
        mesh: KernelMesh,
        trials: tuple[Trial, Trial],
        modes: tuple[Modes, ...],
        shapes: Shapes | None,
        order: int,
        floor: float,
    ) -> None:
        """Collect the arguments of the loops.

        `mesh` has the arrays of the open mesh for recycling. `trials` are the primal and the dual function with their
        functionals, and `modes` their coefficients of sides and bubbles, empty if affine. `shapes` are None for an
        affine function. `floor` is the minimum quality after a change.
        """
        self.star, self.floor = mesh.star, floor
        self.few = FEW // UNKNOWNS[order - 1] ** 3
        self.higher = WITHOUT if shapes is None else WITH
        functions = reference(order), quadrature_points(order), shapes or NO_SHAPES
        self.function = mesh, trials, modes or (without_modes(0),), functions
        self.scratches = dict[int, Descents]()

    def scratch(self, thread: int) -> Descents:
        most = int(np.diff(self.star.start).max())
        if thread not in self.scratches or len(self.scratches[thread].primal.block.dof) < most:
            self.scratches[thread] = Descents.of(*self.function)
        return self.scratches[thread]

    def descend_nodes(self, thread: int, nodes: Int32s) -> float:
        return descend.descend_nodes(self.scratch(thread), self.higher, nodes, self.floor)

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        # Returned are the decrease of the functional and the number of flips.
        return flips.descend_flips(self.scratch(thread), self.higher, self.floor, gainful, first, last, marks)

    def weigh(
        self, thread: int, mesh: OpenMesh, offers: Offers, most: float, first: int, last: int, edges: bool
    ) -> None:
        # gains of splits of edges, or costs of collapses below `most`
        exchange.weigh(mesh, self.scratch(thread), self.higher, offers, most, self.floor, first, last, edges)

    def exchange(self, mesh: OpenMesh, offers: Offers, edges: Ints, nodes: Ints) -> tuple[int, float]:
        # Returned are the number of pairs and the decrease of the functional.
        return exchange.exchange(mesh, self.scratch(0), self.higher, offers, edges, nodes, self.floor)
