"""Functions on boxes of tetrahedra with a functional, as compiled loops take them, and that functional the slow way."""

import numpy as np

from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.tetrahedron.arrays import Trial


def on_nodes(mesh, seed=0, value=None):
    """Random values, given where x is 0, and random constants by region, without laws."""
    rng, rows = np.random.default_rng(seed), len(mesh.position)
    regions = int(mesh.elements.region.max()) + 1
    fixed = np.zeros(rows, dtype=bool)
    fixed[mesh.pool.anchor >= 0] = mesh.position[mesh.pool.anchor >= 0, 0] == 0.0
    x = mesh.position
    smooth = np.exp(-8.0 * ((x - rng.random(3)) ** 2).sum(axis=1)) + 0.05 * rng.normal(size=rows)
    values = np.where(fixed, 0.0, smooth) if value is None else value(x)
    coefficient, source = 10.0 ** rng.uniform(-1, 1, regions), rng.normal(size=(regions, 4))
    data = coefficient / 12.0, source[:, 0] / 24.0, source[:, 1:] / 6.0, np.zeros((regions, 3)), np.zeros(regions)
    laws = Laws(np.full(regions, -1, dtype=np.int32), 0, np.zeros((1, 2, 2)))
    places = len(mesh.surfaces.shape) + len(mesh.surfaces.ridge_shape)
    patches = [np.zeros(len(mesh.surfaces.shape), dtype=bool) for _ in range(2)]  # none has slivers or given values
    return Trial(values, fixed, *data, laws, np.zeros((places, 3)), *patches, np.zeros((0, regions)), np.zeros((0, 2)))


def functional(mesh, trial):
    """int c/2 |grad u|^2 - f u - g . grad u."""
    rows = np.flatnonzero(mesh.elements.node[:, 0] >= 0)
    return functional_of(mesh.position, trial, mesh.elements.node[rows], mesh.elements.region[rows])


def functional_of(position, trial, node, region):
    """The same of elements that need not be part of a mesh."""
    corners, values = position[node], trial.value[node]
    planes = np.dstack([corners, np.ones(values.shape)])
    gradient = np.linalg.solve(planes, values[..., None])[:, :3, 0]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    c, f, g = 12.0 * trial.twelfth[region], 24.0 * trial.load[region], 6.0 * trial.sixth_flux[region]
    slope = 0.5 * c * np.sum(gradient**2, axis=1) - np.sum(g * gradient, axis=1)
    return volume @ (slope - f * values.mean(axis=1))
