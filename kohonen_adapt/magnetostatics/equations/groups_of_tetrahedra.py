"""Groups of tetrahedra with one quadrature rule."""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.basis import CURVED_RULE_IN_SPACE, LAW_RULE_IN_SPACE
from kohonen_adapt.mesh.cells import TETRAHEDRON, tetrahedron_rule
from kohonen_adapt.mesh.measures import CurvedTetrahedra, tangent_corners

__all__ = ["EDGES", "METRIC", "PAIRS", "Group", "groups_of"]

EDGES = np.transpose(RefTet.edges)  # (2, 6): local corners, in the order of scikit-fem
DEGREE = 3  # of the rule without a law: a torque integrates products of two fields and an arm
PAIRS, METRIC = np.triu_indices(10), np.triu_indices(4)  # of functions, and of barycentric coordinates


@dataclass(frozen=True)
class Group:
    rows: Ints  # (m,): elements with one quadrature rule
    columns: slice  # of the quadrature points, which have shape (q, m)
    barycentric: Floats  # (q, 4)
    weights: Floats  # (q,), with sum 1
    has_law: bool
    hats: Floats  # gradients of barycentric coordinates, (3, 4, m), in curved elements (3, 4, q, m)
    volumes: Floats  # (m,), in curved elements a sixth of the determinants, (q, m)

    @property
    def curved(self) -> bool:
        return self.hats.ndim == 4

    @property
    def axes(self) -> str:  # of `hats` in sums
        return "caqm" if self.curved else "cam"

    @property
    def point_volumes(self) -> Floats:
        return self.weights[:, None] * self.volumes

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
        return both if self.has_law or self.curved else both.sum(axis=2, keepdims=True)


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


def groups_of(nonlinear: Mask, shape: CurvedTetrahedra, hats: Floats, volumes: Floats) -> list[Group]:
    groups, first = list[Group](), 0
    for curved, has_law in product((False, True), (False, True)):
        rows = np.flatnonzero((nonlinear == has_law) & (shape.curved == curved))
        without_law = CURVED_RULE_IN_SPACE if curved else tetrahedron_rule(DEGREE)
        barycentric, weights = LAW_RULE_IN_SPACE if has_law else without_law
        if rows.size:
            columns = slice(first, first + rows.size * weights.size)
            maps = maps_of(shape, rows, barycentric) if curved else (hats[:, :, rows], volumes[rows])
            groups.append(Group(rows, columns, barycentric, weights, has_law, *maps))
            first = columns.stop
    return groups


def maps_of(shape: CurvedTetrahedra, rows: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
    # `hats` and `volumes` of a `Group` of curved elements
    corners, offset = shape.p[:, shape.t[:, rows]], shape.offset[:, :, rows]
    tangents = [tangent_corners(corners, offset, at[:, None]) for at in barycentric]
    hats = np.stack([TETRAHEDRON.hat_gradients(each) for each in tangents], axis=2)
    return hats, np.stack([np.abs(TETRAHEDRON.determinant(each)) for each in tangents]) / 6.0
