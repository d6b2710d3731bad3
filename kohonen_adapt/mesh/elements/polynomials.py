"""Functions of the kernels, by hierarchical coefficients.

A function is stored by its values at the nodes and by coefficients of side and bubble functions (`Modes`). The basis is
that of `functions.hierarchical`, of order 1 to 3 on triangles, and of order 1 and 2 on tetrahedra, and the records of
kernels are filled from it. scikit-fem uses values at points (Lagrange elements), and `modes_of` and `edge_coefficients`
convert these.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from skfem import MeshTet, MeshTri

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask, copied
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.tetrahedron.arrays import NO_SURFACE
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.kernels.triangle.arrays import Points, Reference
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.elements.functions import ON_AXIS, factor_at, hierarchical, near_axis
from kohonen_adapt.mesh.elements.rules import LAW_DEGREE, SOURCE_DEGREE, points_near_axis, triangle_rule
from kohonen_adapt.mesh.host import edges_between, facets_opposite, number_edges, summed

__all__ = [
    "FIRST",
    "SECOND",
    "TrialFunction",
    "edge_coefficients",
    "evaluated",
    "gradients",
    "hierarchical_loads",
    "local_coefficients",
    "modes_of",
    "places_on_sides",
    "quadrature_points",
    "reference",
    "set_bubbles",
    "set_sides",
    "unknowns_of_elements",
]

SIDES = slice(3, None)  # side functions of order 2
FIRST, SECOND = EDGES[:, 0], EDGES[:, 1]  # corners of the six edges


class TrialFunction(NamedTuple):
    """Function on a mesh with the Dirichlet mask of its unknowns.

    At order 2 and 3, `modes` contains the coefficients of sides and bubbles.
    """

    values: Floats  # (nnodes,)
    fixed: Mask  # (nnodes,)
    modes: Modes | None
    dual: "TrialFunction | None" = None  # dual function of a goal
    surface: Floats = NO_SURFACE  # in space, (nnodes, 2): offset in reduced regions and load

    def copy(self) -> "TrialFunction":
        modes = self.modes and copied(self.modes)
        return TrialFunction(self.values.copy(), self.fixed.copy(), modes, self.dual and self.dual.copy(), self.surface)

    @property
    def affine(self) -> bool:
        """True if the function is affine on every element, as at order 1 in the plane."""
        return self.modes is None

    @property
    def all_modes(self) -> tuple[Modes, ...]:
        return tuple(one.modes for one in (self, self.dual) if one is not None and one.modes is not None)

    def restore(self, before: "TrialFunction") -> None:
        self.values[:] = before.values
        if self.modes is not None and before.modes is not None:
            for array, values in zip(self.modes, before.modes, strict=True):
                array[:] = values
        if self.dual is not None and before.dual is not None:
            self.dual.restore(before.dual)


@cache
def reference(order: int) -> Reference:
    barycentric, weights = triangle_rule(2 * (order - 1))
    slope = _as_rows(hierarchical(barycentric, order)[1])
    products = np.einsum("q,qir,qjs->ijrs", weights, slope, slope)
    both = np.stack([products[..., 0, 0], products[..., 0, 1] + products[..., 1, 0], products[..., 1, 1]], axis=2)
    exact, of_point = triangle_rule(order)
    mean = 0.5 * hierarchical(exact, order)[0] @ of_point
    return Reference(mean, np.einsum("q,qir->ir", weights, slope), both, halves(order))


def _as_rows(parts: Floats) -> Floats:
    # points before functions and contiguous, as in the records of kernels
    return np.ascontiguousarray(np.moveaxis(parts, -1, 0))


def halves(order: int) -> Floats:
    # With the midpoint p of the side between corners 1 and 2, the halves are (p, 0, 1) and (p, 2, 0). Matrices have
    # shape (2, functions, functions).
    steps = np.array([(i, j, order - i - j) for i in range(order + 1) for j in range(order + 1 - i)]) / order
    corner = np.array([[0.0, 0.5, 0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    here = hierarchical(steps, order)[0].T
    parts = [np.linalg.solve(here, hierarchical(steps @ corner[rows], order)[0].T) for rows in ([0, 1, 2], [0, 3, 1])]
    return np.stack(parts)


def modes_of(
    mesh: MeshTri, node: Ints, values: Floats, order: int, fixed: Mask | None = None, kind: Ints | None = None
) -> Modes:
    """Return the coefficients of a function of a scikit-fem element.

    `values` (nunknowns,) are its values at the unknowns of the order. A side is a Dirichlet side if all of its own
    unknowns are `fixed` (nunknowns,).
    """
    facet, nodes, facets = facets_opposite(mesh, node), mesh.nvertices, mesh.nfacets
    own = values[nodes : nodes + (order - 1) * facets].reshape(facets, order - 1)[facet]  # from the lower node index
    dirichlet = np.zeros(node.shape, bool)
    if fixed is not None:
        dirichlet = np.all(fixed[nodes : nodes + (order - 1) * facets].reshape(facets, order - 1), axis=1)[facet]
    modes = Modes(np.empty((*node.shape, order - 1)), np.zeros(len(node)), dirichlet)
    upward = (node[:, AFTER] < node[:, BEFORE])[..., None]
    set_sides(modes, values[node], np.where(upward, own, own[..., ::-1]), kind)
    if order == 3:
        set_bubbles(modes, values[node], values[nodes + 2 * facets :], kind)
    return modes


def places_on_sides(corners: Floats, order: int) -> Floats:
    start, end = corners[:, AFTER, None], corners[:, BEFORE, None]
    return start + (np.arange(1, order) / order)[:, None] * (end - start)


def set_sides(modes: Modes, corners: Floats, own: Floats, kind: Ints | None = None) -> None:
    # `own` (m, 3, order - 1) are values at the midside, or at one and two thirds of each side, counter-clockwise.
    if kind is not None:
        factor = factors_on_sides(own.shape[2] + 1)[kind]
        own = own / np.where(factor > 0.0, factor, 1.0)
    start, end = corners[:, AFTER], corners[:, BEFORE]
    if own.shape[2] == 1:
        modes.side[..., 0] = own[..., 0] - 0.5 * (start + end)
    else:
        modes.side[..., 0] = 9.0 / 16.0 * (own[..., 0] + own[..., 1] - start - end)
        modes.side[..., 1] = 0.5 * (own[..., 1] - own[..., 0]) - (end - start) / 6.0


@cache
def factors_on_sides(order: int) -> Floats:
    at = np.arange(1, order)[:, None] / order
    barycentric = np.eye(3)[AFTER][:, None] * (1.0 - at) + np.eye(3)[BEFORE][:, None] * at
    return np.stack([factor_at(np.array(kind), barycentric) for kind in range(len(ON_AXIS))])


def set_bubbles(modes: Modes, corners: Floats, middle: Floats, kind: Ints | None = None) -> None:
    if kind is None:
        modes.bubble[:] = middle - corners.mean(axis=1) - 4.0 / 9.0 * modes.side[..., 0].sum(axis=1)
        return
    at, modes.bubble[:] = near_axis(np.full(corners.shape, 1.0 / 3.0), 3, kind)[0].T, 0.0
    modes.bubble[:] = (middle - np.sum(at * local_coefficients(corners, modes), axis=1)) / at[:, -1]


def local_coefficients(corners: Floats, modes: Modes | None) -> Floats:
    if modes is None:
        return corners
    sides = [modes.side[..., d] for d in range(modes.side.shape[2])]
    return np.hstack([corners, *sides, *([modes.bubble[:, None]] if len(sides) == 2 else [])])


def gradients(corners: Floats, values: Floats) -> Floats:
    """Return the gradients (2, m) of values (m, 3) at corners (m, 3, 2)."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    along, aside = (values[:, 1:] - values[:, :1]).T
    return np.stack([by * along - ay * aside, ax * aside - bx * along]) / (ax * by - bx * ay)


