"""Sources and fluxes that meshes do not resolve."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.linalg import norm

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.problem.functional_value import parts_of_element, source_rule
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import constants_at, flux_at, source_at

__all__ = ["Doubt", "UnresolvedData", "doubt_about"]

INSIDE = 1e-6  # distance of points from the corners of elements, relative to the distance of the centre
ROWS = 5_000  # elements per block, to limit the memory
MARGIN = 3.0  # factor of the largest difference between rules, because solvers have rules of their own
# Difference of the loads by a rule and by the rule in parts of an element, relative to the load by the magnitude of the
# data, and fraction of the load in elements with this difference. With a layer of width 1 / k in elements of size
# 1 / 32 this fraction is 0 for k = 60, 0.06 for k = 100, 0.6 for k = 150 and 1 for k = 300, where the error of the
# functional is as large as its value.
DISAGREEMENT = 0.02
UNRESOLVED = 0.2
LAYER = 2.0  # largest deviation from means of a layer, at least, relative to magnitudes in other elements


class Doubt(NamedTuple):
    """Uncertainty by sources and fluxes that are functions.

    Attributes
    ----------
    residual
        Largest change of residuals by another quadrature rule, for elements, shape (m,), or for unknowns.
    oscillation
        Data oscillation if the mesh does not resolve the data, else 0.
    unresolved
        Name of the data that the mesh does not resolve, or an empty string.
    """

    residual: Floats
    oscillation: float
    unresolved: str


class UnresolvedData(NotOffered):
    def __init__(self, doubt: Doubt) -> None:
        super().__init__(f"the mesh does not resolve the {doubt.unresolved} of its Ritz")
        self.oscillation = doubt.oscillation


class Rule(NamedTuple):
    """Quadrature rule."""

    points: Floats  # barycentric coordinates, (points, d + 1)
    weight: Floats  # with the sum 1, (points,)


class Variation(NamedTuple):
    """Variation of data inside elements, every field of shape (m,)."""

    doubtful: Mask  # True if a rule and the rule in parts of the element disagree
    magnitude: Floats  # mean magnitude
    peak: Floats  # largest distance from the mean
    variance: Floats
    difference: Floats  # largest difference between mean loads by quadrature rules


def doubt_about(corners: Floats, region: Ints, ritz: Ritz) -> Doubt:
    """Return the uncertainty by the source and the flux of a `Ritz` on elements.

    `corners` has shape (d, d + 1, m). The data oscillation is the root of the sum of ``h^2 / coefficient int (f - mean
    of f)^2`` for a source f and of ``1 / coefficient int |g - mean of g|^2`` for a flux g, with the longest edge h
    (P. Morin, R. H. Nochetto, K. G. Siebert, SIAM J. Numer. Anal. 38, 2000).
    """
    edges = corners[:, :, None] - corners[:, None]
    longest = np.sum(edges**2, axis=0).max(axis=(0, 1))
    size = np.abs(np.linalg.det(edges[:, 0, 1:].transpose(2, 0, 1))) / (2.0 if len(corners) == 2 else 6.0)
    stiffness = constants_at(ritz.coefficient, region)
    if ritz.axisymmetric:
        stiffness = stiffness / corners[0].mean(axis=0)
    # Hat functions are at most 1. On triangles their slope times the area is at most half the longest edge.
    scales = {"source": (size, longest), "flux": (0.5 * np.sqrt(longest), 1.0)}
    residual = np.zeros(len(size))
    squared = 0.0
    unresolved = []
    for name, found in variations(corners, region, ritz):
        (reach, scale), load = scales[name], found.magnitude * size
        much = load[found.doubtful].sum() > UNRESOLVED * load.sum() and (name == "source" or not has_jumps(found))
        if much:  # no rule sees the data in all elements
            residual += reach * found.peak.max()
            squared += float(np.sum(scale / stiffness * size * found.variance))
            unresolved.append(name)
        else:
            residual += reach * np.where(found.doubtful, found.peak, MARGIN * found.difference)
    return Doubt(residual, float(np.sqrt(squared)), " and the ".join(unresolved))


def has_jumps(found: Variation) -> bool:
    # True for data as large in other elements, as at the surface of a magnet, by which functionals keep their meaning
    return bool(found.peak.max() < LAYER * found.magnitude[~found.doubtful].max(initial=0.0))


def variations(corners: Floats, region: Ints, ritz: Ritz) -> Iterator[tuple[str, Variation]]:
    source, flux = ritz.source, ritz.flux
    hats = np.eye(len(corners) + 1)
    if callable(source):
        dim = len(corners)
        rule = Rule(*source_rule(ritz.order if dim == 2 else 1, dim))  # in space of positive weights
        yield "source", variation(lambda x, rows: source_at(x, region[rows], source)[None], corners, rule, hats)
    if callable(flux):  # on triangles, at `inner_points`
        rule = Rule(0.5 * (np.eye(3) + 1.0 / 3.0), np.full(3, 1.0 / 3.0))
        yield "flux", variation(lambda x, rows: flux_at(x, region[rows], flux), corners, rule, np.ones((1, 3)))


def variation(values_at: Callable[[Floats, slice], Floats], corners: Floats, rule: Rule, tests: Floats) -> Variation:
    """Return the variation of data inside elements.

    `values_at` has the shape (components, points, rows) at points (d, points, rows). Loads of linear functions, with
    values at the corners in the rows of `tests`, by the `rule`, at the centre and at the corners are compared with
    loads by the `rule` in parts of elements.
    """
    parts = parts_of_element(len(corners))
    functions = len(corners) + 1
    count = corners.shape[2]
    fine = Rule(
        np.einsum("qk,pkj->pqj", rule.points, parts).reshape(-1, functions),
        np.tile(rule.weight, len(parts)) / len(parts),
    )
    share = np.full(functions, 1.0 / functions)
    corner = (1.0 - INSIDE) * np.eye(functions) + INSIDE * share  # other regions begin at the corners
    rules = [fine, rule, Rule(share[None], np.ones(1))]
    if len(corners) == 2:  # in space the corners are too far away
        rules.append(Rule(corner, share))
    found = Variation(np.empty(count, bool), *np.empty((4, count)))
    for first in range(0, count, ROWS):
        rows = slice(first, first + ROWS)
        values = [values_at(np.einsum("qk,dkm->dqm", each.points, corners[:, :, rows]), rows) for each in rules]
        loads = [(each.weight * (tests @ each.points.T)) @ at for each, at in zip(rules, values, strict=True)]
        differences = [np.abs(load - loads[0]).max(axis=(0, 1)) for load in loads[1:]]
        mean = (fine.weight @ values[0])[:, None]
        found.magnitude[rows] = fine.weight @ norm(values[0], axis=0)
        found.peak[rows] = np.max([norm(at - mean, axis=0).max(axis=0) for at in values[:2]], axis=0)
        found.variance[rows] = fine.weight @ np.sum((values[0] - mean) ** 2, axis=0)
        found.difference[rows] = np.max(differences, axis=0)
        found.doubtful[rows] = differences[0] > DISAGREEMENT * found.magnitude[rows]
    return found
