"""What holds for every relocated mesh: symmetries, worth, determinism, names and bytes."""

from functools import cache

import numpy as np
import pytest
from helpers.meshes import (
    SHAPES,
    peak,
    square,
)
from helpers.stand_ins import Script
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Schedule, Stage
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.training_points import density_of

TOPOLOGIES = pytest.mark.parametrize("topology", ["fixed", "flip", "recycle"])


def pull(mesh):
    """A density with a peak on the outline and one inside."""
    x, y = mesh.p[:, mesh.boundary_nodes()[0]]
    return peak(mesh, x, y, 300) + peak(mesh, 0.4, 0.6, 100)


def worth(mesh, density, old_mesh, seed=0):
    """Mean quality, and the mean distance of many points of the density to their nearest nodes."""
    points = density_of(Triangulation.of(old_mesh), density).draw(4000, np.random.default_rng(seed)).points
    return np.array([ka.quality(mesh).mean(), mean_distance(mesh, points)])


def mean_distance(mesh, points):
    return cKDTree(mesh.p.T).query(points)[0].mean()


@pytest.mark.parametrize("kind", SHAPES)
def test_no_epochs_and_no_sweeps_move_no_node(kind):
    mesh = SHAPES[kind]
    for schedule in (Schedule(()), Schedule((Stage(2, 0, 0.3),))):
        same = ka.relocate(mesh, pull(mesh), topology="fixed", schedule=schedule)
        assert same.p.tobytes() == mesh.p.tobytes()
        assert same.t.tobytes() == mesh.t.tobytes()
        for name, rows in (mesh.boundaries or {}).items():
            assert_array_equal(np.asarray(same.boundaries[name]), np.sort(rows))
            assert (
                getattr(same.boundaries[name], "ori", np.zeros(0)).tolist()
                == getattr(rows, "ori", np.zeros(0)).tolist()
            )
        assert ka.relocate(mesh, pull(mesh), topology="flip", schedule=schedule).p.tobytes() == mesh.p.tobytes()


@TOPOLOGIES
@pytest.mark.parametrize("kind", ["delaunay", "named", "arcs"])
@pytest.mark.parametrize("way", [(3.0, -7.0), (0.1, 1 / 3)])
def test_a_mesh_translated_gives_the_translated_mesh(way, kind, topology):
    mesh = SHAPES[kind]
    plain = ka.relocate(mesh, pull(mesh), topology=topology)
    moved = ka.relocate(mesh.translated(way), pull(mesh), topology=topology)
    assert np.abs(moved.p - np.array(way)[:, None] - plain.p).max() < 1e-9
    assert_array_equal(moved.t, plain.t)


def turned(mesh, density, seed):
    angle = 0.3 + seed
    return MeshTri(
        np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ mesh.p, mesh.t
    ), density


def mirrored(mesh, density, seed):
    return MeshTri(mesh.p[::-1], mesh.t), density


def renumbered(mesh, density, seed):
    rng = np.random.default_rng(seed)
    nodes, elements = rng.permutation(mesh.p.shape[1]), rng.permutation(mesh.t.shape[1])
    return MeshTri(mesh.p[:, nodes], np.argsort(nodes)[mesh.t[:, elements]]), density[elements]


@TOPOLOGIES
@pytest.mark.parametrize("kind", ["delaunay", "l"])
@pytest.mark.parametrize("change", [turned, mirrored, renumbered])
def test_a_mesh_turned_mirrored_or_renumbered_gives_one_of_the_same_worth(change, kind, topology):
    assert_allclose(typical_worth(kind, topology, change), typical_worth(kind, topology), rtol=0.05)


@cache
def typical_worth(kind, topology, change=lambda mesh, density, seed: (mesh, density)):
    """The median over seeds, of a mesh as it is or changed."""
    mesh, found = SHAPES[kind], []
    for seed in range(3):
        own, density = change(mesh, pull(mesh), seed)
        found.append(worth(ka.relocate(own, density, topology=topology, seed=seed), density, own))
    return np.median(found, axis=0)


def test_a_mesh_stretched_as_a_whole_names_the_min_quality_that_helps(caplog):
    mesh = MeshTri().refined(4).scaled((100.0, 1.0))
    density = lambda x: 1.0 / (0.1 + x[0] / 100.0)  # noqa: E731
    assert np.array_equal(ka.relocate(mesh, density).p, mesh.p)
    assert caplog.messages[-1] == (
        "relocate moved no node: every move would have broken the quality rule: the worst element has a quality of "
        "0.017, min_quality is 0.3, and nothing below that may get worse. Give min_quality=0.0087."
    )
    assert np.abs(ka.relocate(mesh, density, min_quality=0.0087).p - mesh.p).max() > 10.0
    result = ka.adapt(mesh, Script([1.0, 1.0]), polish=False, topology="flip")
    assert result.status is ka.Status.NOT_MOVED
    assert "Give min_quality=0.0087. Best: the input, " in result.message


def test_a_relocation_that_moves_nothing_says_so(caplog):
    mesh = MeshTri().refined(2)
    with caplog.at_level("WARNING", logger="kohonen_adapt"):
        ka.relocate(mesh, np.ones(mesh.nelements), topology="fixed", pinned=range(mesh.p.shape[1]))
    assert caplog.messages == ["relocate moved no node: every node is a corner or pinned."]
    caplog.clear()
    ka.relocate(mesh, np.ones(mesh.nelements), schedule=ka.Schedule(()))
    assert not caplog.messages


@TOPOLOGIES
def test_nodes_go_where_the_density_is(topology):
    mesh = square(12)
    density = peak(mesh, 0.3, 0.4, 200, 0.2)
    result = ka.relocate(mesh, density, topology=topology)
    points = density_of(Triangulation.of(mesh), density).draw(3000, np.random.default_rng(0)).points
    assert mean_distance(result, points) < 0.85 * mean_distance(mesh, points)
