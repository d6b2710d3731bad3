"""Poisson's equation on clusters: both ways of solving it balance what flows, whatever the conductances."""

import numpy as np
import pytest
from scipy.sparse import diags_array

from kohonen_adapt.som.poisson import DIRECT, by_conjugate_gradients, potential
from kohonen_adapt.som.transport import symmetric

SIDE = 120  # of a square of clusters, so many that the equation is not solved directly


def square_of_clusters(contrast, scattered=False):
    """Clusters in rows, with a gap between two of these, and one that touches no other; conductances at random."""
    rng, count = np.random.default_rng(0), SIDE * SIDE + 1
    number = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    across = number[:, :-1].ravel(), number[:, 1:].ravel()
    upward = np.delete(number[:-1], 40, axis=0).ravel(), np.delete(number[1:], 40, axis=0).ravel()
    names = rng.permutation(count) if scattered else np.arange(count)
    row, column = (names[np.concatenate(ends)] for ends in zip(across, upward, strict=True))
    links = symmetric(10.0 ** rng.uniform(0.0, contrast, len(row)), row, column, count)
    inflow, low = np.zeros(count), names[number[:41].ravel()]
    inflow[names[:-1]] = rng.normal(size=count - 1)
    for part in (low, names[number[41:].ravel()]):
        inflow[part] -= inflow[part].mean()
    return links, inflow


def left_over(links, inflow, height):
    """What does not flow away, as a share of what flows in."""
    flows = height * links.sum(axis=0) - links @ height
    return np.linalg.norm(flows - inflow) / np.linalg.norm(inflow)


@pytest.mark.parametrize(("contrast", "scattered"), [(0.0, False), (2.0, False), (1.0, True)])
def test_conjugate_gradients_balance_what_flows_in(contrast, scattered):
    links, inflow = square_of_clusters(contrast, scattered)
    assert len(inflow) > DIRECT
    height = potential(links, inflow)
    assert left_over(links, inflow, height) < 1e-4
    assert np.array_equal(height, potential(links, inflow))


def test_what_they_do_not_solve_is_solved_directly():
    links, inflow = square_of_clusters(6.0, scattered=True)
    matrix = diags_array(links.sum(axis=0) + np.where(links.sum(axis=0) > 0.0, 0.0, 1.0)) - links
    assert by_conjugate_gradients(matrix.tocsr(), inflow) is None
    assert left_over(links, inflow, potential(links, inflow)) < 1e-4


def test_where_nothing_is_asked_for_nothing_flows():
    links, inflow = square_of_clusters(1.0)
    assert not potential(links, np.zeros_like(inflow)).any()
