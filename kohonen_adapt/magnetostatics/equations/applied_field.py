"""Applied field of currents in a problem with a scalar potential."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial import cKDTree
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.magnetostatics.equations.given_field import (
    FACET_SIGNS,
    AppliedField,
    Sources,
    circulations,
    field_at,
)
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, subdomains_at
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.cells import centroids_of, facet_normals
from kohonen_adapt.mesh.elements.functions import nodes, reference_functions
from kohonen_adapt.mesh.elements.rules import triangle_rule
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import (
    ascending,
    edges_around,
    edges_in,
    keys_of,
    number_edges,
    number_facets,
    numbered,
    summed,
)
from kohonen_adapt.mesh.measures import EDGES, hat_gradients, is_in_front
from kohonen_adapt.mesh.names import connected_components_of

__all__ = [
    "Drive",
    "aligned_potential",
    "drive_on",
    "permeable",
    "total_potential",
]

# Relative permeability above which an element is iron, where a reduced potential would cancel most of the applied
# field.
PERMEABLE = 2.0
LINKED = 0.01  # largest error of circulations along closed paths, relative to the range of the potential in iron
DEGREE = {1: 4} | {order: 2 * order + 3 for order in range(2, 8)}  # of the rule of facets, by order
TOLERANCE = 1e-9  # tolerance of equality, relative to the permeability of vacuum
NO_CURRENT = 0.002  # allowed circulation around a face without current, relative to the integral of |Hs|


@dataclass(frozen=True, eq=False)
class Drive:
    """Prescribed part T of the field strength ``H = T - grad u``.

    T is the applied field Hs outside iron. In iron T = 0, and u is the total potential ``phi + chi`` with ``Hs = -grad
    chi``. In elements that touch iron ``T = Hs + grad chi`` with chi falling to 0 at the next nodes, so that ``u -
    chi`` is the reduced potential phi everywhere.

    If iron links a current, chi has a jump across a layer of elements in iron, in which T is a constant whose integrals
    along edges across the layer are the linked current.

    Because ``mu Hs`` has no divergence where mu is constant, ``int mu Hs . grad v`` is an integral over facets at which
    mu changes, so that no quadrature point lies on a wire inside a region.
    """

    elements: Space
    function: AppliedField | None
    iron: Mask  # (nelements,)
    potential: Floats  # chi at the unknowns, (nunknowns,) in A; 0 away from iron
    load: Floats  # the surface integral for every function v, (nunknowns,) in Wb
    layer: Floats  # T in iron, (3, nelements) in A/m

    def at(self, x: Floats, element: Ints) -> Floats:
        return self._at(x, np.arange(x.shape[1]), element)

    def _at(self, x: Floats, point: Ints, element: Ints) -> Floats:
        # at the columns `point` of `x`, each evaluated once
        if self.function is None:
            return np.zeros((3, point.size))
        outside = np.flatnonzero(~self.iron[element])
        values, point, element = self.layer[:, element], point[outside], element[outside]
        offset = self.elements.gradient_at(self.potential, element, self.elements.barycentric(x[:, point], element))
        values[:, outside] = self._given(x, point, element) + offset
        return values

    def _given(self, x: Floats, point: Ints, element: Ints) -> Floats:
        # the field without chi
        used, row = np.unique(point, return_inverse=True)
        return field_at(self.sources, x[:, used])[:, row]

    @cached_property
    def at_corners(self) -> Floats:
        mesh = self.elements.corners
        return self._at(mesh.p, mesh.t.ravel(), np.tile(np.arange(self.iron.size), len(mesh.t)))

    @cached_property
    def at_points(self) -> Floats:
        return self.at(self.elements.points, self.elements.element)

    @cached_property
    def current_density(self) -> Floats:
        # Largest ``|curl Hs . n|`` on the faces of elements, (nelements,) in A/m^2.
        return _current_density(self.elements.corners, self.function)

    @property
    def sources(self) -> "Sources":
        return self.function if isinstance(self.function, Sources) else Sources({}, self.function)

    @cached_property
    def current_density_without_coils(self) -> Floats:
        coils, applied = self.sources.coils, self.sources.applied
        return _current_density(self.elements.corners, applied) if coils else self.current_density

    @cached_property
    def inside(self) -> Floats:
        """Part of T that `load` does not cover, as `Space.gradient` in A/m."""
        offset, elements = self.elements.gradient(self.potential), self.elements
        element = slice(None) if elements.order == 1 else elements.element
        return np.where(self.iron[element], self.layer[:, element], offset)

    @property
    def inside_at_points(self) -> Floats:
        return self.inside[:, self.elements.element] if self.elements.order == 1 else self.inside


def permeable(coefficients: Coefficients) -> Mask:
    return (coefficients.reluctivity * VACUUM_PERMEABILITY < 1.0 / PERMEABLE) | coefficients.nonlinear


def drive_on(
    mesh: MeshTet,
    coefficients: Coefficients,
    function: AppliedField | None,
    closed: Ints,
    order: int,
    known: Drive | None = None,
) -> Drive:
    # `known` is of another order on the same nodes, where chi is the same.
    elements = Space(mesh, order, coefficients.nonlinear, varies=function is not None)
    mesh, zeros = elements.corners, np.zeros(elements.doflocs.shape[1])
    iron = permeable(coefficients)
    if function is None:
        return Drive(elements, None, np.zeros_like(iron), zeros, zeros, np.zeros((3, iron.size)))
    load = _flux_out(elements, np.where(iron, 0.0, 1.0 / coefficients.reluctivity), function, closed)
    if known is None:
        along, _ = circulations(mesh.p, edges_in(mesh, iron), function)
        at_nodes, layer = total_potential(mesh, iron, along)
    else:
        at_nodes, layer = known.potential[: mesh.nvertices], known.layer
    chi = _at_unknowns(elements, at_nodes, iron, function)
    return Drive(elements, function, iron, chi, load, layer)


def _flux_out(elements: Space, permeability: Floats, function: AppliedField, closed: Ints) -> Floats:
    """Return ``int mu Hs . n v`` over surfaces of elements, (nunknowns,) in Wb.

    Facets `closed` are left out; v are the functions of the elements.
    """
    mesh, order = elements.corners, elements.order
    number_facets(mesh)
    first, second = mesh.f2t
    jump = permeability[first] - np.append(permeability, 0.0)[second]  # second is -1 at the outer boundary
    surface = np.setdiff1d(np.flatnonzero(np.abs(jump) > TOLERANCE * VACUUM_PERMEABILITY), closed)
    jump[~is_in_front(mesh.p[:, mesh.facets], centroids_of(mesh, first))] *= -1.0
    load, unknowns = np.zeros(elements.doflocs.shape[1]), elements.on_facets(surface)
    for barycentric, weight in zip(*triangle_rule(DEGREE[order]), strict=True):
        x, normal = elements.facet_points(surface, barycentric)
        flux = 0.5 * weight * jump[surface] * np.sum(normal * field_at(function, x), axis=0)
        terms = reference_functions(barycentric[None], order)[0] * flux
        load += summed(unknowns, terms, load.size)
    size = np.abs(load)  # the sum is the flux out of closed surfaces, which is 0 but for the error of the quadrature
    return load - size * (load.sum() / size.sum()) if size.any() else load


def _at_unknowns(elements: Space, chi: Floats, iron: Mask, function: AppliedField) -> Floats:
    if elements.order == 1:
        return chi
    # A mean over the corners of an element, because T is constant there.
    unknowns, at = elements.unknowns[:, iron], nodes(elements.order, elements.dim, elements.arcs)
    node, first = np.unique(unknowns, return_index=True)
    local, element = np.divmod(first, unknowns.shape[1])
    corners, share = elements.corners.t[:, iron][:, element], at[local].T
    used = (share > 0.0) & (node >= chi.size)
    along = np.zeros(share.shape)
    along[used] = circulations(elements.doflocs, np.stack([corners[used], np.tile(node, (4, 1))[used]]), function)[0]
    values = np.zeros(elements.doflocs.shape[1])
    values[: chi.size] = chi
    values[node] = np.sum(share * (chi[corners] - along), axis=0)
    return values


def total_potential(mesh: MeshTet, iron: Mask, along: Floats) -> FloatsPair:
    """Return chi with ``Hs = -grad chi + T`` in iron and 0 elsewhere, and T.

    `along` has the circulations of Hs along the edges of iron. chi, shape (nnodes,), is integrated along a tree that
    spans the edges of every piece of iron, from 0 at its first node. Edges outside the tree close paths. A circulation
    of Hs along an edge of this kind means that the path links a current. T, shape (3, nelements), has these
    circulations.
    """
    (lower, upper), nnodes = edges_in(mesh, iron), mesh.nvertices
    component = connected_components_of(nnodes, np.stack((lower, upper), axis=1))
    roots = lower[np.unique(component[lower], return_index=True)[1]]
    # One search from a further node that is joined to all roots.
    ends = np.append(lower, np.full(roots.size, nnodes)), np.append(upper, roots)
    graph = coo_array((np.ones(ends[0].size, np.int8), ends), shape=(nnodes + 1,) * 2).tocsr()
    order, predecessor = breadth_first_order(graph, nnodes, directed=False)
    end, chi = order[1 + roots.size :], np.zeros(nnodes)
    start = predecessor[end]
    row = np.searchsorted(keys_of(np.stack((lower, upper)), nnodes), keys_of(ascending(start, end), nnodes))
    drop = np.where(start < end, along[row], -along[row])
    for node, previous, difference in zip(end.tolist(), start.tolist(), drop.tolist(), strict=True):
        chi[node] = chi[previous] - difference
    linked = _linked_currents(along - (chi[lower] - chi[upper]), chi, component, lower)
    return chi, _layer(mesh, np.flatnonzero(iron), linked)


def _current_density(mesh: MeshTet, function: AppliedField | None) -> Floats:
    if function is None:
        return np.zeros(mesh.nelements)
    number_edges(mesh)
    sides, (circulation, absolute) = edges_around(mesh, slice(None)), circulations(mesh.p, mesh.edges, function)
    total = np.abs(FACET_SIGNS @ circulation[sides])
    total[total <= NO_CURRENT * absolute[sides].sum(axis=0)] = 0.0
    size = 0.5 * np.linalg.norm(facet_normals(mesh, slice(None)), axis=0)
    return np.max((total / size)[mesh.t2f], axis=0)


def aligned_potential(drive: Drive, before: Drive) -> Floats:
    # chi is known up to a constant in every piece of iron, and values that are carried to another mesh need the same.
    mesh, old, chi = drive.elements.corners, before.elements.corners, drive.potential.copy()
    nodes, corners = np.unique(old.t[:, before.iron]), np.unique(mesh.t[:, drive.iron])
    if drive.function is None or not corners.size:
        return chi
    component = connected_components_of(chi.size, edges_in(mesh, drive.iron).T)
    distance, nearest = cKDTree(old.p[:, nodes].T).query(mesh.p[:, corners].T)
    unknowns = drive.elements.unknowns[:, drive.iron]
    for piece in np.unique(component[corners]):
        own = np.flatnonzero(component[corners] == piece)
        first = own[np.argmin(distance[own])]
        node, start = corners[first], nodes[nearest[first]]
        way = np.stack((old.p[:, start], mesh.p[:, node]), axis=1)
        drop, _ = circulations(way, np.array([[0], [1]]), drive.function)
        rows = np.unique(unknowns[:, component[unknowns[0]] == piece])
        chi[rows] += before.potential[start] - drop[0] - drive.potential[node]
    return chi


def _linked_currents(circulation: Floats, chi: Floats, component: Ints, node: Ints) -> Floats:
    # The circulations without their quadrature error, (nedges,): equal ones exactly equal, small ones 0.
    order = np.argsort(component, kind="stable")
    first = np.unique(component[order], return_index=True)[1]
    highest, lowest = (extreme.reduceat(chi[order], first) for extreme in (np.maximum, np.minimum))
    rows = np.flatnonzero(np.abs(circulation) > LINKED * (highest - lowest)[component[node]])
    rows = rows[np.argsort(np.abs(circulation[rows]), kind="stable")]
    size, linked = np.abs(circulation[rows]), np.zeros_like(circulation)
    group = np.cumsum(np.diff(size, prepend=0.0) > LINKED * size)
    mean = np.bincount(group, size) / np.maximum(np.bincount(group), 1)
    linked[rows] = np.sign(circulation[rows]) * mean[group]
    return linked


def _layer(mesh: MeshTet, rows: Ints, circulation: Floats) -> Floats:
    # of circulations along the edges of the elements `rows`
    layer = np.zeros((3, mesh.nelements))
    if not circulation.any():
        return layer
    start, end = EDGES
    t, edge = mesh.t[:, rows], numbered(mesh.t2e[:, rows].ravel()).reshape(6, -1)
    along = np.where(t[start] < t[end], circulation[edge], -circulation[edge])
    rise = np.zeros(t.shape)
    rise[end[start == 0]] = along[start == 0]
    through = np.abs(along - (rise[end] - rise[start])).max(axis=0)
    worst = int(np.argmax(through))
    if through[worst] > LINKED * np.abs(circulation).max():
        raise ValueError(
            f"a current of {through[worst]:.4g} A of the applied_field passes through iron, in an element of "
            f"{subdomains_at(mesh, rows[[worst]])}; keep currents out of iron."
        )
    layer[:, rows] = np.einsum("ik,cik->ck", rise, hat_gradients(mesh)[:, :, rows])
    return layer
