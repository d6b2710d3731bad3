"""Value of a Ritz functional on triangles and tetrahedra."""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from skfem import ElementTetP1, ElementTriP1, Mesh, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import Points, Reference
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.curved import is_second_order, midside_offsets
from kohonen_adapt.mesh.measures import inner_points
from kohonen_adapt.mesh.near_axis import kinds_at_axis
from kohonen_adapt.mesh.polynomials import (
    by_points,
    exact_reference,
    fields_at,
    functions_at,
    gradients,
    joined_reference,
    law_reference,
    local_coefficients,
    modes_of,
)
from kohonen_adapt.problem.ritz import Ritz, check_fits, parts_of, unknown_in_space
from kohonen_adapt.problem.robin import added_on_sides, sides_of_boundary
from kohonen_adapt.problem.tables import flux_at, flux_table, looked_up, source_at

__all__ = [
    "alike",
    "density_in_space",
    "flux_on",
    "functional_value",
    "integrated",
    "loads_in_space",
    "source_on",
    "source_points",
    "value_in_space",
    "value_on",
]

DEGREE_IN_SPACE = 7  # of the quadrature of a source on tetrahedra; the rule of degree 6 has points on faces


def integrated(ritz: Ritz) -> Reference:
    return joined_reference(ritz.order) if any(ritz.laws) else exact_reference(ritz.order)


def alike(kind: Ints, number: Ints, ritz: Ritz) -> Iterator[tuple[int, bool, Ints]]:
    """Yield kind, True if nonlinear, and rows of the elements with a common rule."""
    lawful = np.zeros(len(number), dtype=np.bool_)
    if ritz.laws and (ritz.order > 1 or ritz.axisymmetric):  # otherwise gradients are constant, and one point suffices
        lawful = np.array([law is not None for law in ritz.laws])[number]
    for one in np.unique(kind):
        for law in (False, True):
            rows = np.flatnonzero((kind == one) & (lawful == law))
            if rows.size:
                yield int(one), law, rows


def functional_value(mesh: Mesh, ritz: Ritz) -> float:
    """Return the functional of the solution on its mesh, the dual included.

    Raises ValueError if the functional belongs to another mesh, or on tetrahedra has terms that are for the plane only.
    """
    if mesh.dim() == TETRAHEDRON.dim:
        if unknown_in_space(ritz):
            raise ValueError(f"Ritz cannot be evaluated on tetrahedra: {unknown_in_space(ritz)}.")
        check_fits(ritz, mesh)
        number = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
        return value_in_space(mesh.p[:, mesh.t], np.asarray(ritz.values)[mesh.t], number, ritz)
    return sum(_value_of_part(mesh, part) for part in parts_of(ritz))


def _value_of_part(mesh: MeshTri, ritz: Ritz) -> float:
    check_fits(ritz, mesh)
    number = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
    values, node = np.asarray(ritz.values), mesh.t.T
    kind = kinds_at_axis(mesh.p[0, node]) if ritz.axisymmetric else None
    modes = None if ritz.order == 1 else modes_of(mesh, node, values, ritz.order, kind=kind)
    corners, coefficients = mesh.p.T[node], local_coefficients(values[node], modes)
    bend = midside_offsets(mesh) if is_second_order(mesh) else None
    total = value_on(corners, coefficients, number, ritz, bend)
    for name, terms in ritz.robin.items():
        sides = sides_of_boundary(mesh, name)
        total += added_on_sides(corners, coefficients, sides, terms, ritz.axisymmetric, bend)
    return total


def value_on(corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, bend: Floats | None = None) -> float:
    """Return the functional on triangles with corners (m, 3, 2).

    `coefficients` has shape (m, functions), `number` contains the region numbers (m,), and `bend` the midside offsets
    (m, 3, 2). Elements with curved sides or around an axis are integrated by the rules of `by_points`.
    """
    bend = np.zeros_like(corners) if bend is None else bend
    special = np.any(bend != 0.0, axis=(1, 2)) | ritz.axisymmetric
    kind = np.where(special, kinds_at_axis(corners[:, :, 0]) if ritz.axisymmetric else 0, -1)
    total = 0.0
    for one, law, rows in alike(kind, number, ritz):
        part = corners[rows], coefficients[rows], number[rows], ritz
        if one < 0:
            total += _plain_value(*part, law_reference(ritz.order) if law else exact_reference(ritz.order))
        else:
            total += _value_by_points(*part, bend[rows], one, by_points(ritz.order, law))
    return total


