"""Descent of a functional on tetrahedra, with swaps and recycling."""

from dataclasses import dataclass, field, replace
from threading import get_ident
from typing import Self

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask, copied
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    PLANE,
    Constraints,
    Freedom,
    OpenTetrahedra,
    Quadratic,
    Queue,
    SolidBlock,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.polish.descend import descend_nodes
from kohonen_adapt.kernels.tetrahedron.swap import enter_changed, swap_downhill
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.energy_recycling import with_spare_rows
from kohonen_adapt.polishing.polish import SETTLED
from kohonen_adapt.polishing.space.curved_sides import CurvedEdges
from kohonen_adapt.polishing.space.recycling_in_space import (
    EXCHANGES,
    MANY,
    MORE,
    SPARE,
    Function,
    Plan,
    edges_of_patches,
    empty_offers,
    exchanged,
    nodes_of,
    on_patches,
    sample_of,
    size_of,
    weighed,
)
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

__all__ = ["SpaceDescent"]

LOOKS = 50_000, 10_000  # elements per compiled call by order, at most 0.5 s: Ctrl-C is handled between calls only
CHANGED = 0.1  # relative change of volume or energy after which an element is searched again
SWEEPS_PER_SWAP = 1, 2  # by order


@dataclass(frozen=True)
class SpaceDescent:
    """Descent of a functional of order 1 or 2 on an open mesh of tetrahedra.

    Attributes
    ----------
    movable
        Mesh before the descent, which changes at the close.
    recycled
        Nodes recycled before.
    opened
        Mesh with spare rows, which changes.
    functional
        Functional to minimise.
    trial
        Function and functional for the kernels.
    floor
        Minimum quality. Elements below may not get worse.
    swaps
        True if elements may be swapped.
    seen
        Volume and energy of elements at their last search for swaps, (rows, 2).
    modes
        Coefficients of the edges of all elements, None at order 1.
    curves
        Curved edges.
    size
        Number of unknowns of order 2 at the start, up to a constant.
    pairs
        Number of recycled nodes.
    blocks
        Scratch of order 2 by thread.
    price
        Functional per unknown at which gains of splits and costs of collapses are equal, (1,). nan before gains are
        known.
    """

    movable: MovableSolid
    recycled: Recycled
    opened: OpenSolid
    functional: SolidFunctional
    trial: Trial
    floor: float
    swaps: bool
    seen: Floats
    modes: Modes | None
    curves: CurvedEdges
    size: int
    pairs: int = 0
    blocks: dict[int, SolidBlock] = field(default_factory=dict)
    price: Floats = field(default_factory=lambda: np.full(1, np.nan))

    @classmethod
    def of(
        cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, recycled: Recycled
    ) -> "SpaceDescent":
        target = 0 if trial.modes is None else movable.nnodes + movable.nnodes // SPARE + MORE
        opened = OpenSolid.of(movable, np.ones(movable.nnodes), target, relief=1.0)
        mesh = opened.mesh
        mesh.origins.old[: movable.nnodes] = recycled.old
        mesh.origins.start_element[: movable.nnodes] = recycled.start_element
        rows = len(opened.mesh.position)
        values, fixed, modes, _, surface = with_spare_rows(trial, rows, len(mesh.elements.node))
        if len(surface) and modes is not None:  # loads do no work if the values on their surfaces are given
            fixed |= on_patches(mesh, functional.driven)
            modes.dirichlet[:] |= edges_of_patches(mesh, functional.driven)
        own = functional.trial(values, fixed, surface)
        rules = (movable.polish_floor, movable.flips)
        seen = np.zeros((len(mesh.elements.node), 2))
        common = movable, recycled, opened, functional, own, *rules, seen
        return cls(*common, modes, CurvedEdges.of(movable, rows), size_of(mesh))

    def copy(self) -> Self:
        names = ("value", "fixed", "surface")
        trial = self.trial._replace(**{name: getattr(self.trial, name).copy() for name in names})
        modes = self.modes and copied(self.modes)
        own = replace(self, opened=self.opened.copy(), trial=trial, modes=modes)
        return replace(own, seen=self.seen.copy(), price=self.price.copy(), blocks={})

    @property
    def order(self) -> int:
        return 1 if self.modes is None else 2

    def function(self) -> Function:
        """Return the arguments of kernels, at order 2 with scratch of the thread."""
        if self.modes is None:
            return self.trial, None
        thread = get_ident()
        block = self.blocks.get(thread) or self.blocks.setdefault(thread, self.curves.block())
        return self.trial, Quadratic(
            self.trial, self.modes, self.functional.dirichlet[: self.functional.patches], block
        )

    def descend(self, sweeps: int, swap_first: bool) -> float:
        freedom = self.functional.freedom(self.opened.mesh.freedom, self.trial.fixed, self.trial.surface)
        parts = self.opened.parts()
        gain = self.swap(parts) if swap_first else 0.0
        for k in range(sweeps):
            gain += self.sweep(parts, freedom)
            if (k + 1) % SWEEPS_PER_SWAP[self.order - 1] == 0 or k + 1 == sweeps:
                gain += self.swap(parts)
        return gain

    def descend_checked(self, sweeps: int, swap_first: bool) -> tuple[Self, float]:
        """Return the descent after some sweeps, and the decrease of the functional.

        If the functional is approximate and has not decreased, the state before the sweeps is returned.
        """
        if not self.functional.is_approximate:
            return self, self.descend(sweeps, swap_first)
        if self.functional.has_varying_source and sweeps > 1:
            descent, decrease = self.descend_checked(1, swap_first)
            descent, more = descent.descend_checked(sweeps - 1, swap_first) if decrease > 0.0 else (descent, 0.0)
            return descent, decrease + more
        before = self.copy()
        self.descend(sweeps, swap_first)
        decrease = before.value() - self.value()
        return (self, decrease) if decrease > 0.0 else (before, 0.0)

    def recycle_checked(self, sweeps: int, swap_first: bool, whole: bool) -> tuple[Self, float, bool]:
        # A recycling may raise the functional, since sweeps and swaps lower the functional afterwards. If these do not
        # suffice, the nodes stay.
        before = self.copy()
        pairs, decrease = self.recycle(whole)
        decrease += self.descend(sweeps, swap_first)
        if self.functional.is_approximate:
            decrease = before.value() - self.value()
        if decrease < 0.0:
            return *before.descend_checked(sweeps, swap_first), False
        return replace(self, pairs=self.pairs + pairs), decrease, pairs > SETTLED * self.movable.nnodes

    def further(self, whole: bool) -> int:
        return 0

    def close(self) -> Recycled:
        # Recycled meshes are numbered along a space-filling curve. At order 2 not as many nodes are removed as added.
        nodes = self.movable.nnodes
        rows = self.opened.write_back(self.movable, renumbered=self.pairs > 0)
        return self.recycled.followed_by(self.opened.mesh.origins, rows, self.pairs, self.pairs + nodes - len(rows))

    def value(self) -> float:
        function = TrialFunction(self.trial.value, self.trial.fixed, self.modes, surface=self.trial.surface)
        return self.functional.value_on(self.opened.mesh.position, self.opened.mesh.elements, function, self.curves)

    def swap(self, parts: Parts) -> float:
        """Swap while the functional decreases, and return the decrease.

        Elements that have changed since their last search are searched again. Edges on patches change only if the
        domain and the Dirichlet values stay the same.
        """
        if not self.swaps:
            return 0.0
        self.sample_source()
        mesh, queue = self.opened.mesh, self.opened.queue
        charge, free = self.charge(), self.free_planes()
        looks = LOOKS[self.order - 1]
        enter_changed(mesh, self.trial, queue, self.seen, CHANGED)

        def swap(part: OpenTetrahedra, own: Queue) -> float:
            return float(swap_downhill(part, *self.function(), own, self.seen, free, charge, self.floor**3, looks)[1])

        return parts.work_off(queue, swap)

    def free_planes(self) -> Mask:
        return (self.opened.mesh.surfaces.shape == PLANE) & ~self.functional.held[: self.functional.patches]

    def charge(self) -> float:
        """Return the decrease of the functional that an added unknown requires."""
        if self.modes is None:
            return 0.0
        if np.isnan(self.price[0]):
            self.weigh(sample_of(nodes_of(self.opened.mesh)))
        return float(self.price[0])

    def weigh(self, nodes: Ints) -> Plan:
        mesh = self.opened.mesh
        patches = slice(self.functional.patches)
        freedom = self.functional.freedom(mesh.freedom, self.trial.fixed, self.trial.surface)
        removable = (freedom.number != HELD) & (mesh.pool.anchor >= 0)
        lone = self.trial.fixed & ~on_patches(mesh, self.functional.dirichlet[patches] | self.functional.driven)
        is_open = ~(self.functional.held | self.functional.dirichlet)[patches]
        offers = empty_offers(mesh, is_open if self.modes is None else self.free_planes(), removable, lone)
        plan = weighed(mesh, self.function, offers, nodes, self.floor**3)
        self.price[0] = plan.price
        return plan

    def recycle(self, whole: bool = True) -> tuple[int, float]:
        """Split edges and collapse nodes while the gain exceeds the cost.

        Returned are the number of splits and the decrease of the functional, negative for an increase. New elements
        enter the queue of swaps.
        """
        self.sample_source()
        mesh = self.opened.mesh
        total, decrease = 0, 0.0
        for _ in range(EXCHANGES[self.order - 1] if whole else 1):
            plan = self.weigh(nodes_of(mesh))
            added = size_of(mesh) - self.size
            splits, fall = exchanged(mesh, self.function(), self.opened.queue, plan, added, self.floor**3)
            total, decrease = total + splits, decrease + fall
            if splits <= MANY * len(nodes_of(mesh)):
                break
        return total, decrease

    def sample_source(self) -> None:
        self.functional.sample_source(self.opened.mesh.position, self.opened.mesh.elements, self.trial)

    def sweep(self, parts: Parts, freedom: Freedom) -> float:
        mesh = self.opened.mesh
        star = self.opened.star()
        self.sample_source()
        constraints = Constraints(freedom, mesh.surfaces, freedom.number == INSIDE)
        arrays = KernelMesh(mesh.position, mesh.elements, star, constraints)
        return parts.sweep(star, lambda _, nodes: float(descend_nodes(arrays, *self.function(), nodes, self.floor**3)))
