"""Express a Ritz functional in terms of a movable mesh: constants by region, given values by chain."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.kernels.arrays import (
    FREE,
    HELD,
    SLIDING,
    Laws,
    Reference,
    Trial,
    Trials,
)
from kohonen_adapt.mesh.polynomials import TrialFunction, local_coefficients, modes_of
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.chains import on_chains
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.outline import Outline
from kohonen_adapt.polishing.boundary import BoundaryTerms
from kohonen_adapt.polishing.chain_values import (
    hold_unpaired,
    line_of_chains,
    nodes_of_chains,
    signs_of_chains,
)
from kohonen_adapt.polishing.chords import Chords
from kohonen_adapt.polishing.elements import expanded, kinds_of, steepest, with_source, without_modes
from kohonen_adapt.polishing.energy_tables import Tables
from kohonen_adapt.polishing.regions import LINEAR, VariesInside, constants_of, laws_of_regions, numbers_of_regions
from kohonen_adapt.polishing.stationarity import check_in_plane
from kohonen_adapt.problem.functional_value import integrated, value_on
from kohonen_adapt.problem.ritz import Ritz, check_fits, parts_of

__all__ = ["Functional"]

FOLLOWED = 2  # order up to which a parabola follows a curve as well as functions do the solution


@dataclass(frozen=True)
class Functional:
    """What the polish lowers: it holds for the triangulation as it is now, wherever its nodes and edges have gone.

    Attributes
    ----------
    solution
        What minimises it on the mesh that it was stated on.
    reference
        Functions of the elements, and where they are integrated.
    ritz
        As its user states it.
    number
        Region number, in its tables, of every region of the triangulation, (nregions,).
    constants
        Coefficient, source and flux of every region of the triangulation, (nregions, 4); no flux where that varies.
    given
        Chains whose values are given, (c,) bool.
    linear
        Of those, the ones on which the values are linear in arc length, on curves constant, so that nodes may slide on
        them, (c,) bool.
    sign
        Of paired chains whose pair the functional states: 1 or -1, what values on one side are times those on the
        other, (c,); 0 on all other chains.
    boundary
        What Robin conditions add: nodes there stay, for the functional is known on the facets that there are.
    held
        Chains whose nodes are not to slide: curves, given values that are not linear, Robin conditions, or a chain of
        one facet between two nodes with given values, of which nobody can tell whether they are given on it, (c,) bool.
        On curved sides, too: what a parabola leaves out of a curve is of the order of the squared error, and nodes went
        to where it flatters. A magnet had 3 % more error of order 2, and a third more of order 3.
    on_chain
        Value at the origin of every chain and rate along it, (c, 2); true where `linear`.
    comparable
        Whether values of the functional on moved meshes may be compared: the admissible functions are the same, because
        outlines are straight, or sides bent to them up to what is of the order of the squared error, or what is between
        chords and curves is known, and values are given on whole chains only and linearly there, on curves constant.
    law
        Place of the law of every region in the tables, (nregions,) of int32; -1 where the region is linear.
    tables
        The energies of the laws.
    chords
        What lies between chords and curves.
    dual
        The functional of the dual solution of a goal, which is added to this; or None.
    share
        That of the first, as `Ritz` has it, which is in the constants of both; None without a dual.
    """

    solution: TrialFunction
    reference: Reference
    ritz: Ritz
    number: NDArray[np.int64]
    constants: Floats
    given: Mask
    linear: Mask
    sign: Floats
    boundary: BoundaryTerms
    held: Mask
    on_chain: Floats
    comparable: bool
    law: NDArray[np.int32]
    tables: Tables
    chords: Chords
    dual: "Functional | None" = None
    share: float | None = None

    @classmethod
    def of(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri | None = None) -> "Functional":
        """Look up the constants of every region and how values are given on every chain, of a dual solution likewise.

        The mesh is that of the movable one as it is now, where that is at hand.

        Raises
        ------
        ValueError
            If `ritz` is of another mesh, or its constants change inside a region.
        """
        parts = parts_of(ritz)
        general = any(part.axisymmetric or callable(part.source) for part in parts)
        one, *other = (cls._of_one(part, movable, mesh, general) for part in parts)
        if not other:
            return one
        (dual,) = other
        solution, comparable = one.solution._replace(dual=dual.solution), one.comparable and dual.comparable
        held = one.held | dual.held
        return replace(one, solution=solution, held=held, comparable=comparable, dual=dual, share=ritz.share)

    @classmethod
    def of_solution(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri) -> "Functional":
        """Look up the same for the solution of a problem, which is refused unless the functional is stationary there.

        Raises
        ------
        ValueError
            As `of` does, and if the functional is not stationary.
        """
        functional = cls.of(ritz, movable, mesh)
        for one in filter(None, (functional, functional.dual)):
            check_in_plane(one.ritz, mesh, movable, one.solution, one.boundary, one.sign)
        return functional

    @classmethod
    def _of_one(cls, ritz: Ritz, movable: MovableMesh, mesh: MeshTri | None, general: bool) -> "Functional":
        """Look up the same of one functional, at order 1 for the `general` loops of all orders if they are needed."""
        triangulation, outline = movable.triangulation, movable.outline
        mesh = movable.mesh() if mesh is None else mesh
        check_fits(ritz, mesh)
        if callable(ritz.flux) and (ritz.order > 1 or general):
            raise VariesInside(
                "flux of Ritz can be a function beside a constant source, at order 1 and in the plane only."
            )
        solution = solution_on(ritz, triangulation, mesh, general)
        hold_unpaired(solution, ritz, triangulation, outline)
        values, fixed, modes, _ = solution
        kind, count = outline.constraints.kind, len(outline.constraints.chains.length)
        chain, node = nodes_of_chains(triangulation)
        whole = np.bincount(chain, weights=~fixed[node], minlength=count) == 0
        partly = np.bincount(chain, weights=fixed[node] & (kind[node] == SLIDING), minlength=count) > 0
        bare = np.bincount(chain, weights=kind[node] == SLIDING, minlength=count) == 0
        on_chain, off = line_of_chains(triangulation, outline, chain, node, values)
        if modes is not None and ritz.order > 1:
            e, k = np.nonzero(triangulation.elements.chain >= 0)
            side = triangulation.elements.chain[e, k]
            whole &= np.bincount(side, weights=~modes.given[e, k], minlength=count) == 0
            np.maximum.at(off, side, np.abs(modes.side[e, k]).max(axis=1))
        followed = outline.straight | (movable.curved and ritz.order <= FOLLOWED)
        linear = whole & ~bare & followed & (off <= LINEAR * np.ptp(values))
        given = (whole & ~bare) | partly
        sign = signs_of_chains(ritz, outline)
        number, at = numbers_of_regions(ritz, triangulation.elements.region), integrated(ritz)
        boundary = BoundaryTerms(ritz, at, number, {name: outline.names[name] != 0 for name in ritz.robin}, given)
        held = ~outline.straight | (given & ~linear) | (whole & bare) | boundary.on
        largest = steepest(ritz, triangulation, values, modes) if any(ritz.laws) else 0.0
        law, tables = laws_of_regions(ritz, number, largest)
        constants = constants_of(ritz, number)
        level = np.where(whole & (off <= LINEAR * np.ptp(values)), on_chain[:, 0], np.nan)
        curves = ~followed & ~bare & ~boundary.on & is_plain(ritz, outline)
        chords = Chords.of(triangulation, outline, constants, curves, given, level)
        linear |= chords.known & given
        alike = bool(np.all(followed | chords.known)) and not np.any(given & ~linear)
        alike = alike and not chords.cut.any()
        comparable = ritz.comparable and alike and not np.any(fixed & (kind == FREE))
        if modes is not None:
            modes.given[on_chains(triangulation.elements.chain, boundary.on | outline.constraints.chains.paired)] = True
        chains = given, linear, sign, boundary, held, on_chain
        return cls(solution, at, ritz, number, constants, *chains, comparable, law, tables, chords)

    @property
    def nearly(self) -> bool:
        """Whether loops over stars know it nearly only: fluxes vary, or something is between chords and curves."""
        return self.varies or bool(self.chords.known.any())

    @property
    def varies(self) -> bool:
        """Return True if flux or source vary inside regions, so that elements that move have another one."""
        return self.has_varying_source or callable(self.ritz.flux) or (self.dual is not None and self.dual.varies)

    @property
    def has_varying_source(self) -> bool:
        """True if the source of the functional or of its dual is a function."""
        return callable(self.ritz.source) or (self.dual is not None and self.dual.has_varying_source)

    def value(self, triangulation: Triangulation, trial: TrialFunction, bend: Floats | None = None) -> float:
        """The functional of a function; sides are bent so much, (m, 3, 2)."""
        node, number = triangulation.elements.node, self.number[triangulation.elements.region]
        corners, coefficients = triangulation.position[node], local_coefficients(trial.values[node], trial.modes)
        total = value_on(corners, coefficients, number, self.ritz, bend)
        total += self.boundary.value(triangulation.elements.chain, corners, coefficients, bend)
        total += self.chords.value(triangulation, trial.values)
        if self.dual is None or trial.dual is None:
            return total
        return total + self.dual.value(triangulation, trial.dual, bend)

    def beyond_chords(self, triangulation: Triangulation, trial: TrialFunction) -> float:
        """What of it is between chords and curves."""
        own = self.chords.value(triangulation, trial.values)
        if self.dual is None or trial.dual is None:
            return own
        return own + self.dual.beyond_chords(triangulation, trial.dual)

    def improve_on_boundary(
        self, triangulation: Triangulation, trial: TrialFunction, bend: Floats | None = None
    ) -> None:
        """Take the best values where there are Robin conditions, of a dual function, too."""
        self.boundary.improve(triangulation, trial, bend)
        if self.dual is not None and trial.dual is not None:
            self.dual.improve_on_boundary(triangulation, trial.dual, bend)

    def trials(self, triangulation: Triangulation, trial: TrialFunction) -> Trials:
        """A function and its dual, each as `trial` has it."""
        one = self.trial(triangulation, trial.values, trial.fixed)
        if self.dual is None or trial.dual is None:
            return Trials(one, one._replace(value=one.value[:0]))
        return Trials(one, self.dual.trial(triangulation, trial.dual.values, trial.fixed))

    def trial(self, triangulation: Triangulation, values: Floats, fixed: Mask) -> Trial:
        """A function, what of it is given and the functional, for the kernels: sweeps change `values`, (n,)."""
        law, bent = self.law[triangulation.elements.region], np.zeros(len(values), dtype=np.bool_)
        bent[triangulation.elements.node[law >= 0]] = True
        laws = Laws(law, self.tables.first, self.tables.energy)
        return Trial(values, fixed, self.on_chain, self.of_elements(triangulation), bent, laws)

    def of_elements(self, triangulation: Triangulation) -> Floats:
        """What `Trial` calls its data, of the triangulation as it is now."""
        region = triangulation.elements.region
        constants = (self.constants / np.array([2.0, 6.0, 2.0, 2.0]))[region]
        corners = triangulation.position.T[:, triangulation.elements.node.T]
        if callable(self.ritz.source):
            return with_source(constants, corners, self.number[region], self.ritz.source, self.ritz.order)
        if callable(self.ritz.flux):
            return expanded(constants, corners, self.number[region], self.ritz.flux)
        return constants

    def kinds(self, outline: Outline, fixed: Mask) -> NDArray[np.int8]:
        """What each node may do, (n,), when those are held whose given values no formula would carry along."""
        kind, chain = outline.constraints.kind, outline.constraints.own_chain
        sliding = kind == SLIDING
        held = (kind == FREE) & fixed
        held[sliding] |= self.held[chain[sliding]]
        return np.where(held, HELD, kind).astype(kind.dtype)


def is_plain(ritz: Ritz, outline: Outline) -> bool:
    """Whether what is between chords and curves can be counted: not for laws, what varies inside, and an axis.

    Beside pairs two stars are one, of whose slivers nothing is known.
    """
    varies = callable(ritz.flux) or callable(ritz.source)
    plain = ritz.order == 1 and not (ritz.axisymmetric or varies or ritz.laws)
    return plain and not outline.constraints.chains.paired.any()


def solution_on(ritz: Ritz, triangulation: Triangulation, mesh: MeshTri, general: bool) -> TrialFunction:
    """The solution of a functional in the form of the kernels."""
    values, fixed, n, modes = np.asarray(ritz.values), np.asarray(ritz.fixed), triangulation.nnodes, None
    node = triangulation.elements.node
    if ritz.order == 1 and general:
        modes = without_modes(len(node))
    elif ritz.order > 1:
        modes = modes_of(mesh, node, values, ritz.order, fixed, kinds_of(ritz, triangulation))
    return TrialFunction(values[:n], fixed[:n].copy(), modes)
