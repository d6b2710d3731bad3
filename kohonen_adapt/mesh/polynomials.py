"""Write functions of order 1 to 3 by values at nodes and coefficients of sides and elements; evaluate them."""

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np
from skfem import ElementTriP1, ElementTriP2, ElementTriP3, ElementTriP4, Mesh, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import Modes, Points, Reference
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.near_axis import ON_AXIS, factor_at, falling, points_near_axis

__all__ = [
    "HAT_SLOPES",
    "KINDS",
    "LINEAR_FUNCTIONS",
    "AxisReference",
    "TrialFunction",
    "axis_reference",
    "by_points",
    "count_unknowns",
    "evaluated",
    "facet_functions",
    "facet_products",
    "facets_of_sides",
    "fields_at",
    "functions_at",
    "functions_near_axis",
    "gradients",
    "local_coefficients",
    "modes_of",
    "places_on_sides",
    "reference",
    "set_bubbles",
    "set_sides",
    "slopes_at",
    "slopes_near_axis",
    "trace_columns",
    "traces_at",
]

EVEN, ODD, BUBBLE = 4.0, 13.5, 27.0  # times products of the linear functions; see `Reference`
SIDES = slice(3, None)  # of the functions of order 2
KINDS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}  # of scikit-fem, by order
HAT_SLOPES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


class AxisReference(NamedTuple):
    """What `Reference` has, of functions that fall off towards an axis, by kind of element: see `near_axis`."""

    slope: Floats  # (7, points, functions, 2): gradients
    weight: Floats  # (7, points): 1 in sum
    share: Floats  # (7, points, 3): barycentric coordinates
    mean: Floats  # (7, functions): integrals

    def of(self, kind: int) -> Reference:
        """That of elements of one kind."""
        return Reference(self.slope[kind], self.weight[kind], self.mean[kind], np.empty((0, 0, 0)))


class TrialFunction(NamedTuple):
    """A function on a mesh: values at the nodes, which of them are given, and of order 2 and 3 its other unknowns."""

    values: Floats  # (n,)
    fixed: Mask  # (n,)
    modes: Modes | None
    dual: "TrialFunction | None" = None  # that of a goal

    def copy(self) -> "TrialFunction":
        """The function, for sweeps to change."""
        modes = self.modes and Modes(*(array.copy() for array in self.modes))
        return TrialFunction(self.values.copy(), self.fixed.copy(), modes, self.dual and self.dual.copy())

    @property
    def all_modes(self) -> tuple[Modes, ...]:
        """Its modes, and those of its dual; none of order 1."""
        return tuple(one.modes for one in (self, self.dual) if one is not None and one.modes is not None)

    def restore(self, values: "TrialFunction") -> None:
        """Take back the values at the nodes that a copy has."""
        self.values[:] = values.values
        if self.dual is not None and values.dual is not None:
            self.dual.restore(values.dual)


def count_unknowns(mesh: Mesh, order: int) -> int:
    """Number of unknowns of scikit-fem's `ElementTriP1`, `P2`, `P3` or `P4`: of nodes, then facets, then elements.

    Of tetrahedra those of nodes, edges, faces and elements, as of `ElementTetP1` and `P2`.
    """
    nodes = int(mesh.nvertices)
    if order == 1:
        return nodes
    number_facets(mesh)
    parts = (mesh.facets, mesh.t) if cell_of(mesh) is TRIANGLE else (mesh.edges, mesh.facets, mesh.t)
    return nodes + sum(comb(order - 1, k) * part.shape[1] for k, part in enumerate(parts, start=1))


def functions_at(share: Floats, order: int) -> Floats:
    """Values of the functions of `Reference`, (n, functions), at barycentric coordinates (n, 3)."""
    product, rise = share[:, AFTER] * share[:, BEFORE], share[:, BEFORE] - share[:, AFTER]
    parts = [share, EVEN * product, ODD * product * rise, BUBBLE * np.prod(share, axis=1, keepdims=True)]
    return np.hstack(parts[: (1, 2, 4)[order - 1]])


