"""Relocation of tetrahedra by density tensors, with edges that are uniform in the metric."""

import numpy as np
import pytest
from helpers.solids import box, two_regions, volumes
from helpers.tetrahedra import thrown
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka

STAGES = (ka.Stage(2, 1, 0.3), ka.Stage(1, 1, 0.2))
SLAB = np.diag([1.0, 1.0, 100.0]) / 100 ** (1 / 3)  # edges 10 times longer along x and y than along z


def everywhere(mesh, tensor):
    return np.tile(tensor, (mesh.nelements, 1, 1))


def lengths(mesh, tensor):
    along = mesh.p[:, mesh.edges[1]] - mesh.p[:, mesh.edges[0]]
    return np.sqrt(np.einsum("in,ij,jn->n", along, tensor, along))


def spread(mesh, tensor):
    """Coefficient of variation of the lengths of edges in a metric."""
    found = lengths(mesh, tensor)
    return found.std() / found.mean()


def test_edges_in_a_metric_are_as_uniform_as_those_of_a_density():
    """In the median over seeds of meshes; a density leaves edges in the metric with a spread of 0.6."""
    found = []
    for seed in range(5):
        mesh = thrown(box(8), seed, reach=0.3)
        plain = ka.relocate(mesh, np.ones(mesh.nelements), topology="recycle")
        slab = ka.relocate(mesh, everywhere(mesh, SLAB), topology="recycle")
        assert slab.nvertices == mesh.nvertices and slab.is_valid() and ka.quality(slab).min() > 0.02
        assert np.abs(volumes(slab)).sum() == pytest.approx(1.0, rel=1e-12)
        found.append((spread(plain, np.eye(3)), spread(slab, SLAB), spread(plain, SLAB)))
    plain, slab, before = np.median(found, axis=0)
    assert slab < 1.05 * plain < 0.4 * before


SOLID = two_regions(6)
LEVEL = np.round(2.0 * SOLID.p[0, SOLID.t].mean(axis=0) + SOLID.p[2, SOLID.t].mean(axis=0))
ROUND = {  # powers of two have exact roots
    "triangles": (MeshTri().refined(4), np.random.default_rng(0).uniform(1.0, 9.0, 512), lambda density: density),
    "tetrahedra": (SOLID, 8.0**LEVEL, lambda density: 4.0**LEVEL),
}


@pytest.mark.parametrize("topology", ["flip", "recycle", "fixed"])
@pytest.mark.parametrize("schedule", [None, ka.Schedule(STAGES, sweeps=2)], ids=["sweeps", "map"])
@pytest.mark.parametrize(("mesh", "density", "factors"), ROUND.values(), ids=ROUND)
def test_round_tensors_give_the_mesh_of_the_density(mesh, density, factors, topology, schedule):
    tensors = factors(density)[:, None, None] * np.eye(len(mesh.p))
    plain, by_tensors = (ka.relocate(mesh, d, topology=topology, schedule=schedule) for d in (density, tensors))
    assert_array_equal(plain.p, by_tensors.p)
    assert_array_equal(plain.t, by_tensors.t)
