"""Dirichlet values on faces and edges of a body."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, IntsPair, Mask, unique_pairs
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, LOAD, ON_PATCH, ON_RIDGE, Freedom, Surfaces
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization, faces_of
from kohonen_adapt.polishing.energy_tables import LINEAR
from kohonen_adapt.problem.boundary_terms import corner_values

__all__ = ["EDGES_OF_FACES", "DirichletValues", "dirichlet_on", "ridges_at", "sides_of", "with_loads"]

# Edges of the face opposite to each corner, (4, 3).
EDGES_OF_FACES = np.array([np.flatnonzero((EDGES[:, :2] != k).all(axis=1)) for k in range(4)])


@dataclass(frozen=True)
class DirichletValues:
    """Dirichlet values of faces (patches), then of edges (ridges) of a body, (k,).

    Attributes
    ----------
    dirichlet
        True if all nodes, or some of the sliding nodes, have Dirichlet values.
    linear
        True if all nodes have Dirichlet values, which are linear in the position.
    unknown
        True if Dirichlet values are ambiguous, because no node slides there and all nodes of the patch, or some
        nodes of the patches of the ridge, have Dirichlet values.
    rate
        Gradient of `linear` values, (k, 3).
    """

    dirichlet: Mask
    linear: Mask
    unknown: Mask
    rate: Floats


def dirichlet_on(
    tet: Tetrahedralization, surfaces: Surfaces, freedom: Freedom, solution: TrialFunction, reduced: Mask
) -> DirichletValues:
    values, fixed, modes = solution.values, solution.fixed, solution.modes
    patches = len(surfaces.shape)
    count = patches + len(surfaces.ridge_shape)
    patch, node = nodes_of_patches(tet)
    touched = np.bincount(patch, fixed[node], patches) > 0
    place, node = np.concatenate([[patch, node], ends_of_ridges(tet, surfaces, freedom)], axis=1)
    slides = np.isin(freedom.number, (ON_PATCH, ON_RIDGE))
    own = freedom.place + np.where(freedom.number == ON_RIDGE, patches, 0)
    bare = np.bincount(own[slides], minlength=count) == 0
    partly = np.bincount(own[slides & fixed], minlength=count) > 0
    whole = np.bincount(place, ~fixed[node], count) == 0
    near = ridges_at(surfaces, touched)
    unknown = bare & np.append(whole[:patches], near)
    there = corner_values(values, solution.surface, node, reduced[place])
    rate, deviation = linear_fits(place, tet.position[node], there, whole & ~bare)
    if modes is not None:
        patch, mode, given = edges_on_patches(tet, modes)
        whole[:patches] &= np.bincount(patch, ~given, patches) == 0
        np.maximum.at(deviation, patch, np.abs(mode))
        lone = ridges_at(surfaces, whole[:patches])  # edges of other ridges are not known
        whole[patches:] &= lone
    linear = whole & ~bare & (deviation <= LINEAR * np.ptp(values))
    return DirichletValues((whole & ~bare) | partly, linear, unknown, rate)


def sides_of(tet: Tetrahedralization, surfaces: Surfaces, reduced: Mask) -> tuple[Mask, Mask]:
    # Patches between reduced regions and the rest, (p,), and patches and ridges beside reduced regions alone, (p + r,)
    patches = len(surfaces.shape)
    elements = tet.elements
    e, k = np.nonzero(elements.patch >= 0)
    count = [
        np.bincount(elements.patch[e, k], reduced[elements.region[e]] == side, patches) > 0 for side in (True, False)
    ]
    whole = count[0] & ~count[1]
    return count[0] & count[1], np.append(whole, np.append(whole, True)[surfaces.meets].all(axis=1))


def with_loads(tet: Tetrahedralization, freedom: Freedom, nodal: Floats, patches: int) -> Mask:
    loaded, slides = nodal[:, LOAD] != 0.0, freedom.number == ON_PATCH
    patch, node = nodes_of_patches(tet)
    without = np.bincount(patch, ~loaded[node], patches)
    sliding = np.bincount(freedom.place[slides], minlength=patches)
    found = np.bincount(freedom.place[slides & loaded], minlength=patches)
    return (found > 0) | ((sliding == 0) & (without == 0))


def ridges_at(surfaces: Surfaces, patches: Mask) -> Mask:
    return np.any(np.append(patches, False)[surfaces.meets], axis=1)


def nodes_of_patches(tet: Tetrahedralization) -> IntsPair:
    elements = tet.elements
    e, k = np.nonzero(elements.patch >= 0)
    return unique_pairs(np.repeat(elements.patch[e, k], 3), faces_of(elements, e, k).ravel())


def edges_on_patches(tet: Tetrahedralization, modes: Modes) -> tuple[Ints, Floats, Mask]:
    e, k = np.nonzero((tet.elements.patch >= 0) & (tet.elements.node[:, :1] >= 0))
    edge = EDGES_OF_FACES[k]
    patch = np.repeat(tet.elements.patch[e, k], 3)
    return patch, modes.side[e[:, None], edge, 0].ravel(), modes.dirichlet[e[:, None], edge].ravel()


def ends_of_ridges(tet: Tetrahedralization, surfaces: Surfaces, freedom: Freedom) -> Ints:
    """Return ridges and their nodes, shape (2, k).

    Ridges are numbered after the patches. Their nodes are those that slide on the ridge, and held end nodes. A
    held node is an end if as many patches have the edge to a sliding node as meet in the ridge.
    """
    elements, n = tet.elements, tet.nnodes
    patches = len(surfaces.shape)
    slides = freedom.number == ON_RIDGE
    e, k = np.nonzero(elements.patch >= 0)
    corners, patch = faces_of(elements, e, k).astype(np.int64), elements.patch[e, k].astype(np.int64)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    start, end = np.concatenate([start, end]), np.concatenate([end, start])
    there = slides[start] & (freedom.number[end] == HELD)
    code = np.unique((start * n + end)[there] * (patches + 1) + np.tile(np.repeat(patch, 3), 2)[there])
    edge, count = np.unique(code // (patches + 1), return_counts=True)
    ridge = freedom.place[edge // n]
    beside = count == np.count_nonzero(surfaces.meets >= 0, axis=1)[ridge]
    own = np.flatnonzero(slides)
    rows = [np.append(freedom.place[own], ridge[beside]) + patches, np.append(own, (edge % n)[beside])]
    return np.stack(rows).astype(np.int64)


def linear_fits(place: Ints, position: Floats, values: Floats, wanted: Mask) -> FloatsPair:
    """Return gradients (k, 3) and deviations (k,) of least-squares linear fits.

    `place` (q,) is the patch or ridge of every position (q, 3). Rows that are not `wanted` are 0.
    """
    rate, deviation = np.zeros((len(wanted), 3)), np.zeros(len(wanted))
    low, high = np.full(len(wanted), np.inf), np.full(len(wanted), -np.inf)
    np.minimum.at(low, place, values)
    np.maximum.at(high, place, values)
    order = np.argsort(place, kind="stable")
    start = np.searchsorted(place[order], np.arange(len(wanted) + 1))
    for p in np.flatnonzero(wanted & (low < high)).tolist():
        rows = order[start[p] : start[p + 1]]
        offset, rest = position[rows] - position[rows].mean(axis=0), values[rows] - values[rows].mean()
        rate[p] = np.linalg.lstsq(offset, rest, rcond=1e-9)[0]
        deviation[p] = np.abs(rest - offset @ rate[p]).max()
    return rate, deviation