def slopes_at(share: Floats, order: int) -> Floats:
    """Gradients of the same on the reference triangle, (n, functions, 2)."""
    left, right, rise = share[:, AFTER, None], share[:, BEFORE, None], (share[:, BEFORE] - share[:, AFTER])[..., None]
    product = left * HAT_SLOPES[BEFORE] + right * HAT_SLOPES[AFTER]
    odd = rise * product + left * right * (HAT_SLOPES[BEFORE] - HAT_SLOPES[AFTER])
    bubble = np.sum(left * right * HAT_SLOPES, axis=1, keepdims=True)
    parts = [np.broadcast_to(HAT_SLOPES, product.shape), EVEN * product, ODD * odd, BUBBLE * bubble]
    return np.hstack(parts[: (1, 2, 4)[order - 1]])


@cache
def reference(order: int, degree: int) -> Reference:
    """The functions of that order, and points at which polynomials of that degree are integrated exactly."""
    points, weights = get_quadrature(ElementTriP1, degree)
    share = np.stack([1.0 - points.sum(axis=0), *points], axis=1)
    mean = [*[1.0 / 6.0] * 3, *[EVEN / 24.0] * 3, 0.0, 0.0, 0.0, BUBBLE / 120.0]
    slope = np.ascontiguousarray(slopes_at(share, order))
    return Reference(slope, 2.0 * weights, np.array(mean[: slope.shape[1]]), halves(order))


def functions_near_axis(kind: Ints, share: Floats, order: int) -> Floats:
    """Values of the functions of elements of these kinds (n,), (n, functions), at barycentric coordinates (n, 3)."""
    return np.where(falling(order)[kind], factor_at(kind, share)[:, None], 1.0) * functions_at(share, order)


def slopes_near_axis(kind: int, share: Floats, order: int) -> Floats:
    """Gradients on the reference triangle of the functions of elements of one kind, (n, functions, 2)."""
    falls, factor = falling(order)[kind][:, None], factor_at(np.array(kind), share)[:, None, None]
    fall = functions_at(share, order)[..., None] * (ON_AXIS[kind] @ HAT_SLOPES)
    plain = slopes_at(share, order)
    return np.where(falls, factor * plain - fall, plain)


@cache
def axis_reference(order: int) -> AxisReference:
    """The functions of that order around an axis x = 0, and points at which ``|grad u|^2 / x`` is integrated."""
    (share, weight), kinds = points_near_axis(order), range(len(ON_AXIS))
    points, weights = get_quadrature(ElementTriP1, order + 1)
    exact = np.stack([1.0 - points.sum(axis=0), *points], axis=1)
    mean = [weights @ functions_near_axis(np.full(len(exact), kind), exact, order) for kind in kinds]
    slope = np.stack([slopes_near_axis(kind, share[kind], order) for kind in kinds])
    return AxisReference(slope, weight, share, np.stack(mean))


