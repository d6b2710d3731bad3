"""Robin terms of a functional, and the best values on their boundaries.

The kernels, which see vertex stars only, do not include Robin terms.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.kernels.triangle.arrays import Points, Reference
from kohonen_adapt.mesh.functions import kinds_at_axis, trace_columns
from kohonen_adapt.mesh.polynomials import TrialFunction, by_points, fields_at, local_coefficients
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.boundary_terms import facet_terms, robin_value
from kohonen_adapt.problem.functional_value import elements_by_rule, flux_on, source_on, value_on
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import value_by_region

__all__ = ["BoundaryTerms"]


@dataclass(frozen=True)
class BoundaryTerms:
    """Robin terms of a functional on a moving triangulation.

    Attributes
    ----------
    ritz
        User-defined functional.
    reference
        Shape functions and quadrature points.
    number
        Index of every region in the tables of the functional, (nregions,).
    chains
        Curve segments of every named Robin boundary, (c,) bool.
    dirichlet
        Curve segments with Dirichlet values, (c,) bool.
    """

    ritz: Ritz
    reference: Reference
    number: Ints
    chains: dict[str, Mask]
    dirichlet: Mask

    @property
    def on(self) -> Mask:
        return np.any([np.zeros(len(self.dirichlet), dtype=np.bool_), *self.chains.values()], axis=0)

    def nodes(self, triangulation: Triangulation) -> Mask:
        elements, found = triangulation.elements, np.zeros(triangulation.nnodes, dtype=np.bool_)
        if self.chains:
            found[np.concatenate(elements.ends(*np.nonzero(on_chains(elements.chain, self.on))))] = True
        return found

    def value(self, chain: Ints, corners: Floats, coefficients: Floats, offsets: Floats | None = None) -> float:
        # `chain` (m, 3) holds the curve segment of every side, `corners` (m, 3, 2) and `coefficients` (m, b) belong
        # to the elements, and `offsets` (m, 3, 2) holds the midside offsets.
        total = 0.0
        for name, chains in self.chains.items():
            sides, terms = sides_on(chain, chains), self.ritz.robin[name]
            total += robin_value(corners, coefficients, sides, terms, self.ritz.axisymmetric, offsets)
        return total

    def improve(self, triangulation: Triangulation, trial: TrialFunction, offsets: Floats | None = None) -> None:
        # All values are found by one linear solve. With nonlinear laws the matrix has secant coefficients, and the
        # step is undone if the functional rises. `offsets` holds the midside offsets, shape (m, 3, 2).
        unknown, count = self._unknowns(triangulation, trial) if self.chains else (np.empty((0, 3), dtype=int), 0)
        if not count:
            return
        rows = np.flatnonzero(np.any(unknown >= 0, axis=1))
        offsets = np.zeros((len(rows), 3, 2)) if offsets is None else offsets[rows]
        near = RobinElements.of(triangulation, trial, offsets, rows, unknown[rows], self.number)
        matrix, rest = self._equations(near, count)
        change, before = spsolve(matrix.tocsc(), -rest), self._total(near)
        near.add(trial, change)
        if (
            any(self.ritz.laws)
            and self._total(RobinElements.of(triangulation, trial, offsets, rows, near.unknown, self.number)) > before
        ):
            near.add(trial, -change)

    def _unknowns(self, triangulation: Triangulation, trial: TrialFunction) -> tuple[Ints, int]:
        elements = triangulation.elements
        free = self.nodes(triangulation) & ~trial.fixed
        count, functions = int(free.sum()), self.reference.slope.shape[1]
        unknown = np.full((len(elements.node), functions), -1)
        unknown[:, :3] = np.where(free, np.cumsum(free) - 1, -1)[elements.node]
        e, k = sides_on(elements.chain, self.on & ~self.dirichlet)
        for first in range(3, min(functions, 9), 3):
            unknown[e, first + k] = count + np.arange(len(e))
            count += len(e)
        return unknown, count

    def _total(self, near: "RobinElements") -> float:
        own = value_on(near.corners, near.coefficients, near.number, self.ritz, near.offsets)
        return own + self.value(near.chain, near.corners, near.coefficients, near.offsets)

    def _equations(self, near: "RobinElements", count: int) -> tuple[coo_array, Floats]:
        parts = [(near.unknown, *self._of_elements(near))]
        for name, chains in self.chains.items():
            e, k = sides_on(near.chain, chains)
            ends = np.stack([near.corners[e, (k + 1) % 3], near.corners[e, (k + 2) % 3]], axis=1)
            terms, offset = self.ritz.robin[name], near.offsets[e, k]
            matrix, load = facet_terms(ends, self.ritz.order, terms, self.ritz.axisymmetric, offset)
            own = e[:, None], trace_columns(k, self.ritz.order)
            parts.append((near.unknown[own], matrix, np.einsum("fij,fj->fi", matrix, near.coefficients[own]) - load))
        total, right = coo_array((count, count)), np.zeros(count)
        for at, matrix, slope in parts:
            i, j = np.broadcast_arrays(at[:, :, None], at[:, None, :])
            both = (i >= 0) & (j >= 0)
            total = total + coo_array((matrix[both], (i[both], j[both])), shape=(count, count))
            np.add.at(right, at[at >= 0], slope[at >= 0])
        return total, right

    def _of_elements(self, near: "RobinElements") -> tuple[Floats, Floats]:
        (m, b), kind = near.coefficients.shape, np.zeros(len(near.rows), dtype=int)
        if self.ritz.axisymmetric:
            kind = kinds_at_axis(near.corners[:, :, 0])
        stiffness, rest = np.empty((m, b, b)), np.empty((m, b))
        for rule, law, rows in elements_by_rule(kind, near.number, self.ritz):
            stiffness[rows], rest[rows] = self._of_kind(near, rows, rule, by_points(self.ritz.order, law))
        return stiffness, rest

    def _of_kind(self, near: "RobinElements", rows: Ints, kind: int, points: Points) -> tuple[Floats, Floats]:
        ritz, (m, b) = self.ritz, (len(rows), near.coefficients.shape[1])
        corners, offsets, number = near.corners[rows], near.offsets[rows], near.number[rows]
        doubled, x, _, slope = fields_at(points, kind, corners, offsets, near.coefficients[rows])
        repeated = np.repeat(corners, b, axis=0), np.repeat(offsets, b, axis=0), np.tile(np.eye(b), (m, 1))
        each = fields_at(points, kind, *repeated)[3].reshape(2, -1, m, b)
        radius, weight = x if ritz.axisymmetric else np.ones_like(x), 0.5 * points.weight[kind][:, None] * doubled
        secant = value_by_region(np.asarray(ritz.coefficient), number) / radius
        for place, law in enumerate(ritz.laws):
            if law is not None:
                own = number == place
                size = np.maximum(np.hypot(*slope[:, :, own]), np.finfo(float).tiny)
                secant[:, own] = law.field_strength(size / radius[:, own]) / size
        flux = np.broadcast_to(np.reshape(flux_on(corners, number, ritz), (2, 1, -1)), slope.shape)
        stiffness = np.einsum("qm,cqmi,cqmj->mij", weight * secant, each, each)
        pulled = (weight * source_on(points, kind, corners, offsets, number, ritz)).T @ points.value[kind]
        return stiffness, np.einsum("cqm,cqmi->mi", weight * (secant * slope - flux), each) - pulled


@dataclass(frozen=True)
class RobinElements:
    rows: Ints  # (k,): their indices in the mesh
    node: Ints  # (k, 3)
    chain: Ints  # (k, 3)
    number: Ints  # (k,): indices of regions in the tables of the functional
    corners: Floats  # (k, 3, 2)
    offsets: Floats  # (k, 3, 2): midside offsets
    coefficients: Floats  # (k, b)
    unknown: Ints  # (k, b): index of every coefficient, -1 if fixed

    @classmethod
    def of(
        cls, tri: Triangulation, trial: TrialFunction, offsets: Floats, rows: Ints, unknown: Ints, number: Ints
    ) -> "RobinElements":
        node, chain, region = (array[rows] for array in (tri.elements.node, tri.elements.chain, tri.elements.region))
        coefficients = local_coefficients(trial.values[node], trial.modes and trial.modes.rows(rows))
        return cls(rows, node, chain, number[region], tri.position[node], offsets, coefficients, unknown)

    def add(self, trial: TrialFunction, change: Floats) -> None:
        e, i = np.nonzero(self.unknown >= 0)
        at_nodes, more = i < 3, change[self.unknown[e, i]]
        v, first = np.unique(self.node[e[at_nodes], i[at_nodes]], return_index=True)
        trial.values[v] += more[at_nodes][first]
        if trial.modes is not None:
            e, i, more = e[~at_nodes], i[~at_nodes], more[~at_nodes]
            trial.modes.side[self.rows[e], i % 3, i // 3 - 1] += more


def sides_on(chain: Ints, chains: Mask) -> tuple[Ints, Ints]:
    e, k = np.nonzero(on_chains(chain, chains))
    return e, k
