"""Boundary conditions of the unknowns on a mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csc_array
from skfem import MeshTri

from kohonen_adapt.arrays import DataFunction, Floats, Ints, Mask
from kohonen_adapt.checks import finite_values
from kohonen_adapt.geometry.circles import fitted_sphere
from kohonen_adapt.geometry.plane.pairs import Unmatched, image_nodes
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.elements.assembly import assembled
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.names import connected_components_of, named, named_sets, nodes_of_points, outer_facets_of

__all__ = ["Conditions", "Value", "circle_of", "conditions_of", "fixed_values", "ties_of"]

CONTRADICTION = 1e-9  # allowed difference of values at tied nodes, relative to the largest fixed value
ROUND = 1e-3  # allowed distance of nodes of an open boundary from the circle, relative to the radius

Value = float | DataFunction


@dataclass(frozen=True)
class OpenBoundary:
    """Energy ``u . matrix u / 2 - load . u`` beyond an open boundary."""

    matrix: csc_array  # (nunknowns, nunknowns)
    load: Floats  # (nunknowns,), of an applied field

    def energy(self, u: Floats) -> tuple[float, float]:
        stored, spent = 0.5 * float(u @ (self.matrix @ u)), float(self.load @ u)
        return stored - spent, stored + abs(spent)

    def gradient(self, u: Floats) -> Floats:
        return self.matrix @ u - self.load


@dataclass(frozen=True)
class Ties:
    """Unknowns that are equal up to a sign, ``u[i] = sign[i] u[master[i]]``."""

    master: Ints  # (nunknowns,): representative of each class of tied unknowns
    sign: Floats  # (nunknowns,): 1.0 or -1.0
    zero: Mask  # (nunknowns,): classes with u = -u, so that u = 0
    tied: Mask  # (nunknowns,): unknowns on paired sides
    facets: tuple[Ints, Ints, Floats]  # (f,) each: tied facets, their images, and the sign between both


@dataclass(frozen=True)
class Conditions:
    fixed: Mask  # (nunknowns,): unknowns with prescribed values
    values: Floats  # (nunknowns,): the prescribed values, zero elsewhere
    free: Ints  # (nfree,): unknowns without prescribed values
    open_boundary: OpenBoundary | None = None
    join: csc_array | None = None  # (nfree, nclasses): free unknowns from classes, None without ties
    ties: Ties | None = None

    @property
    def fixed_or_tied(self) -> Mask:
        return self.fixed if self.ties is None else self.fixed | self.ties.tied

    def on(self, rows: Ints) -> "Conditions":
        join = None
        if self.join is not None:
            join = self.join.tocsr()[rows]
            join = join[:, np.unique(join.indices)].tocsc()
        return replace(self, free=self.free[rows], join=join)

    def reduced(self, matrix: csc_array, right: Floats) -> tuple[csc_array, Floats]:
        if self.open_boundary is not None:
            matrix = (matrix + self.open_boundary.matrix[self.free][:, self.free]).tocsc()
        if self.join is not None:
            matrix = (self.join.T @ matrix @ self.join).tocsc()
        return matrix, self.to_classes(right)

    def to_classes(self, gradient: Floats) -> Floats:
        return gradient if self.join is None else self.join.T @ gradient

    def admissible(self, values: Floats) -> Floats:
        if self.ties is not None:
            values = self.ties.sign * np.where(self.fixed, self.values, values)[self.ties.master]
        return np.where(self.fixed, self.values, values)


def conditions_of(elements: Space, given: Any, symmetry: Symmetry, anchored: bool = False) -> Conditions:
    """Return the conditions of the arguments of a plane problem."""
    fixed, values = fixed_values(elements, given.potential, given.points)
    values, axis = symmetry.unknown(elements.doflocs, values), symmetry.on_axis(elements.doflocs)
    fixed, values = fixed | axis, np.where(axis, 0.0, values)
    open_boundary = None
    if given.open_boundary is not None:
        open_boundary = open_boundary_of(elements, given.open_boundary, symmetry, given.applied_field)
    ties = None
    if given.periodic or given.antiperiodic:
        ties = ties_of(elements, given.periodic, given.antiperiodic)
        fixed, values = _values_on_ties(elements.doflocs, ties, fixed, values)
    found = Conditions(fixed, values, np.flatnonzero(~fixed), open_boundary, None, ties)
    if not anchored:
        check_anchored(elements.corners, found)
    if ties is None:
        return found
    masters, column = np.unique(ties.master[found.free], return_inverse=True)
    entries = ties.sign[found.free], (np.arange(column.size), column)
    return replace(found, join=csc_array(entries, shape=(column.size, masters.size)))


def open_boundary_of(
    elements: Space, name: str, symmetry: Symmetry, applied_field: tuple[float, float]
) -> OpenBoundary:
    """Return the condition ``nu' du/dn + nu' u / R0 = d nu' u0 / R0`` on a boundary.

    Outside a circle the potential of a dipole falls like 1 / R, so that ``du/dn = -u / R0``. Outside a sphere the
    potential A of a ring falls like sin(theta) / R^2 (Jackson, Classical Electrodynamics, 5.5), so that u = r A also
    falls like 1 / R. The potential u0 of a uniform applied field grows like R^(d - 1) in d dimensions, and u - u0
    falls.
    """
    mesh = elements.corners
    facets = outer_facets_of(mesh, name, f"the open boundary {name!r}")
    centre, size = circle_of(mesh, name)
    applied, dimension = symmetry.uniform(elements.doflocs, centre, applied_field)
    weight = np.full(facets.size, symmetry.extent / (VACUUM_PERMEABILITY * size))
    unknowns, count = elements.on_facets(facets), elements.doflocs.shape[1]
    upper = elements.products_on(facets, weight)[np.triu_indices(len(unknowns))]
    matrix = assembled(unknowns, upper, np.arange(count), count)
    return OpenBoundary(matrix, dimension * VACUUM_PERMEABILITY * (matrix @ applied))


def circle_of(mesh: MeshTri, name: str) -> tuple[Floats, float]:
    x = mesh.p[:, np.unique(mesh.facets[:, np.asarray(mesh.boundaries[name])])]
    centre, fitted = fitted_sphere(x.T)
    distance = np.hypot(*(x - centre[:, None]))
    radius = float(distance.mean())
    if fitted == np.inf or np.ptp(distance) > 2.0 * ROUND * radius:
        raise ValueError(
            f"the open boundary {name!r} must be a circle, or an arc; its nodes are {distance.min():.6g} to "
            f"{distance.max():.6g} m from the best centre. Draw the outer boundary as a circle, or fix A on it."
        )
    return centre, radius


def fixed_values(elements: Space, potential: Mapping[str, Value], points: Mapping[str, Floats]) -> tuple[Mask, Floats]:
    x, mesh = elements.doflocs, elements.corners
    at_points = nodes_of_points(mesh, points)
    fixed, values = np.zeros(x.shape[1], bool), np.zeros(x.shape[1])
    for name, value in potential.items():
        rows = at_points[name] if name in at_points else _on_boundary(elements, name)
        fixed[rows] = True
        values[rows] = finite_values(f"potential of {name!r}", value, x[:, rows], rows.shape)
    return fixed, values


def _on_boundary(elements: Space, name: str) -> Ints:
    try:
        facets = named(elements.corners.boundaries, name, "boundary")
    except ValueError as error:
        inside = name in named_sets(elements.corners.subdomains)
        remedy = (
            "It is a subdomain: name its boundary, too." if inside else "If it is a point, give its position in points."
        )
        raise ValueError(f"{error} {remedy}") from None
    return np.unique(elements.on_facets(facets))


def ties_of(elements: Space, periodic: Sequence[Pair], antiperiodic: Sequence[Pair]) -> Ties:
    mesh, pairs = elements.corners, [*periodic, *antiperiodic]
    try:
        nodes_and_images = image_nodes(mesh, pairs)
    except Unmatched as error:
        raise ValueError(f"{error} In kohonen_adapt.adapt: name the pair as periodic, too, or pin both.") from None
    key, tied, tied_facets = keys_of(ascending(*mesh.facets), mesh.nvertices), [], []
    signs, order = np.repeat([1.0, -1.0], [len(periodic), len(antiperiodic)]), np.argsort(key)
    for (name, *_), (nodes, images), sign in zip(pairs, nodes_and_images, signs, strict=True):
        facets, image = np.asarray(mesh.boundaries[name]), np.arange(mesh.nvertices)
        image[nodes] = images
        ends = image[mesh.facets[:, facets]]
        partners = order[np.searchsorted(key, keys_of(ascending(*ends), mesh.nvertices), sorter=order)]
        inner, inner_image = (elements.on_facets(rows)[2:] for rows in (facets, partners))
        is_reversed = ends[0] != mesh.facets[0, partners]
        inner_image[:, is_reversed] = inner_image[::-1, is_reversed]
        unknowns = np.append(nodes, inner), np.append(images, inner_image)
        tied.append((*unknowns, np.full(unknowns[0].size, sign)))
        tied_facets.append((facets, partners, np.full(facets.size, sign)))
    first, second, relative_sign = map(np.concatenate, zip(*tied, strict=True))
    one, other, of_facet = map(np.concatenate, zip(*tied_facets, strict=True))
    classes = _classes(elements.doflocs.shape[1], first, second, relative_sign)
    return Ties(*classes, np.isin(np.arange(classes[0].size), (first, second)), (one, other, of_facet))


def _classes(count: int, first: Ints, second: Ints, relative_sign: Floats) -> tuple[Ints, Floats, Mask]:
    # Connected components of the unknowns u, as 2 i, and -u, as 2 i + 1.
    negative = relative_sign < 0.0
    pairs = np.concatenate([np.stack((2 * first + k, 2 * second + (negative ^ k)), axis=1) for k in (0, 1)])
    label = connected_components_of(2 * count, pairs)
    lowest = np.unique(label, return_index=True)[1][label[::2]]
    return lowest // 2, np.where(lowest % 2, -1.0, 1.0), np.equal(label[::2], label[1::2])


def _values_on_ties(x: Floats, ties: Ties, fixed: Mask, values: Floats) -> tuple[Mask, Floats]:
    prescribed, class_value, fixed_class = np.flatnonzero(fixed), np.zeros(len(values)), ties.zero.copy()
    master = ties.master[prescribed]
    class_value[master], fixed_class[master] = ties.sign[prescribed] * values[prescribed], True
    all_fixed = fixed_class[ties.master]
    shared = np.where(ties.zero, 0.0, ties.sign * class_value[ties.master])
    difference = np.abs(shared - values)[prescribed]
    if difference.size and difference.max() > CONTRADICTION * np.max(np.abs(values)):
        node = prescribed[np.argmax(difference)]
        raise ValueError(
            f"the potential {values[node]:g} fixed at node {node}, {tuple(x[:, node].tolist())}, contradicts its "
            f"periodic or antiperiodic partner, which makes it {shared[node]:g}. Fix the same value at both, with the "
            "other sign if antiperiodic."
        )
    return all_fixed, np.where(fixed, values, shared)


def check_anchored(mesh: MeshTri, conditions: Conditions) -> None:
    pairs, nodes, ties = mesh.facets.T, mesh.nvertices, conditions.ties
    anchored = conditions.fixed[:nodes].copy()
    if conditions.open_boundary is not None:
        anchored |= conditions.open_boundary.matrix.diagonal()[:nodes] > 0.0
    if ties is not None:
        pairs = np.concatenate((pairs, np.stack((np.arange(nodes), ties.master[:nodes]), axis=1)))
        anchored |= (ties.zero | (ties.sign < 0.0))[:nodes]  # u = -u fixes the constant
    component = connected_components_of(nodes, pairs)
    floating, count = np.setdiff1d(component, component[anchored]), component.max() + 1
    if floating.size:
        node = np.argmax(component == floating[0])
        raise ValueError(
            f"the potential is fixed nowhere on {floating.size} of the {count} connected parts of the mesh, "
            f"first the part of node {node}. Fix it there by the name of a boundary."
        )
