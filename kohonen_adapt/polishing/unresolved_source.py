"""Sources that vary so much inside elements that quadrature rules disagree."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTet, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.tables import source_at

__all__ = ["Doubt", "UnresolvedSource", "doubt_about_source"]

ROWS = 5_000  # elements per block, to limit the memory
# Difference of the loads by a rule and by the rule in parts of an element, relative to the load by the magnitude of the
# source, and fraction of the load in elements with this difference. With a layer of width 1 / k in elements of size
# 1 / 32 this fraction is 0 for k = 60, 0.06 for k = 100, 0.6 for k = 150 and 1 for k = 300, where the error of the
# functional is as large as its value.
DISAGREEMENT = 0.02
UNRESOLVED = 0.2


class Doubt(NamedTuple):
    load: Floats  # (m,): load by the largest value of the source, of elements in which rules disagree
    oscillation: float  # data oscillation if these elements have much of the whole load, else 0


class UnresolvedSource(NotOffered):
    def __init__(self, oscillation: float) -> None:
        super().__init__("the mesh does not resolve the source of its Ritz")
        self.oscillation = oscillation


@cache
def parts_of_element(dim: int) -> Floats:
    # barycentric coordinates of the corners of equal parts, (parts, dim + 1, dim + 1)
    parts = {2: MeshTri, 3: MeshTet}[dim].init_refdom().refined()
    return np.vstack([1.0 - parts.p.sum(axis=0), parts.p]).T[parts.t.T]


def doubt_about_source(
    corners: Floats,
    region: Ints,
    source: Callable[[Floats, Ints], ArrayLike],
    rule: tuple[Floats, Floats],
    coefficient: Floats,
) -> Doubt:
    """Compare loads by a quadrature rule and by the rule in parts of elements.

    `corners` has shape (d, d + 1, m). The `rule` consists of barycentric coordinates (points, d + 1) and of weights
    with the sum 1. The data oscillation is the root of the sum of ``h^2 / coefficient int (f - mean of f)^2``, with
    `coefficient` of shape (m,) and the longest edge h (P. Morin, R. H. Nochetto, K. G. Siebert, SIAM J. Numer. Anal.
    38, 2000).
    """
    edges = corners[:, 1:] - corners[:, :1]
    size = np.abs(np.linalg.det(edges.transpose(2, 0, 1))) / (2.0 if len(corners) == 2 else 6.0)
    (coarse, weight), parts = rule, parts_of_element(len(corners))
    fine = np.einsum("qk,pkj->pqj", coarse, parts).reshape(-1, len(corners) + 1)
    fine_weight = np.tile(weight, len(parts)) / len(parts)
    peak, magnitude, variance = np.empty((3, len(size)))
    doubtful = np.empty(len(size), dtype=np.bool_)
    for first in range(0, len(size), ROWS):
        rows = slice(first, first + ROWS)
        few, many = (
            source_at(np.einsum("qk,dkm->dqm", points, corners[:, :, rows]), region[rows], source)
            for points in (coarse, fine)
        )
        loads = [(w * points.T) @ values for w, points, values in ((weight, coarse, few), (fine_weight, fine, many))]
        magnitude[rows], peak[rows] = fine_weight @ np.abs(many), np.abs(np.vstack([few, many])).max(axis=0)
        variance[rows] = fine_weight @ many**2 - (fine_weight @ many) ** 2
        doubtful[rows] = np.abs(loads[0] - loads[1]).max(axis=0) > DISAGREEMENT * magnitude[rows]
    if (magnitude * size)[doubtful].sum() <= UNRESOLVED * (magnitude @ size):
        return Doubt(np.where(doubtful, peak * size, 0.0), 0.0)
    edges = corners[:, :, None] - corners[:, None]
    longest = np.sum(edges**2, axis=0).max(axis=(0, 1))
    return Doubt(peak * size, float(np.sqrt(np.sum(longest * size * np.maximum(variance, 0.0) / coefficient))))
