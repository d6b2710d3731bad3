"""Compiled loops of the energy descent on triangles, by order of the functions.

`Linear` is several times faster than `Higher`, which also serves functions of order 1 around an axis.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Ints, Mask
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.triangle.arrays import Offers, OpenMesh, Points, Reference, Shapes, Trials
from kohonen_adapt.kernels.triangle.polish.descend import descend_nodes
from kohonen_adapt.kernels.triangle.polish.descend_higher import Descents
from kohonen_adapt.kernels.triangle.polish.energy_recycle import exchange, weigh_collapses, weigh_splits
from kohonen_adapt.kernels.triangle.polish.energy_recycle_higher import exchange_higher, weigh_higher
from kohonen_adapt.kernels.triangle.polish.flip_higher import descend_flips_higher
from kohonen_adapt.kernels.triangle.polish.flip_linear import descend_flips
from kohonen_adapt.kernels.triangle.polish.sweep_higher import descend_nodes_higher
from kohonen_adapt.polishing.elements import min_per_thread

__all__ = ["Higher", "Linear", "Patch"]


class Patch(NamedTuple):
    mesh: KernelMesh
    trials: Trials
    modes: tuple[Modes, ...]
    shapes: Shapes | None
    nodes: NDArray[np.int32]  # nodes that move, first rows of the mesh


class Linear:
    """Loops for functions that are affine on every element.

    Attributes
    ----------
    mesh
        Mesh of all loops except those of a patch. For recycling it has the arrays of the open mesh.
    trials
        Primal and dual function with their functionals.
    modes
        Coefficients of sides and bubbles, of the primal and of the dual function. Empty if affine.
    shapes
        Element shapes, None if all elements are straight and in the plane.
    floor
        Minimum quality after a change.
    few
        Minimum number of elements per thread.
    """

    modes: tuple[Modes, ...] = ()
    shapes: Shapes | None = None

    def __init__(self, mesh: KernelMesh, trials: Trials, floor: float) -> None:
        self.mesh, self.trials, self.floor, self.few = mesh, trials, floor, min_per_thread(1)

    def descend_nodes(self, thread: int, nodes: NDArray[np.int32]) -> float:
        mesh = self.mesh
        return descend_nodes(mesh.position, mesh.star, mesh.constraints, self.trials, nodes, self.floor)

    def descend_patch(self, patch: Patch) -> float:
        mesh = patch.mesh
        return descend_nodes(mesh.position, mesh.star, mesh.constraints, patch.trials, patch.nodes, self.floor)

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        # Returned are the decrease of the functional and the number of flips.
        mesh = self.mesh
        return descend_flips(mesh.position, mesh.elements, self.trials, self.floor, gainful, first, last, marks)

    def weigh_splits(self, thread: int, mesh: OpenMesh, offers: Offers, first: int, last: int) -> None:
        weigh_splits(mesh, self.trials, offers, self.floor, first, last)

    def weigh_collapses(self, thread: int, mesh: OpenMesh, offers: Offers, most: float, first: int, last: int) -> None:
        weigh_collapses(mesh, self.mesh.star, self.trials, offers, most, self.floor, first, last)

    def exchange(self, mesh: OpenMesh, offers: Offers, edges: Ints, nodes: Ints) -> tuple[int, float]:
        # Returned are the number of pairs and the decrease of the functional.
        return exchange(mesh, self.trials, offers, edges, nodes, self.floor)


class Higher(Linear):
    """Loops for functions of order 2 and 3, and of order 1 around an axis."""

    def __init__(
        self,
        mesh: KernelMesh,
        trials: Trials,
        floor: float,
        modes: tuple[Modes, ...],
        reference: Reference,
        points: Points,
        shapes: Shapes,
    ) -> None:
        super().__init__(mesh, trials, floor)
        self.modes, self.shapes, self.functions = modes, shapes, (reference, points, shapes)
        self.few = min_per_thread(1 + modes[0].side.shape[2])
        self.scratches = dict[int, Descents]()

    def scratch(self, thread: int) -> Descents:
        most = int(np.diff(self.mesh.star.start).max())
        if thread not in self.scratches or len(self.scratches[thread].primal.block.dof) < most:
            self.scratches[thread] = Descents.of(self.mesh, self.trials, self.modes, self.functions)
        return self.scratches[thread]

    def descend_nodes(self, thread: int, nodes: NDArray[np.int32]) -> float:
        return descend_nodes_higher(self.scratch(thread), nodes, self.floor)

    def descend_patch(self, patch: Patch) -> float:
        if patch.shapes is None:
            raise TypeError("a patch of order 2 or 3, or around an axis, requires shapes")
        scratch = Descents.of(patch.mesh, patch.trials, patch.modes, (*self.functions[:2], patch.shapes))
        return descend_nodes_higher(scratch, patch.nodes, self.floor)

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        return descend_flips_higher(self.scratch(thread), self.floor, gainful, first, last, marks)

    def weigh_splits(self, thread: int, mesh: OpenMesh, offers: Offers, first: int, last: int) -> None:
        weigh_higher(mesh, self.scratch(thread), offers, 0.0, self.floor, first, last, True)

    def weigh_collapses(self, thread: int, mesh: OpenMesh, offers: Offers, most: float, first: int, last: int) -> None:
        weigh_higher(mesh, self.scratch(thread), offers, most, self.floor, first, last, False)

    def exchange(self, mesh: OpenMesh, offers: Offers, edges: Ints, nodes: Ints) -> tuple[int, float]:
        return exchange_higher(mesh, self.scratch(0), offers, edges, nodes, self.floor)
