"""Arcs of few nodes: what is one, and what stays a polygon."""

import numpy as np
import pytest
from helpers.meshes import circle, shells
from helpers.tensor_meshes import sector
from numpy.testing import assert_allclose
from skfem import MeshTri
from test_arcs import circles

import kohonen_adapt as ka

EIGHTH = np.pi / 4


def off_circle(mesh, radius):
    """How far nodes on the outer boundary near a circle about the origin are off it."""
    distance = np.hypot(*mesh.p[:, mesh.boundary_nodes()])
    sides = np.abs(np.angle(mesh.p[0] + 1j * mesh.p[1])[mesh.boundary_nodes()] / EIGHTH - 0.5) > 0.5 - 1e-9
    near = (np.abs(distance - radius) < 0.2 * radius) & ~sides
    return np.max(np.abs(distance[near] / radius - 1.0)), near.sum()


def eighth(facets, layers=6):
    core = {"core": (1.0, 2.2, 0.0, EIGHTH)}
    return sector(np.linspace(1.0, 3.0, layers), np.linspace(0.0, EIGHTH, facets + 1), core)


@pytest.mark.parametrize("facets", [3, 4])
def test_arcs_of_few_nodes_are_round_where_others_have_their_centre(facets):
    mesh = eighth(facets)
    assert_allclose(circles(mesh), [[0, 0, 1, 0], [0, 0, 2.2, 0], [0, 0, 3, 0]], atol=1e-12)


@pytest.mark.parametrize("facets", [3, 4])
def test_new_nodes_of_such_arcs_are_on_them(facets):
    grown = eighth(facets)
    for _ in range(3):
        grown = ka.relocate(grown, lambda x: np.hypot(*x) ** -4.0, topology="recycle")
    off, nodes = off_circle(grown, 1.0)
    assert off < 1e-9
    assert nodes >= facets - 1


def lone_bore(facets):
    """A sector of which no arc but the bore is round."""
    mesh = sector(np.linspace(1.0, 3.0, 6), np.linspace(0.0, EIGHTH, facets + 1), {})
    angle, radius = np.angle(mesh.p[0] + 1j * mesh.p[1]), np.hypot(*mesh.p)
    bent = 1.0 + 0.1 * (radius - 1.0) * np.sin(4.0 * angle) * np.where(angle < 0.3, 1.0, 2.0)
    return MeshTri(bent * mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)


def test_the_centre_about_which_sides_are_paired_is_one():
    mesh = lone_bore(4)
    assert len(circles(mesh)) == 0
    assert_allclose(circles(mesh, periodic=[("right", "left")]), [[0, 0, 1, 0]], atol=1e-12)


def test_so_is_that_of_an_arc_that_is_given():
    mesh = eighth(4)
    mesh = MeshTri(mesh.p, mesh.t, mesh.boundaries)
    given = {"outer": ka.Arc((0.0, 0.0), 3.0)}
    assert_allclose(circles(mesh, curves=given), [[0, 0, 1, 0], [0, 0, 3, 0]], atol=1e-12)


def test_a_chamfer_of_three_facets_is_no_arc():
    """Its four nodes are on a circle, as those of every other corner are, and all have other centres."""
    fillet = 0.3 * circle(12, np.pi / 4 - np.pi / 4)[:, :4] + 0.7
    corners = [np.linalg.matrix_power([[0, -1], [1, 0]], k) @ fillet for k in range(4)]
    rows = np.concatenate(corners, axis=1)
    assert len(circles(shells([0.5 * rows, rows], 3))) == 0
