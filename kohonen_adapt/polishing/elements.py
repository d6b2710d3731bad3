"""Data of elements and curve segments for the polish of triangles."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, FloatsPair, Int32s, Ints, padded
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.numba.compilation import zeros
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CONSTANTS,
    HALF_FLUX_X,
    RATES_X,
    RATES_Y,
    VARYING,
    Shapes,
)
from kohonen_adapt.mesh.elements.functions import kinds_at_axis
from kohonen_adapt.mesh.elements.polynomials import TrialFunction, gradients
from kohonen_adapt.mesh.elements.rules import SOURCE_DEGREE
from kohonen_adapt.mesh.measures import inner_points
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.functional_value import source_rule
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_at, source_at

__all__ = [
    "UNKNOWNS",
    "expanded",
    "hold_unpaired",
    "kinds_of",
    "line_of_chains",
    "nodes_of_chains",
    "shapes_of",
    "signs_of_chains",
    "with_source",
    "without_modes",
]

UNKNOWNS = (1, 4, 9)  # per node of a large mesh, by order
FEW = 5_000  # elements or nodes of order 1 per thread at least; the work grows as the cube of the unknowns


def shapes_of(ritz: Ritz, offsets: Floats, rows: int) -> Shapes:
    """Return element shapes with `rows` rows.

    `offsets` (m, 3, 2) holds the midside offsets. Rows after m are straight.
    """
    all_offsets = padded(offsets, rows, 0.0)
    return Shapes(all_offsets, np.any(all_offsets != 0.0, axis=(1, 2)) | ritz.axisymmetric, ritz.axisymmetric)


def kinds_of(ritz: Ritz, triangulation: Triangulation) -> Ints | None:
    return kinds_at_axis(triangulation.position[triangulation.elements.node, 0]) if ritz.axisymmetric else None


def without_modes(m: int) -> Modes:
    return zeros(Modes, (m, 3, 0), m, (m, 3))


def expanded(constants: Floats, corners: Floats, number: Ints, flux: Callable[[Floats, Ints], ArrayLike]) -> Floats:
    """Return `Trial.data` of shape (m, VARYING) for a flux that is a function.

    The quadratic polynomial of each element interpolates the flux at `inner_points` and at the midpoints between
    them. Its mean over the element equals the mean of the flux over the three points, as in the functional. The
    flux is sampled inside elements only, since an element moves by less than its size between two samplings.
    """
    points = inner_points(corners)
    sampled = flux_at(np.concatenate([points, 0.5 * (points + np.roll(points, -1, axis=1))], axis=1), number, flux)
    data = np.zeros((len(constants), VARYING))
    data[:, :CONSTANTS] = constants
    data[:, CENTRE_X : CENTRE_X + 2] = corners.mean(axis=1).T
    for part, rates in enumerate((RATES_X, RATES_Y)):
        value, increase = polynomial(points, 0.5 * sampled[part])
        data[:, HALF_FLUX_X + part] = value
        data[:, rates : rates + len(increase)] = increase.T
    return data


def with_source(
    constants: Floats, corners: Floats, number: Ints, source: Callable[[Floats, Ints], ArrayLike], order: int
) -> Floats:
    """Return `Trial.data` of shape (m, SOURCE_TERMS + terms) for a varying source.

    The polynomial of degree ``order + SOURCE_DEGREE`` is the best fit at the quadrature points of the functional.
    """
    share, _ = source_rule(order, 2)
    sampled = source_at(share @ corners, number, source)
    (ax, ay), (bx, by) = (corners[:, k] - corners[:, 0] for k in (1, 2))
    doubled, x, y = ax * by - ay * bx, share[:, 1] - 1.0 / 3.0, share[:, 2] - 1.0 / 3.0
    degree = order + SOURCE_DEGREE
    terms = np.stack([x**i * y**j for j in range(degree + 1) for i in range(degree + 1 - j)], axis=1)
    centre = corners.mean(axis=1)
    axes = np.stack([by, -bx, -ay, ax]) / doubled
    return np.concatenate([constants.T, centre, axes, np.linalg.pinv(terms) @ sampled]).T.copy()


def polynomial(points: Floats, values: Floats) -> FloatsPair:
    # `values` (6, m) belong to the corners `points` (2, 3, m), then to the midpoints after each corner. Returned are
    # the value (m,) and the derivatives by x, y, xx, xy and yy (5, m).
    corner, middle = values[:3], values[3:]
    hat = np.stack([gradients(points.T, np.tile(unit, (points.shape[2], 1))) for unit in np.eye(3)])
    after = np.roll(hat, -1, axis=0)
    slope = np.einsum("im,icm->cm", corner, hat) + 4.0 * np.einsum("im,icm->cm", middle, hat + after)
    hessian = np.einsum("im,icm,idm->cdm", corner, hat, hat) + 2.0 * np.einsum("im,icm,idm->cdm", middle, hat, after)
    value = (4.0 * middle.sum(axis=0) - corner.sum(axis=0)) / 9.0
    return value, np.stack(
        [*slope / 3.0, 4.0 * hessian[0, 0], 2.0 * (hessian[0, 1] + hessian[1, 0]), 4.0 * hessian[1, 1]]
    )


def hold_unpaired(solution: TrialFunction, ritz: Ritz, triangulation: Triangulation, outline: Outline) -> None:
    for name in (name for names in ritz.signs for name in names):
        sides = on_chains(triangulation.elements.chain, (outline.names[name] != 0) & ~outline.constraints.chains.paired)
        solution.fixed[np.concatenate(triangulation.elements.ends(*np.nonzero(sides)))] = True
        if solution.modes is not None:
            solution.modes.dirichlet[sides] = True


def signs_of_chains(ritz: Ritz, outline: Outline) -> Floats:
    sign = np.zeros(len(outline.constraints.chains.length))
    chains = outline.constraints.chains
    for names, times in ritz.signs.items():
        for name in names:
            sign[(outline.names[name] != 0) & chains.paired] = times
    return sign


def nodes_of_chains(triangulation: Triangulation) -> tuple[Int32s, Int32s]:
    elements = triangulation.elements
    e, k = np.nonzero(elements.chain >= 0)
    node = np.concatenate([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]])
    return np.tile(elements.chain[e, k], 2), node


def line_of_chains(
    triangulation: Triangulation, outline: Outline, chain: Int32s, node: Int32s, values: Floats
) -> FloatsPair:
    """Return linear functions (c, 2) on curve segments and deviations (c,) of values.

    A linear function is stored as the value at the start and the rate along the segment. The rate is 0 on curves.
    """
    chains = outline.constraints.chains
    offset = triangulation.position[node] - chains.origin[chain]
    parameter = np.sum(offset * chains.direction[chain], axis=1)
    order = np.lexsort((parameter, chain))
    last = np.cumsum(np.bincount(chain, minlength=len(chains.length))) - 1
    end, start = values[node[order[last]]], values[node[order[np.append(0, last[:-1] + 1)]]]
    rate = np.where(outline.straight, (end - start) / chains.length, 0.0)
    deviation = np.zeros(len(start))
    np.maximum.at(deviation, chain, np.abs(values[node] - start[chain] - rate[chain] * parameter))
    return np.stack([start, rate], axis=1), deviation