def _plain_value(corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, at: Reference) -> float:
    doubled, slope = gradients(corners, coefficients, at)
    density = at.weight @ _density(slope, 1.0, corners, number, ritz)
    if callable(ritz.source):
        share, weight = source_points(ritz.order)
        source = source_at(np.einsum("qk,mkd->dqm", share, corners), number, ritz.source)
        pull = weight @ (source * (functions_at(share, ritz.order) @ coefficients.T))
    else:
        pull = 2.0 * looked_up(np.asarray(ritz.source), number) * (coefficients @ at.mean)
    return 0.5 * float(np.sum(np.abs(doubled) * (density - pull)))


def _value_by_points(
    corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, bend: Floats, kind: int, points: Points
) -> float:
    doubled, x, value, slope = fields_at(points, kind, corners, bend, coefficients)
    density = _density(slope, x if ritz.axisymmetric else 1.0, corners, number, ritz)
    density -= source_on(points, kind, corners, bend, number, ritz) * value
    return 0.5 * float(np.sum(points.weight[kind] @ (np.abs(doubled) * density)))


def value_in_space(corners: Floats, values: Floats, number: Ints, ritz: Ritz) -> float:
    """Return the functional on tetrahedra with corners (3, 4, m) and values (4, m)."""
    slope = np.einsum("dkm,km->dm", TETRAHEDRON.hat_gradients(corners), values)
    six, density = np.abs(TETRAHEDRON.determinant(corners)), density_in_space(slope, number, ritz)
    if callable(ritz.source):
        pull = float(np.sum(loads_in_space(corners, number, ritz.source) * values))
        return float(np.sum(six * density)) / 6.0 - pull
    density = density - looked_up(np.asarray(ritz.source), number) * values.mean(axis=0)
    return float(np.sum(six * density)) / 6.0


def loads_in_space(corners: Floats, number: Ints, source: Callable[[Floats, Ints], ArrayLike]) -> Floats:
    """Return the integrals of source times functions of tetrahedra, shape (4, m).

    The rule is exact for a source that is a polynomial of degree 6.
    """
    points, weight = get_quadrature(ElementTetP1, DEGREE_IN_SPACE)
    loads = np.zeros(corners.shape[1:])
    for share, part in zip(np.vstack([1.0 - points.sum(axis=0), points]).T, weight, strict=True):
        at = source_at(np.einsum("k,dkm->dm", share, corners)[:, None], number, source)[0]
        loads += part * share[:, None] * at
    return loads * np.abs(TETRAHEDRON.determinant(corners))


def density_in_space(slope: Floats, number: Ints, ritz: Ritz) -> Floats:
    """Return the integrand without the source for gradients (3, m), shape (m,)."""
    square = np.sum(slope**2, axis=0)
    density = 0.5 * looked_up(np.asarray(ritz.coefficient), number) * square
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = number == k
            density[rows] = law.energy(np.sqrt(square[rows]))
    for part, along in zip(flux_table(np.asarray(ritz.flux), TETRAHEDRON.dim), slope, strict=True):
        density -= looked_up(part, number) * along
    return density


def _density(slope: Floats, x: Floats | float, corners: Floats, number: Ints, ritz: Ritz) -> Floats:
    """Return the integrand without the source for gradients (2, points, m).

    Around an axis `x` contains the distances of the points from the axis.
    """
    flux_x, flux_y = flux_on(corners, number, ritz)
    stored = 0.5 * looked_up(np.asarray(ritz.coefficient), number) * np.sum(slope**2, axis=0) / x
    far = np.broadcast_to(x, stored.shape)
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = number == k
            stored[:, rows] = far[:, rows] * law.energy(np.hypot(*slope[:, :, rows]) / far[:, rows])
    return stored - flux_x * slope[0] - flux_y * slope[1]


def flux_on(corners: Floats, number: Ints, ritz: Ritz) -> Floats:
    """Return the mean flux of every element, shape (2, m), or a constant, shape (2,)."""
    if callable(ritz.flux):
        return flux_at(inner_points(corners.transpose(2, 1, 0)), number, ritz.flux).mean(axis=1)
    return np.stack([looked_up(part, number) for part in flux_table(np.asarray(ritz.flux), 2)])


@cache
def source_points(order: int) -> tuple[Floats, Floats]:
    """Return barycentric coordinates (points, 3) and weights for a source.

    The sum of the weights is 1. The rule is exact for a source that is a polynomial of degree order + 4.
    """
    points, weight = get_quadrature(ElementTriP1, 2 * order + 4)
    return np.stack([1.0 - points.sum(axis=0), *points], axis=1), 2.0 * weight


def source_on(points: Points, kind: int, corners: Floats, bend: Floats, number: Ints, ritz: Ritz) -> Floats:
    """Return the source at the points of elements, shape (points, m), or by element."""
    if not callable(ritz.source):
        return looked_up(np.asarray(ritz.source), number)
    x = np.einsum("qk,mkd->dqm", points.share[kind], corners)
    x += np.einsum("qk,mkd->dqm", points.side[kind, :, :, 0], bend)
    return source_at(x, number, ritz.source)
