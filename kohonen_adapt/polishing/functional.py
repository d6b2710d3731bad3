"""Ritz functional on a movable triangulation."""

from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Int8s, Int32s, Int64s, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, SLIDING, OpenMesh, Trial
from kohonen_adapt.mesh.elements.polynomials import (
    TrialFunction,
    local_coefficients,
    modes_of,
)
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.polishing.boundary import BoundaryTerms
from kohonen_adapt.polishing.chords import Chords
from kohonen_adapt.polishing.elements import (
    expanded,
    hold_unpaired,
    kinds_of,
    line_of_chains,
    nodes_of_chains,
    shapes_of,
    signs_of_chains,
    with_source,
    without_modes,
)
from kohonen_adapt.polishing.energy_tables import (
    LINEAR,
    Tables,
    VariesInside,
    constants_of,
    laws_of_regions,
    numbers_of_regions,
)
from kohonen_adapt.polishing.loops import Loops
from kohonen_adapt.polishing.stationarity_in_plane import check_in_plane
from kohonen_adapt.problem.functional_value import steepest, value_on
from kohonen_adapt.problem.ritz import Ritz, check_matches, parts_of

__all__ = ["Functional"]

FOLLOWED = 2  # largest order at which curved sides (parabolas) are as accurate as the functions


@dataclass(frozen=True)
class Functional:
    """Functional that the polish lowers, valid while nodes and edges move.

    Attributes
    ----------
    solution
        Minimiser of the functional on the input mesh.
    ritz
        User-defined functional.
    number
        Index of every region in the tables of the functional, (nregions,).
    constants
        Coefficient, source and flux of every region, (nregions, 4). A source or flux that is a function is 0
        here.
    dirichlet
        Curve segments with Dirichlet values, (c,) bool.
    linear
        `dirichlet` segments on which nodes may slide, (c,) bool. Values are linear in arc length, on curves constant.
    sign
        Sign of periodic pairs, (c,). Values on one side are `sign` times the values on the opposite side. 0 for
        all other segments.
    boundary
        Robin terms. Nodes on Robin boundaries do not move.
    held
        Segments on which nodes do not slide, (c,) bool: curves, Dirichlet values that are not linear, Robin
        boundaries, periodic pairs, and single facets between two Dirichlet nodes, which may or may not be Dirichlet
        facets.
    on_chain
        Value at the start of every segment and rate along the segment, (c, 2), valid where `linear`.
    comparable
        True if values of the functional on different meshes are comparable, because the set of admissible
        functions does not depend on the mesh.
    law
        Index of the law of every region in the tables, (nregions,), -1 if linear.
    tables
        Energies of the laws.
    chords
        Slivers between chords and curves.
    dual
        Functional of the dual solution of a goal, or None.
    share
        Weight of the primal functional, included in the constants of both, None without a dual.
    """

    solution: TrialFunction
    ritz: Ritz
    number: Int64s
    constants: Floats
    dirichlet: Mask
    linear: Mask
    sign: Floats
    boundary: BoundaryTerms
    held: Mask
    on_chain: Floats
    comparable: bool
    law: Int32s
    tables: Tables
    chords: Chords
    dual: "Functional | None" = None
    share: float | None = None

    @classmethod
    def of(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri | None = None) -> "Functional":
        """Return the functional of `ritz`, including the functional of a dual solution.

        `mesh` is the current mesh of `movable`, built if None.

        Raises
        ------
        ValueError
            If `ritz` is of a different mesh, or its constants change inside a region.
        """
        parts = parts_of(ritz)
        general = any(part.axisymmetric or callable(part.source) for part in parts)
        primal, *rest = (cls._of_one(part, movable, mesh, general) for part in parts)
        if not rest:
            return primal
        (dual,) = rest
        solution = primal.solution._replace(dual=dual.solution)
        comparable = primal.comparable and dual.comparable
        held = primal.held | dual.held
        return replace(primal, solution=solution, held=held, comparable=comparable, dual=dual, share=ritz.share)

    @classmethod
    def of_solution(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri) -> "Functional":
        """Return the functional of a solution, which must be stationary.

        Raises
        ------
        ValueError
            If `of` raises, or if the functional is not stationary at the solution.
        """
        functional = cls.of(ritz, movable, mesh)
        for each, solution in functional.parts(functional.solution):
            check_in_plane(each.ritz, mesh, movable, solution, each.boundary, each.sign)
        return functional

    @classmethod
    def _of_one(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri | None, general: bool) -> "Functional":
        triangulation, outline = movable.triangulation, movable.outline
        mesh = movable.mesh() if mesh is None else mesh
        check_matches(ritz, mesh)
        if callable(ritz.flux) and (ritz.order > 1 or general):
            raise VariesInside("flux of Ritz can be a function only at order 1, in the plane, with a constant source.")
        solution = solution_on(ritz, triangulation, mesh, general)
        hold_unpaired(solution, ritz, triangulation, outline)
        values, fixed, modes = solution.values, solution.fixed, solution.modes
        kind = outline.constraints.kind
        count = len(outline.constraints.chains.length)
        chain, node = nodes_of_chains(triangulation)
        whole = np.bincount(chain, ~fixed[node], count) == 0
        partly = np.bincount(chain, fixed[node] & (kind[node] == SLIDING), count) > 0
        bare = np.bincount(chain, kind[node] == SLIDING, count) == 0
        on_chain, deviation = line_of_chains(triangulation, outline, chain, node, values)
        if modes is not None and ritz.order > 1:
            e, k = np.nonzero(triangulation.elements.chain >= 0)
            side = triangulation.elements.chain[e, k]
            whole &= np.bincount(side, ~modes.dirichlet[e, k], count) == 0
            np.maximum.at(deviation, side, np.abs(modes.side[e, k]).max(axis=1))
        followed = outline.straight | (movable.curved and ritz.order <= FOLLOWED)
        linear = whole & ~bare & followed & (deviation <= LINEAR * np.ptp(values))
        dirichlet = (whole & ~bare) | partly
        number = numbers_of_regions(ritz, triangulation.elements.region)
        boundary = BoundaryTerms.of(ritz, outline)
        paired = outline.constraints.chains.paired
        held = ~outline.straight | (dirichlet & ~linear) | (whole & bare) | boundary.on | paired
        largest = steepest(mesh, ritz) if any(ritz.laws) else 0.0
        law, tables = laws_of_regions(ritz, number, largest)
        constants = constants_of(ritz, number)
        level = np.where(whole & (deviation <= LINEAR * np.ptp(values)), on_chain[:, 0], np.nan)
        curves = ~followed & ~bare & ~boundary.on & is_plain(ritz, outline)
        chords = Chords.of(triangulation, outline, constants, curves, dirichlet, level)
        linear |= chords.counted & dirichlet
        same_space = bool(np.all(followed | chords.counted)) and not np.any(dirichlet & ~linear)
        same_space = same_space and not chords.cut.any()
        comparable = ritz.comparable and same_space and not np.any(fixed & (kind == FREE))
        if modes is not None:
            modes.dirichlet[on_chains(triangulation.elements.chain, boundary.on | paired)] = True
        chains = dirichlet, linear, signs_of_chains(ritz, outline), boundary, held, on_chain
        return cls(solution, ritz, number, constants, *chains, comparable, law, tables, chords)

    @property
    def is_approximate(self) -> bool:
        """True if stars give the functional approximately (varying data or slivers)."""
        return self.varies or bool(self.chords.counted.any())

    @property
    def varies(self) -> bool:
        return self.has_varying_source or any(callable(part.ritz.flux) for part, _ in self.parts(self.solution))

    @property
    def has_varying_source(self) -> bool:
        return any(callable(part.ritz.source) for part, _ in self.parts(self.solution))

    def parts(self, trial: TrialFunction) -> "list[tuple[Functional, TrialFunction]]":
        """Return the primal and, if any, the dual functional with their functions."""
        return [(self, trial)] if self.dual is None or trial.dual is None else [(self, trial), (self.dual, trial.dual)]

    def value(self, triangulation: Triangulation, trial: TrialFunction, offsets: Floats | None = None) -> float:
        node = triangulation.elements.node
        corners = triangulation.position.T[:, triangulation.elements.node.T]
        offset = None if offsets is None else offsets.T
        total = 0.0
        for part, own in self.parts(trial):
            coefficients = local_coefficients(own.values[node], own.modes).T
            total += value_on(corners, coefficients, part.number[triangulation.elements.region], part.ritz, offset)
            total += part.boundary.value(triangulation.elements.chain, corners, coefficients, offset)
        return total + self.energy_beyond_chords(triangulation, trial)

    def energy_beyond_chords(self, triangulation: Triangulation, trial: TrialFunction) -> float:
        return sum(part.chords.value(triangulation, own.values) for part, own in self.parts(trial))

    def trials(self, triangulation: Triangulation, trial: TrialFunction) -> tuple[Trial, Trial]:
        # a missing dual has no values
        primal = self.trial(triangulation, trial.values, trial.fixed)
        if self.dual is None or trial.dual is None:
            return primal, primal._replace(value=primal.value[:0])
        return primal, self.dual.trial(triangulation, trial.dual.values, trial.fixed)

    def loops(self, movable: MovableMesh, trial: TrialFunction, mesh: KernelMesh | OpenMesh) -> Loops:
        mesh = KernelMesh(mesh.position, mesh.elements, movable.triangulation.star, mesh.constraints)
        trials = self.trials(movable.triangulation, trial)
        rows = len(mesh.elements.node)
        shapes = None if trial.affine else shapes_of(self.ritz, movable.midside_offsets(), rows)
        return Loops(mesh, trials, trial.all_modes, shapes, self.ritz.order, movable.polish_floor)

    def trial(self, triangulation: Triangulation, values: Floats, fixed: Mask) -> Trial:
        law = self.law[triangulation.elements.region]
        nonlinear = np.zeros(len(values), bool)
        nonlinear[triangulation.elements.node[law >= 0]] = True
        laws = Laws(law, self.tables.first, self.tables.energy)
        return Trial(values, fixed, self.on_chain, self.of_elements(triangulation), nonlinear, laws)

    def of_elements(self, triangulation: Triangulation) -> Floats:
        region = triangulation.elements.region
        constants = (self.constants / np.array([2.0, 6.0, 2.0, 2.0]))[region]
        corners = triangulation.position.T[:, triangulation.elements.node.T]
        if callable(self.ritz.source):
            return with_source(constants, corners, self.number[region], self.ritz.source, self.ritz.order)
        if callable(self.ritz.flux):
            return expanded(constants, corners, self.number[region], self.ritz.flux)
        return constants

    def kinds(self, outline: Outline, fixed: Mask) -> Int8s:
        """Return the kind of every node, (n,), held if its Dirichlet value cannot follow."""
        kind, chain = outline.constraints.kind, outline.constraints.own_chain
        sliding = kind == SLIDING
        held = (kind == FREE) & fixed
        held[sliding] |= self.held[chain[sliding]]
        return np.where(held, HELD, kind).astype(kind.dtype)


def is_plain(ritz: Ritz, outline: Outline) -> bool:
    varies = callable(ritz.flux) or callable(ritz.source)
    plain = ritz.order == 1 and not (ritz.axisymmetric or varies or ritz.laws)
    return plain and not outline.constraints.chains.paired.any()


def solution_on(ritz: Ritz, triangulation: Triangulation, mesh: MeshTri, general: bool) -> TrialFunction:
    values, fixed = np.asarray(ritz.values), np.asarray(ritz.fixed)
    n = triangulation.nnodes
    modes = None
    node = triangulation.elements.node
    if ritz.order == 1 and general:
        modes = without_modes(len(node))
    elif ritz.order > 1:
        modes = modes_of(mesh, node, values, ritz.order, fixed, kinds_of(ritz, triangulation))
    return TrialFunction(values[:n], fixed[:n].copy(), modes)
