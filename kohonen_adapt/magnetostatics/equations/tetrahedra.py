"""Integrals of functions of order 1 and 2 on tetrahedra with straight edges."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array
from skfem import MeshTet
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import FiniteElements, LinearFunctions
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.mesh.host import edges_between, number_edges
from kohonen_adapt.mesh.measures import area, inner_points, magnitude
from kohonen_adapt.mesh.quadrature import LAW_DEGREE_IN_SPACE, tetrahedron_rule

__all__ = ["EDGES", "LinearTetrahedra", "QuadraticTetrahedra", "Tetrahedra", "tetrahedra_on"]

EDGES = np.transpose(RefTet.edges)  # (2, 6): local corners, in the order of scikit-fem
FACE_EDGES = np.array([(0, 1), (1, 2), (0, 2)]).T
DEGREE = 3  # of the rule without a law: a torque integrates products of two fields and an arm
CHUNK = 1 << 14  # elements whose products are computed at once
PAIRS, METRIC = np.triu_indices(10), np.triu_indices(4)  # of functions, and of barycentric coordinates


class Tetrahedra(FiniteElements):
    """Functions of one order on tetrahedra.

    Arrays at quadrature points have shape (..., npoints). `gradient` may have fewer columns than points, because
    gradients of order 1 are constant in elements; `gradient_weights` are the volumes of its columns.
    """

    order: int
    mesh: MeshTet
    volumes: Any  # (nelements,)
    element: Ints  # (npoints,): element of every quadrature point
    points: Floats  # (3, npoints)
    weights: Any  # (npoints,): volumes of the quadrature points
    gradient_weights: Any

    @abstractmethod
    def gradient(self, u: Floats) -> Floats: ...

    @abstractmethod
    def gradient_at_points(self, u: Floats) -> Floats: ...

    @abstractmethod
    def mean(self, values: Floats) -> Floats: ...

    # of an element, or of a face, at barycentric coordinates (4, ...) or (3, ...)
    @abstractmethod
    def functions(self, barycentric: Floats) -> Floats: ...

    @abstractmethod
    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats: ...

    # The next two return (k, nelements), for arguments as `gradient`.
    @abstractmethod
    def against_gradients(self, flux: Floats) -> Floats: ...

    @abstractmethod
    def against_slopes(self, size: Floats) -> Floats: ...

    @abstractmethod
    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced: ...

    def at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return np.sum(self.functions(barycentric) * u[self.unknowns[:, element]], axis=0)

    def barycentric(self, x: Floats, element: Ints) -> Floats:
        middle = self.mesh.p[:, self.mesh.t[:, element]].mean(axis=1)
        return 0.25 + np.einsum("cin,cn->in", self.hats[:, :, element], x - middle)

    def load_at(self, x: Floats, element: Ints, vectors: Floats) -> Floats:
        # as `Higher.load_at`: the projection of the vectors onto linear functions, which gradients are
        moments = self.barycentric(x, element)[:, None] * vectors
        sums = np.stack([np.bincount(element, each, self.volumes.size) for each in moments.reshape(12, -1)])
        sums = sums.reshape(4, 3, -1)
        nodal = 20.0 / self.volumes * (sums - 0.2 * sums.sum(axis=0))
        return np.einsum("in,icn->cn", self.barycentric(self.points, self.element), nodal[:, :, self.element])

    def slope_of_corners(self, values: Floats) -> Floats:
        return np.einsum("ik,cik->ck", values[self.mesh.t], self.hats)[:, self.element]


class LinearTetrahedra(LinearFunctions, Tetrahedra):
    # one quadrature point, or four if a field varies inside
    order, edges = 1, tuple(EDGES)

    def __init__(self, mesh: MeshTet, varies: bool = False) -> None:
        self.mesh = self.corners = mesh
        self.unknowns, self.doflocs = mesh.t, mesh.p
        corners = mesh.p[:, mesh.t]
        inside = inner_points(corners) if varies else corners.mean(axis=1, keepdims=True)
        self.points = inside.reshape(3, -1)
        self.element = np.tile(np.arange(mesh.t.shape[1]), inside.shape[1])

    @property
    def gradient_weights(self) -> Floats:
        return self.volumes

    @property
    def weights(self) -> Floats:
        return (self.volumes * (self.volumes.size / self.element.size))[self.element]

    def mean(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.volumes.size).mean(axis=-2)

    def gradient_at_points(self, u: Floats) -> Floats:
        return self.gradient(u)[:, self.element]

    def functions(self, barycentric: Floats) -> Floats:
        return barycentric

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return self.gradient(u)[:, element]


@dataclass(frozen=True)
class Group:
    rows: Ints  # (m,): elements with one quadrature rule
    columns: slice  # of the quadrature points, which have shape (q, m)
    barycentric: Floats  # (q, 4)
    weights: Floats  # (q,), with sum 1
    has_law: bool

    def restrict(self, values: Floats) -> Floats:
        own = values[..., self.columns]
        return own.reshape(*own.shape[:-1], self.weights.size, self.rows.size)

    @property
    def slopes(self) -> Floats:
        return slopes(self.barycentric)

    @property
    def products(self) -> Floats:
        # (55 pairs of functions, 10 pairs of coordinates, q), summed over the points without a law
        (i, j), (a, b), weighted = PAIRS, METRIC, self.slopes * self.weights[:, None, None]
        ahead, back = (
            np.einsum("qpa,qpa->paq", weighted[:, i][:, :, one], self.slopes[:, j][:, :, other])
            for one, other in ((a, b), (b, a))
        )
        both = np.where((a == b)[:, None], ahead, ahead + back)
        return both if self.has_law else both.sum(axis=2, keepdims=True)


class QuadraticTetrahedra(Tetrahedra):
    # the unknowns of `skfem.ElementTetP2`, nodes before edges
    order = 2

    def __init__(self, mesh: MeshTet, nonlinear: Mask) -> None:
        number_edges(mesh)
        self.mesh = self.corners = mesh
        self.unknowns = np.vstack((mesh.t, mesh.p.shape[1] + mesh.t2e))
        self.doflocs = np.hstack((mesh.p, mesh.p[:, mesh.edges].mean(axis=1)))
        self.volumes, self._groups = area(mesh), groups_of(nonlinear)
        corners = mesh.p[:, mesh.t]
        self.points, self.weights, self.element = (
            np.concatenate(parts, axis=-1)
            for parts in zip(*((
                np.einsum("qi,cim->cqm", each.barycentric, corners[:, :, each.rows]).reshape(3, -1),
                np.outer(each.weights, self.volumes[each.rows]).ravel(),
                np.tile(each.rows, each.weights.size),
            ) for each in self._groups), strict=True)
        )  # fmt: skip

    @property
    def gradient_weights(self) -> Floats:
        return self.weights

    def on_facets(self, facets: Ints) -> Ints:
        corners = np.sort(self.mesh.facets[:, facets], axis=0)
        edges = edges_between(self.mesh, *corners[FACE_EDGES])
        return np.vstack((corners, self.mesh.p.shape[1] + edges))

    def gradient(self, u: Floats) -> Floats:
        local, found = u[self.unknowns], []
        for group in self._groups:
            along = np.tensordot(group.slopes, local[:, group.rows], (1, 0))
            found.append(np.einsum("qam,cam->cqm", along, self.hats[:, :, group.rows]).reshape(3, -1))
        return np.concatenate(found, axis=1)

    def gradient_at_points(self, u: Floats) -> Floats:
        return self.gradient(u)

    def mean(self, values: Floats) -> Floats:
        return self._by_element(
            [np.tensordot(group.restrict(values), group.weights, (-2, 0)) for group in self._groups]
        )

    def functions(self, barycentric: Floats) -> Floats:
        start, end = EDGES if len(barycentric) == 4 else FACE_EDGES
        return np.vstack((barycentric * (2.0 * barycentric - 1.0), 4.0 * barycentric[start] * barycentric[end]))

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        local, (start, end), nodes = u[self.unknowns[:, element]], EDGES, slice(4)
        along = (4.0 * barycentric - 1.0) * local[nodes]
        for row, one, other in zip(local[4:], start, end, strict=True):
            along[one] += 4.0 * barycentric[other] * row
            along[other] += 4.0 * barycentric[one] * row
        return np.einsum("in,cin->cn", along, self.hats[:, :, element])

    def against_gradients(self, flux: Floats) -> Floats:
        found = []
        for group in self._groups:
            weighted = group.restrict(flux * self.weights)
            along = np.einsum("cqm,cam->qam", weighted, self.hats[:, :, group.rows])
            found.append(np.tensordot(group.slopes, along, ((0, 2), (0, 1))))
        return self._by_element(found)

    def against_slopes(self, size: Floats) -> Floats:
        found, lengths = [], magnitude(self.hats)
        for group in self._groups:
            along = group.restrict(size * self.weights)[:, None] * lengths[:, group.rows]
            found.append(np.tensordot(np.abs(group.slopes), along, ((0, 2), (0, 1))))
        return self._by_element(found)

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        index = np.full(self.doflocs.shape[1], -1, dtype=np.int32)
        index[free] = np.arange(free.size)
        products, (i, j) = self._products(across, along), PAIRS
        on_diagonal = np.bincount(self.unknowns.ravel(), products[i == j].ravel(), index.size)[free]
        start, end = index[self.unknowns[i[i != j]]], index[self.unknowns[j[i != j]]]
        inner = (start >= 0) & (end >= 0)
        values, start, end, diagonal = products[i != j][inner], start[inner], end[inner], index[free]
        values = np.concatenate((values, values, on_diagonal))
        indices = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        matrix = coo_array((values, indices), shape=(free.size, free.size)).tocsc()
        return Reduced(matrix, prolongation=self._from_corners(index))

    def _products(self, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:
        found, (a, b) = [], METRIC
        for group in self._groups:
            count = group.weights.size if group.has_law else 1
            reference, own = group.products.reshape(len(PAIRS[0]), -1), np.empty((len(PAIRS[0]), group.rows.size))
            coefficient = group.restrict(across)[:count]
            for first in range(0, group.rows.size, CHUNK):
                part = slice(first, first + CHUNK)
                hats, volume = self.hats[:, :, group.rows[part]], self.volumes[group.rows[part]]
                metric = np.einsum("cpm,cpm->pm", hats[:, a], hats[:, b])[:, None] * coefficient[:, part]
                if along is not None and group.has_law:
                    more = group.restrict(along[0])[:, part] - coefficient[:, part]
                    slope = np.einsum("cqm,cam->aqm", group.restrict(along[1])[:, :, part], hats)
                    metric += more * slope[a] * slope[b]
                own[:, part] = reference @ (metric * volume).reshape(reference.shape[1], -1)
            found.append(own)
        return self._by_element(found)

    def _from_corners(self, index: Ints) -> csr_array:
        # (nfree, free nodes): functions of order 1 by their values at the unknowns
        nnodes, (start, end) = self.mesh.p.shape[1], self.mesh.edges
        row = np.concatenate((index[:nnodes], index[nnodes:], index[nnodes:]))
        node = index[np.concatenate((np.arange(nnodes), start, end))]
        value, inner = np.repeat([1.0, 0.5], [nnodes, 2 * start.size]), (row >= 0) & (node >= 0)
        shape = np.count_nonzero(index >= 0), np.count_nonzero(index[:nnodes] >= 0)
        return coo_array((value[inner], (row[inner], node[inner])), shape=shape).tocsr()

    def _by_element(self, found: Sequence[Floats]) -> Floats:
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.volumes.size))
        for group, values in zip(self._groups, found, strict=True):
            whole[..., group.rows] = values
        return whole


def tetrahedra_on(mesh: MeshTet, order: int, varies: bool, nonlinear: Mask) -> Tetrahedra:
    return LinearTetrahedra(mesh, varies) if order == 1 else QuadraticTetrahedra(mesh, nonlinear)


@cache
def _slopes_at(barycentric: bytes) -> Floats:
    at, (start, end) = np.frombuffer(barycentric).reshape(-1, 4), EDGES
    found = np.zeros((len(at), 10, 4))
    found[:, range(4), range(4)] = 4.0 * at - 1.0
    found[:, range(4, 10), start], found[:, range(4, 10), end] = 4.0 * at[:, end], 4.0 * at[:, start]
    return found


def slopes(barycentric: Floats) -> Floats:
    # derivatives by the barycentric coordinates, (q, 10, 4), at points (q, 4)
    return _slopes_at(np.ascontiguousarray(barycentric).tobytes())


def groups_of(nonlinear: Mask) -> list[Group]:
    groups, first = list[Group](), 0
    for has_law, degree in ((False, DEGREE), (True, LAW_DEGREE_IN_SPACE)):
        rows, (barycentric, weights) = np.flatnonzero(nonlinear == has_law), tetrahedron_rule(degree)
        if rows.size:
            columns = slice(first, first + rows.size * weights.size)
            groups.append(Group(rows, columns, barycentric, weights, has_law))
            first = columns.stop
    return groups
