"""Measure what the map loses where there is nothing to gain: on a constant density that the mesh has already."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1
from benchmarks.problems.helmholtz import square_mesh
from benchmarks.problems.l_shape import l_shaped_mesh
from benchmarks.table import aligned

RISE_LIMIT = 0.05  # of the mean distance to the nearest node
SPREAD_LIMIT = 0.2  # of the area per node; measured 0.16 to 0.17
_SAMPLES_PER_UNIT = 400


def report(seeds: Sequence[int], quick: bool) -> str:
    """Rise of the mean distance and spread of the node density, medians and worst over the seeds."""
    meshes = {"square, 20 x 20": square_mesh(20), "L-shape, 16 per unit": l_shaped_mesh(16)}
    if not quick:
        meshes["square, 60 x 60"] = square_mesh(60)
    rows = []
    for name, mesh in meshes.items():
        moved = [ka.relocate(mesh, np.ones(mesh.t.shape[1]), seed=seed) for seed in seeds]
        rises = [mean_distance(after) / mean_distance(mesh) - 1 for after in moved]
        spreads = [node_density_spread(after) for after in moved]
        rows.append(
            [name, mesh.p.shape[1], float(np.median(rises)), max(rises), *_limit(float(np.median(rises)), RISE_LIMIT)]
            + [float(np.median(spreads)), max(spreads), *_limit(max(spreads), SPREAD_LIMIT)]
        )
    judged = ["worst", "limit", ""]
    return aligned(["spread: constant density on", "N", "rise", *judged, "cv of density", *judged], rows)


def _limit(value: float, limit: float) -> list[float | str]:
    return [limit, "met" if value <= limit else "missed"]


def mean_distance(mesh: MeshTri) -> float:
    """Mean distance from a point of the domain to its nearest node, from a fine regular sample."""
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    count = max(2, round(_SAMPLES_PER_UNIT * float(np.max(high - low))))
    steps = (np.arange(count) + 0.5) / count
    sample = np.stack(np.meshgrid(*(low + np.outer(steps, high - low)).T)).reshape(2, -1)
    inside = ~np.isnan(ka.interpolate(mesh, np.zeros(mesh.p.shape[1]), sample))
    return float(cKDTree(mesh.p.T).query(sample[:, inside].T)[0].mean())


def node_density_spread(mesh: MeshTri) -> float:
    """Coefficient of variation of the area per node (a third of its star) over the interior nodes."""
    areas, _ = p1.shape_gradients(mesh)
    share = np.bincount(mesh.t.ravel(), np.tile(areas / 3, 3), minlength=mesh.p.shape[1])
    interior = share[mesh.interior_nodes()]
    return float(interior.std() / interior.mean())
