"""Functions on boxes of tetrahedra with a functional, as compiled loops take them, and that functional the slow way."""

import numpy as np

from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.tetrahedron.arrays import OFFSET, REDUCED, SHIFT_X, Trial
from kohonen_adapt.magnetostatics import Froehlich
from kohonen_adapt.polishing.energy_tables import tabulated

LAW = Froehlich(4.0, 2.1)


def on_nodes(mesh, seed=0, bent=False, value=None):
    """Random values, given where x is 0, and random constants by region.

    `bent` gives the last region a law, and the first an offset.
    """
    rng, rows = np.random.default_rng(seed), len(mesh.position)
    regions = int(mesh.elements.region.max()) + 1
    fixed = np.zeros(rows, dtype=bool)
    fixed[mesh.pool.anchor >= 0] = mesh.position[mesh.pool.anchor >= 0, 0] == 0.0
    x = mesh.position
    smooth = np.exp(-8.0 * ((x - rng.random(3)) ** 2).sum(axis=1)) + 0.05 * rng.normal(size=rows)
    values = np.where(fixed, 0.0, smooth) if value is None else value(x)
    data = np.column_stack([10.0 ** rng.uniform(-1, 1, regions), rng.normal(size=(regions, 4))])
    data = np.hstack(
        [data / np.array([12.0, 24.0, 6.0, 6.0, 6.0]), rng.normal(size=(regions, 3)), np.zeros((regions, 1))]
    )
    data[0, REDUCED] = 1.0
    number = np.full(regions, -1, dtype=np.int32)
    number[-1] = 0 if bent else -1
    tables = tabulated([LAW], 10.0)
    places = len(mesh.surfaces.shape) + len(mesh.surfaces.ridge_shape)
    laws, rate = Laws(number, tables.first, tables.energy), np.zeros((places, 3))
    surface = np.column_stack([rng.normal(size=rows), np.zeros(rows)]) if bent else np.zeros((0, 2))
    return Trial(values, fixed, data, laws, rate, *plain(mesh), np.zeros((0, regions)), surface)


def plain(mesh):
    """No patch with slivers, and none on which given values go on."""
    return [np.zeros(len(mesh.surfaces.shape), dtype=bool) for _ in range(2)]


def functional(mesh, trial, elements=None):
    """int c/2 |grad u|^2 - f u - g . grad u with W(|grad u|) for laws, and the sum of magnitudes of what is added."""
    node, region = mesh.elements.node, mesh.elements.region
    rows = np.flatnonzero(node[:, 0] >= 0) if elements is None else elements
    return functional_of(mesh.position, trial, node[rows], region[rows])


def functional_of(position, trial, node, region):
    """The same of elements that need not be part of a mesh."""
    corners, values = position[node], trial.value[node]
    if len(trial.surface):
        values = values - trial.data[region, REDUCED][:, None] * trial.surface[node, OFFSET]
    planes = np.dstack([corners, np.ones(values.shape)])
    gradient = np.linalg.solve(planes, values[..., None])[:, :3, 0]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    c, f, *g = (trial.data[:, :5] * np.array([12.0, 24.0, 6.0, 6.0, 6.0]))[region].T
    argument = np.linalg.norm(gradient - trial.data[region, SHIFT_X:REDUCED], axis=1)
    linear = 0.5 * c * np.sum(gradient**2, axis=1)
    density = np.where(trial.laws.number[region] >= 0, LAW.energy(argument), linear)
    pull, push = f * values.mean(axis=1), np.sum(np.array(g).T * gradient, axis=1)
    return volume @ (density - pull - push), volume @ (density + np.abs(pull) + np.abs(push))
