"""Arcs of few nodes: what is one, and what stays a polygon."""

import numpy as np
import pytest
from helpers.meshes import circle, shells
from helpers.tensor_meshes import sector
from numpy.testing import assert_allclose
from test_arcs import circles

EIGHTH = np.pi / 4


def eighth(facets, layers=6):
    core = {"core": (1.0, 2.2, 0.0, EIGHTH)}
    return sector(np.linspace(1.0, 3.0, layers), np.linspace(0.0, EIGHTH, facets + 1), core)


@pytest.mark.parametrize("facets", [3, 4])
def test_arcs_of_few_nodes_are_round_where_others_have_their_centre(facets):
    mesh = eighth(facets)
    assert_allclose(circles(mesh), [[0, 0, 1, 0], [0, 0, 2.2, 0], [0, 0, 3, 0]], atol=1e-12)


def test_a_chamfer_of_three_facets_is_no_arc():
    """Its four nodes are on a circle, as those of every other corner are, and all have other centres."""
    fillet = 0.3 * circle(12, np.pi / 4 - np.pi / 4)[:, :4] + 0.7
    corners = [np.linalg.matrix_power([[0, -1], [1, 0]], k) @ fillet for k in range(4)]
    rows = np.concatenate(corners, axis=1)
    assert len(circles(shells([0.5 * rows, rows], 3))) == 0
