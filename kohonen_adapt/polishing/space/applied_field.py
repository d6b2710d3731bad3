"""Sliding of nodes on iron and magnets in an applied field, at order 1."""

import numpy as np
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import (
    AT_X,
    CORRECTION,
    FIELD_X,
    FOLLOWS,
    GRADIENT_XX,
    LINE,
    LOAD,
    OFFSET,
    PLANE,
    REDUCED,
    TWELFTH_COEFFICIENT,
    OpenTetrahedra,
    Surfaces,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.polish.applied_field import add_loads
from kohonen_adapt.mesh.tetrahedralization import faces_of, faces_on
from kohonen_adapt.polishing.space.surface_values import ridges_at
from kohonen_adapt.problem.boundary_terms import FACET_DEGREE, AppliedField

__all__ = ["renew_field", "sliding_places", "start_field", "with_loads_of_faces"]

# Corners of a tetrahedron, at which the mean of a harmonic function is its value in the middle.
STENCIL = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
SPREAD = 0.05  # of the stencil, relative to the shortest edge
FIELD, GRADIENT, AT = slice(FIELD_X, GRADIENT_XX), slice(GRADIENT_XX, AT_X), slice(AT_X, CORRECTION)
UPPER = np.triu_indices(3)


def sliding_places(surfaces: Surfaces, driven: Mask, barred: Mask, held: Mask) -> Mask:
    # Patches and ridges, (p + r,). `driven` are patches with offsets or loads. `barred` patches and ridges are held for
    # other reasons, and `held` for any reason.
    patches = len(surfaces.shape)
    loaded = driven & (surfaces.shape == PLANE) & ~barred[:patches]
    beside = ridges_at(surfaces, loaded)
    free = np.append(loaded | ~held[:patches], True)[surfaces.meets].all(axis=1)
    return np.append(loaded, beside & free & (surfaces.ridge_shape == LINE) & ~barred[patches:])


def start_field(mesh: OpenTetrahedra, trial: Trial, function: AppliedField) -> None:
    # The kernels add the work of faces, so that the rest is left in the arrays.
    rows = np.unique(_faces(mesh, trial.loaded))
    trial.applied[rows, FOLLOWS] = 1.0
    _sample(mesh, trial, function, rows)
    own = _loads(mesh, trial)
    trial.surface[:, LOAD] -= own
    trial.applied[:, CORRECTION] = _loads_by_quadrature(mesh, trial, function) - own


def renew_field(mesh: OpenTetrahedra, trial: Trial, function: AppliedField) -> None:
    # Evaluate the field where nodes have moved, and correct offsets and loads, as they are in the next solution.
    applied, at = trial.applied, mesh.position
    rows = np.flatnonzero((applied[:, FOLLOWS] != 0.0) & np.any(applied[:, AT] != at, axis=1))
    if not rows.size:
        return
    step, before = at[rows] - applied[rows, AT], applied[rows, GRADIENT]
    old = applied[rows, FIELD]
    _sample(mesh, trial, function, rows)
    # by values and derivatives at both ends in place of one
    start, end = _second(before, step), _second(applied[rows, GRADIENT], step)
    change = 0.5 * np.sum((applied[rows, FIELD] - old) * step, axis=1) - (5.0 * start + end) / 12.0
    trial.surface[rows, OFFSET] -= change
    correction = _loads_by_quadrature(mesh, trial, function) - _loads(mesh, trial)
    trial.surface[:, LOAD] += correction - applied[:, CORRECTION]
    applied[:, CORRECTION] = correction


def with_loads_of_faces(mesh: OpenTetrahedra, trial: Trial) -> Floats:
    if not len(trial.applied):
        return trial.surface
    surface = trial.surface.copy()
    surface[:, LOAD] += _loads(mesh, trial)
    return surface


def _loads(mesh: OpenTetrahedra, trial: Trial) -> Floats:
    load = np.zeros(len(mesh.position))
    add_loads(mesh, trial, load)
    return load


def _loads_by_quadrature(mesh: OpenTetrahedra, trial: Trial, function: AppliedField) -> Floats:
    e, k = faces_on(mesh.elements, trial.loaded)
    outside = trial.data[mesh.elements.region[e], REDUCED] != 0.0
    e, k = e[outside], k[outside]
    node, mu = faces_of(mesh.elements, e, k), 12.0 * trial.data[mesh.elements.region[e], TWELFTH_COEFFICIENT]
    a, b, c = np.moveaxis(mesh.position[node], 1, 0)
    normal = np.cross(b - a, c - a)
    inward = np.sum(normal * (mesh.position[mesh.elements.node[e, k]] - a), axis=1) > 0.0
    normal *= np.where(inward, -mu, mu)[:, None]
    load, (points, weights) = np.zeros(len(mesh.position)), get_quadrature(RefTri, FACET_DEGREE)
    for (s, t), weight in zip(points.T, weights, strict=True):
        barycentric = np.array([1.0 - s - t, s, t])
        field = np.asarray(function(np.einsum("i,kic->ck", barycentric, mesh.position[node])), float)
        terms = weight * np.sum(normal * field.T, axis=1)[:, None] * barycentric
        load += np.bincount(node.ravel(), terms.ravel(), load.size)
    return load


def _second(gradient: Floats, step: Floats) -> Floats:
    twice = np.where(UPPER[0] == UPPER[1], 1.0, 2.0)
    return np.sum(twice * gradient * step[:, UPPER[0]] * step[:, UPPER[1]], axis=1)


def _sample(mesh: OpenTetrahedra, trial: Trial, function: AppliedField, rows: Ints) -> None:
    x = mesh.position[rows]
    width = SPREAD * _shortest(mesh, _faces(mesh, trial.loaded))[rows, None]
    points = x[:, None] + width[:, None] * STENCIL
    field = np.asarray(function(points.reshape(-1, 3).T), float).T.reshape(points.shape)
    gradient = np.einsum("nki,kj->nij", field, STENCIL) / (4.0 * width[:, None])
    gradient = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    trial.applied[rows, FIELD], trial.applied[rows, AT] = field.mean(axis=1), x
    trial.applied[rows, GRADIENT] = gradient[:, UPPER[0], UPPER[1]]


def _faces(mesh: OpenTetrahedra, patches: Mask) -> Ints:
    e, k = faces_on(mesh.elements, patches)
    return faces_of(mesh.elements, e, k)


def _shortest(mesh: OpenTetrahedra, faces: Ints) -> Floats:
    shortest = np.full(len(mesh.position), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        length = np.linalg.norm(mesh.position[faces[:, i]] - mesh.position[faces[:, j]], axis=1)
        np.minimum.at(shortest, faces[:, i], length)
        np.minimum.at(shortest, faces[:, j], length)
    return shortest
