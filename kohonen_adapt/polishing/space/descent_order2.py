"""Descent of a functional of order 2 on an open mesh of tetrahedra."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from kohonen_adapt.arrays import padded
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.tetrahedron.arrays import Quadratic, SolidBlock
from kohonen_adapt.kernels.tetrahedron.polish.descend_order2 import descend_nodes_order2
from kohonen_adapt.kernels.threads import Nodes
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.space.descent import Descent
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

__all__ = ["QuadraticDescent"]


@dataclass(frozen=True)
class QuadraticDescent(Descent):
    """Descent of a functional of order 2 on an open mesh of tetrahedra.

    Attributes
    ----------
    modes
        Coefficients of the edges of all elements.
    blocks
        Scratch by thread.
    """

    modes: Modes
    blocks: dict[int, SolidBlock] = field(default_factory=dict)

    sweeps_per_swap: ClassVar[int] = 2

    @classmethod
    def of(cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction) -> "QuadraticDescent":
        if trial.modes is None:
            raise TypeError("a descent of order 2 requires coefficients of edges")
        opened = OpenSolid.of(movable, np.ones(movable.nnodes))
        nodes, elements = len(opened.mesh.position), len(opened.mesh.elements.node)
        own = functional.trial(padded(trial.values, nodes, 0.0), padded(trial.fixed, nodes, False))
        modes = Modes(*(padded(array, elements, 0) for array in trial.modes))
        return cls(opened, functional, own, movable.floor, movable.flips, np.zeros((elements, 2)), modes)

    def copy(self) -> Self:
        return replace(super().copy(), modes=Modes(*(array.copy() for array in self.modes)), blocks={})

    def value(self) -> float:
        mesh = self.opened.mesh
        return self.functional.value_on(
            mesh.position, mesh.elements, TrialFunction(self.trial.value, self.trial.fixed, self.modes)
        )

    def quadratic(self, thread: int) -> Quadratic:
        block = self.blocks.get(thread) or self.blocks.setdefault(thread, SolidBlock.of())
        return Quadratic(self.trial, self.modes, self.functional.dirichlet[: self.functional.patches], block)

    def descend_nodes(self, thread: int, mesh: KernelMesh, nodes: Nodes) -> float:
        return float(descend_nodes_order2(mesh, self.quadratic(thread), nodes, self.floor**3))

    def swap(self, parts: Parts) -> float:
        return 0.0

    def recycle(self) -> tuple[int, float]:
        return 0, 0.0
