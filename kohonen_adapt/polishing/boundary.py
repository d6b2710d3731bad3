"""Robin terms of a functional, and the best values on their boundaries.

The kernels, which see vertex stars only, do not include Robin terms.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, IntsPair, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.mesh.elements.polynomials import TrialFunction, local_coefficients
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.boundary_terms import robin_value, terms_of_sides
from kohonen_adapt.problem.functional_value import energy_on, functions_on, loads_on, value_on
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["BoundaryTerms"]

FUNCTIONS = {1: 3, 2: 6, 3: 10}  # of a triangle, by order


@dataclass(frozen=True)
class BoundaryTerms:
    """Robin terms of a functional on a moving triangulation.

    Attributes
    ----------
    ritz
        User-defined functional.
    number
        Index of every region in the tables of the functional, (nregions,).
    chains
        Curve segments of every named Robin boundary, (c,) bool.
    dirichlet
        Curve segments with Dirichlet values, (c,) bool.
    """

    ritz: Ritz
    number: Ints
    chains: dict[str, Mask]
    dirichlet: Mask

    @property
    def on(self) -> Mask:
        return np.any([np.zeros(len(self.dirichlet), bool), *self.chains.values()], axis=0)

    def nodes(self, triangulation: Triangulation) -> Mask:
        elements, found = triangulation.elements, np.zeros(triangulation.nnodes, bool)
        if self.chains:
            found[np.concatenate(elements.ends(*np.nonzero(on_chains(elements.chain, self.on))))] = True
        return found

    def value(self, chain: Ints, corners: Floats, coefficients: Floats, offset: Floats | None = None) -> float:
        # `chain` (m, 3) holds the curve segment of every side, `corners` (2, 3, m) and `coefficients` (k, m) belong
        # to the elements, and `offset` (2, 3, m) holds the midside offsets.
        total = 0.0
        for name, chains in self.chains.items():
            sides, terms = sides_on(chain, chains), self.ritz.robin[name]
            total += robin_value(corners, coefficients, sides, terms, self.ritz.axisymmetric, offset)
        return total

    def terms(self, chain: Ints, corners: Floats, offset: Floats | None) -> Iterator[tuple[IntsPair, Floats, Floats]]:
        """Return the terms of every condition by `terms_of_sides`, for `value`."""
        for name, chains in self.chains.items():
            data = self.ritz.order, self.ritz.robin[name], self.ritz.axisymmetric, offset
            yield terms_of_sides(corners, sides_on(chain, chains), *data)

    def improve(self, triangulation: Triangulation, trial: TrialFunction, offsets: Floats | None = None) -> None:
        # All values are found by one linear solve. With nonlinear laws the matrix has secant coefficients, and the
        # step is undone if the functional rises. `offsets` holds the midside offsets, shape (m, 3, 2).
        unknown, count = self._unknowns(triangulation, trial) if self.chains else (np.empty((3, 0), int), 0)
        if not count:
            return
        rows = np.flatnonzero(np.any(unknown >= 0, axis=0))
        offset = None if offsets is None else offsets[rows].T
        near = RobinElements.of(triangulation, trial, offset, rows, unknown[:, rows], self.number)
        matrix, rest = self._equations(near, count)
        change, before = spsolve(matrix.tocsc(), -rest), self._total(near)
        near.add(trial, change)
        after = RobinElements.of(triangulation, trial, offset, rows, near.unknown, self.number)
        if any(self.ritz.laws) and self._total(after) > before:
            near.add(trial, -change)

    def _unknowns(self, triangulation: Triangulation, trial: TrialFunction) -> tuple[Ints, int]:
        elements = triangulation.elements
        free = self.nodes(triangulation) & ~trial.fixed
        count, functions = int(free.sum()), FUNCTIONS[self.ritz.order]
        unknown = np.full((functions, len(elements.node)), -1)
        unknown[:3] = np.where(free, np.cumsum(free) - 1, -1)[elements.node.T]
        e, k = sides_on(elements.chain, self.on & ~self.dirichlet)
        for first in range(3, min(functions, 9), 3):
            unknown[first + k, e] = count + np.arange(len(e))
            count += len(e)
        return unknown, count

    def _total(self, near: "RobinElements") -> float:
        own = value_on(near.corners, near.coefficients, near.number, self.ritz, near.offset)
        return own + self.value(near.chain, near.corners, near.coefficients, near.offset)

    def _equations(self, near: "RobinElements", count: int) -> tuple[coo_array, Floats]:
        parts = [(near.unknown.T, *self._of_elements(near))]
        for places, matrix, load in self.terms(near.chain, near.corners, near.offset):
            pulled = np.einsum("fij,fj->fi", matrix, near.coefficients[places])
            parts.append((near.unknown[places], matrix, pulled - load))
        total, right = coo_array((count, count)), np.zeros(count)
        for at, matrix, slope in parts:
            i, j = np.broadcast_arrays(at[:, :, None], at[:, None, :])
            both = (i >= 0) & (j >= 0)
            total = total + coo_array((matrix[both], (i[both], j[both])), shape=(count, count))
            np.add.at(right, at[at >= 0], slope[at >= 0])
        return total, right

    def _of_elements(self, near: "RobinElements") -> FloatsPair:
        functions = functions_on(near.corners, near.number, self.ritz, near.offset)
        loads = loads_on(functions, near.number, self.ritz)
        energy = energy_on(functions, near.number, self.ritz, np.add(*loads))
        vector = energy.vector(near.coefficients)
        secant = energy.densities.secant(magnitude(vector))
        return functions.matrices(secant), (functions.against_gradients(secant * vector) - energy.load).T


@dataclass(frozen=True)
class RobinElements:
    rows: Ints  # (k,): their indices in the mesh
    node: Ints  # (k, 3)
    chain: Ints  # (k, 3)
    number: Ints  # (k,): indices of regions in the tables of the functional
    corners: Floats  # (2, 3, k)
    offset: Floats | None  # (2, 3, k): midside offsets
    coefficients: Floats  # (b, k)
    unknown: Ints  # (b, k): index of every coefficient, -1 if fixed

    @classmethod
    def of(
        cls, tri: Triangulation, trial: TrialFunction, offset: Floats | None, rows: Ints, unknown: Ints, number: Ints
    ) -> "RobinElements":
        node, chain, region = (array[rows] for array in (tri.elements.node, tri.elements.chain, tri.elements.region))
        coefficients = local_coefficients(trial.values[node], trial.modes and trial.modes.rows(rows)).T
        return cls(rows, node, chain, number[region], tri.position.T[:, node.T], offset, coefficients, unknown)

    def add(self, trial: TrialFunction, change: Floats) -> None:
        i, e = np.nonzero(self.unknown >= 0)
        at_nodes, more = i < 3, change[self.unknown[i, e]]
        v, first = np.unique(self.node[e[at_nodes], i[at_nodes]], return_index=True)
        trial.values[v] += more[at_nodes][first]
        if trial.modes is not None:
            e, i, more = e[~at_nodes], i[~at_nodes], more[~at_nodes]
            trial.modes.side[self.rows[e], i % 3, i // 3 - 1] += more


def sides_on(chain: Ints, chains: Mask) -> IntsPair:
    e, k = np.nonzero(on_chains(chain, chains))
    return e, k