def halves(order: int) -> Floats:
    """What the coefficients of a function are on the triangles (p, 0, 1) and (p, 2, 0), p in the middle of 1 and 2."""
    steps = np.array([(i, j, order - i - j) for i in range(order + 1) for j in range(order + 1 - i)]) / order
    corner = np.array([[0.0, 0.5, 0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    here = functions_at(steps, order)
    parts = [np.linalg.solve(here, functions_at(steps @ corner[rows], order)) for rows in ([0, 1, 2], [0, 3, 1])]
    return np.stack(parts)


def facets_of_sides(mesh: MeshTri, node: Ints) -> Ints:
    """The facet opposite to every corner of the elements (m, 3) of a mesh, whose corners may stand in another order."""
    number_facets(mesh)
    opposite = mesh.t2f[AFTER].T  # scikit-fem's sides join the local nodes (0, 1), (1, 2), (0, 2)
    same = np.asarray(node)[:, :, None] == mesh.t.T[:, None, :]
    return np.einsum("mkc,mc->mk", same, opposite)


def modes_of(
    mesh: MeshTri, node: Ints, values: Floats, order: int, fixed: Mask | None = None, kind: Ints | None = None
) -> Modes:
    """The coefficients of a function that scikit-fem has by its values (nunknowns,) at the unknowns of that order.

    `fixed` (nunknowns,) says which of these are given: a side is where all of its own are. Around an axis there is the
    `kind` of every element, (m,).
    """
    facet, nodes, facets = facets_of_sides(mesh, node), mesh.nvertices, mesh.facets.shape[1]
    own = values[nodes : nodes + (order - 1) * facets].reshape(facets, order - 1)[facet]  # from the lower node
    given = np.zeros(node.shape, dtype=np.bool_)
    if fixed is not None:
        given = np.all(fixed[nodes : nodes + (order - 1) * facets].reshape(facets, order - 1), axis=1)[facet]
    modes = Modes(np.empty((*node.shape, order - 1)), np.zeros(len(node)), given)
    upward = (node[:, AFTER] < node[:, BEFORE])[..., None]
    set_sides(modes, values[node], np.where(upward, own, own[..., ::-1]), kind)
    if order == 3:
        set_bubbles(modes, values[node], values[nodes + 2 * facets :], kind)
    return modes


def places_on_sides(corners: Floats, order: int) -> Floats:
    """Where sides have values of their own, counter-clockwise, (m, 3, order - 1, 2), for corners (m, 3, 2)."""
    start, end = corners[:, AFTER, None], corners[:, BEFORE, None]
    return start + (np.arange(1, order) / order)[:, None] * (end - start)


def set_sides(modes: Modes, corners: Floats, own: Floats, kind: Ints | None = None) -> None:
    """Set the coefficients of sides from values at the corners (m, 3) and inside the sides, counter-clockwise.

    These are (m, 3, order - 1): at the middle, or at a third and two thirds. Around an axis there is the `kind`, (m,).
    """
    if kind is not None:
        factor = factors_on_sides(own.shape[2] + 1)[kind]
        own = own / np.where(factor > 0.0, factor, 1.0)  # values on the axis are 0
    start, end = corners[:, AFTER], corners[:, BEFORE]
    if own.shape[2] == 1:
        modes.side[..., 0] = own[..., 0] - 0.5 * (start + end)
    else:
        modes.side[..., 0] = 9.0 / 16.0 * (own[..., 0] + own[..., 1] - start - end)
        modes.side[..., 1] = 0.5 * (own[..., 1] - own[..., 0]) - (end - start) / 6.0


@cache
def factors_on_sides(order: int) -> Floats:
    """The factor towards the axis where sides have values of their own, by kind of element, (7, 3, order - 1)."""
    at = np.arange(1, order)[:, None] / order
    share = np.eye(3)[AFTER][:, None] * (1.0 - at) + np.eye(3)[BEFORE][:, None] * at
    return np.stack([factor_at(np.array(kind), share) for kind in range(len(ON_AXIS))])


def set_bubbles(modes: Modes, corners: Floats, middle: Floats, kind: Ints | None = None) -> None:
    """Set the bubbles from values at the corners (m, 3), at the centroids (m,), and what the sides are.

    Around an axis there is the `kind`, (m,).
    """
    if kind is None:
        modes.bubble[:] = middle - corners.mean(axis=1) - 4.0 / 9.0 * modes.side[..., 0].sum(axis=1)
        return
    at, modes.bubble[:] = functions_near_axis(kind, np.full(corners.shape, 1.0 / 3.0), 3), 0.0
    modes.bubble[:] = (middle - np.sum(at * local_coefficients(corners, modes), axis=1)) / at[:, -1]


def local_coefficients(corners: Floats, modes: Modes | None) -> Floats:
    """The coefficients of every element in the order of `Reference`, (m, functions), from values at corners (m, 3)."""
    if modes is None:
        return corners
    sides = [modes.side[..., d] for d in range(modes.side.shape[2])]
    return np.hstack([corners, *sides, *([modes.bubble[:, None]] if len(sides) == 2 else [])])


def traces_at(share: Floats, order: int) -> Floats:
    """Values on a side, at shares (n,) of the way along it, of the functions that do not vanish there, (n, order + 1).

    In the order of `trace_columns`.
    """
    product = share * (1.0 - share)
    functions = 1.0 - share, share, EVEN * product, ODD * product * (2.0 * share - 1.0)
    return np.stack(functions[: order + 1], axis=1)


def trace_columns(k: Ints, order: int) -> Ints:
    """Which functions do not vanish on the sides opposite to corners k (n,), (n, order + 1).

    Those of the corners after and before come first, then the side's own.
    """
    return np.stack([(k + 1) % 3, (k + 2) % 3, *(3 * d + k for d in range(1, order))], axis=1)


def facet_products(order: int) -> Floats:
    """Integrals of products of the functions of a facet of length 1: of both ends, then of those between."""
    powers, functions = np.arange(order + 1), facet_functions(order)
    moments = 1.0 / (powers[:, None] + powers + 1.0)
    return functions.T @ moments @ functions


def facet_functions(order: int) -> Floats:
    """Coefficients of powers of these functions, (order + 1, order + 1), a column for each."""
    at = np.concatenate(([0.0, 1.0], np.arange(1, order) / order))
    return np.linalg.inv(at[:, None] ** np.arange(order + 1))


def gradients(corners: Floats, coefficients: Floats, at: Reference) -> tuple[Floats, Floats]:
    """Doubled signed area (m,), and gradients (2, points, m), for corners (m, 3, 2) and coefficients (m, functions)."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    doubled = ax * by - bx * ay
    along, aside = np.einsum("qic,mi->cqm", at.slope, coefficients)
    return doubled, np.stack([by * along - ay * aside, ax * aside - bx * along]) / doubled


def evaluated(coefficients: Floats, share: Floats, kind: Ints | None = None) -> Floats:
    """Values (n,) at barycentric coordinates (n, 3) of functions with coefficients (n, functions) of their elements.

    Around an axis there is the `kind` of these, (n,).
    """
    order = {3: 1, 6: 2, 10: 3}[coefficients.shape[1]]
    at = functions_at(share, order) if kind is None else functions_near_axis(kind, share, order)
    return np.sum(at * coefficients, axis=1)


LINEAR_FUNCTIONS = reference(1, 0)


@cache
def by_points(order: int) -> Points:
    """The points, and the functions of that order there, of elements of every kind."""
    (share, weight), kinds = points_near_axis(order), range(len(ON_AXIS))
    value = [functions_near_axis(np.full(len(share[kind]), kind), share[kind], order) for kind in kinds]
    slope = [slopes_near_axis(kind, share[kind], order) for kind in kinds]
    even = [functions_at(share[kind], 2)[:, SIDES, None] for kind in kinds]
    sides = [np.concatenate([even[kind], slopes_at(share[kind], 2)[:, SIDES]], axis=2) for kind in kinds]
    return Points(weight, share, np.stack(value), np.stack(slope), np.stack(sides))


def fields_at(
    points: Points, kind: int, corners: Floats, bend: Floats, coefficients: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Elements of one kind at their points: doubled area, x and values (points, m), gradients (2, points, m).

    For corners (m, 3, 2), bends of their sides (m, 3, 2) and coefficients (m, functions).
    """
    side = points.side[kind]
    way = np.einsum("id,mic->mcd", HAT_SLOPES, corners) + np.einsum("qkd,mkc->qmcd", side[:, :, 1:], bend)
    x = points.share[kind] @ corners[:, :, 0].T + side[:, :, 0] @ bend[:, :, 0].T
    along, aside = np.einsum("qid,mi->dqm", points.slope[kind], coefficients)
    (ax, bx), (ay, by) = np.moveaxis(way, (2, 3), (0, 1))
    doubled = ax * by - bx * ay
    slope = np.stack([by * along - ay * aside, ax * aside - bx * along]) / doubled
    return doubled, x, points.value[kind] @ coefficients.T, slope