def evaluated(coefficients: Floats, barycentric: Floats, kind: Ints | None = None) -> Floats:
    order = {3: 1, 6: 2, 10: 3}[coefficients.shape[1]]
    values, _ = near_axis(barycentric, order, 0 if kind is None else kind)
    return np.sum(values.T * coefficients, axis=1)


@cache
def quadrature_points(order: int) -> Points:
    both = [_rules(order, law) for law in (False, True)]
    rules = [[np.concatenate(parts) for parts in zip(*pair, strict=True)] for pair in zip(*both, strict=True)]
    last = np.cumsum([[len(weight) for _, weight in each] for each in both], axis=0, dtype=np.int32).T.copy()
    most, kinds = last.max(), [*range(len(ON_AXIS)), 0, 0]
    share = np.stack([np.pad(at, ((0, most - len(at)), (0, 0)), "edge") for at, _ in rules])
    weight = np.stack([np.pad(weights, (0, most - len(weights))) for _, weights in rules])
    own = [near_axis(at, order, kind) for kind, at in zip(kinds, share, strict=True)]
    value, slope = (np.stack([_as_rows(each) for each in parts]) for parts in zip(*own, strict=True))
    even = [(values[SIDES, None], slopes[SIDES]) for values, slopes in (hierarchical(at, 2) for at in share)]
    sides = np.stack([_as_rows(np.concatenate(parts, axis=1)) for parts in even])
    return Points(last, weight, share, value, slope, sides)


def _rules(order: int, law: bool) -> list[FloatsPair]:
    # by kind of `Points`
    straight = triangle_rule(LAW_DEGREE[order] if law else 2 * (order - 1))
    return [*zip(*points_near_axis(order, law), strict=True), straight, triangle_rule(2 * order + SOURCE_DEGREE)]


# on tetrahedra


def unknowns_of_elements(mesh: MeshTet, node: Ints) -> Ints:
    # unknowns of `ElementTetP2`, (10, m), of elements `node` (4, m)
    return np.vstack([node, mesh.nvertices + edges_between(mesh, node[FIRST], node[SECOND])])


def edge_coefficients(values: Floats) -> Floats:
    # coefficients of elements from their values at the unknowns, (10, m)
    return np.vstack([values[:4], values[4:] - 0.5 * (values[FIRST] + values[SECOND])])


def hierarchical_loads(mesh: MeshTet, load: Floats) -> Floats:
    # `load` by functions of `ElementTetP2`, the result by hierarchical functions, (nunknowns,)
    number_edges(mesh)
    count, found = int(mesh.nvertices), load.copy()
    for end in mesh.edges:
        found[:count] += 0.5 * summed(end, load[count:], count)
    return found
