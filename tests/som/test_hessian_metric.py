"""Metrics from recovered derivatives are exact for polynomials, round without curvature, and of equal nodes."""

from functools import reduce
from math import factorial

import numpy as np
import pytest
from helpers.meshes import centres, perturbed, square
from helpers.solids import halved_cube
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from skfem import MeshTet, MeshTri

from kohonen_adapt import density_from_indicators, metric_from_hessian
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.som.derivatives import highest_derivatives

NODES = {2: 2 / np.sqrt(3), 3: np.sqrt(2)}  # per volume in the metric
FINER = {2: perturbed(square(7), worst=0.1), 3: MeshTet().refined(3)}
MESHES = {2: perturbed(square(9)), 3: halved_cube((6, 6, 6), 0, seed=1)}
dimensions = pytest.mark.parametrize("dim", [2, 3])


def turned_by(dim, seed):
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    return turn if dim == 3 else np.linalg.qr(turn[:2, :2])[0]


STRETCHES = {1: 2 ** (1 / 3), 2: 1.24, 3: 1.17}  # of edges in the ratio of 2


def stretched(roots):
    """Eigenvalues of the shape for gradients, from roots of eigenvalues of the Hessian."""
    ratio = roots / roots.max()
    return (ratio * np.maximum(np.cbrt(ratio), 1 / 1.37)) ** 2


def shape_of(metric):
    return metric / np.linalg.det(metric)[:, None, None] ** (1 / metric.shape[1])


def ratio_of(metric):
    values = np.linalg.eigvalsh(metric)
    return np.sqrt(values[:, -1] / values[:, 0])


def nodes_of(mesh, metric):
    return NODES[len(mesh.p)] * np.sum(area(mesh) * np.sqrt(np.linalg.det(metric)))


def mapped(mesh, matrix):
    return type(mesh)(matrix @ mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)


@dimensions
@given(seed=st.integers(0, 2**32 - 1), signs=st.tuples(*[st.sampled_from([-1, 1])] * 3))
def test_the_shape_of_a_quadratic_is_exact_in_any_direction(dim, seed, signs):
    mesh, turn = MESHES[dim], turned_by(dim, seed)
    values = 10 ** np.random.default_rng(seed).uniform(-0.5, 0.5, dim)
    hessian = turn * (values * signs[:dim]) @ turn.T
    u = 0.5 * np.einsum("in,ij,jn->n", mesh.p, hessian, mesh.p) + mesh.p[0] + 3.0
    wanted = turn * stretched(np.sqrt(values)) @ turn.T
    wanted /= np.linalg.det(wanted) ** (1 / dim)
    metric = metric_from_hessian(mesh, u)
    assert_allclose(shape_of(metric), np.broadcast_to(wanted, metric.shape), rtol=0, atol=1e-5 * wanted.max())
    assert nodes_of(mesh, metric) == pytest.approx(mesh.nvertices, rel=1e-9)
    density = np.sqrt(np.linalg.det(metric))
    assert density.max() == pytest.approx(density.min(), rel=1e-5)


@pytest.mark.parametrize("cells", [16, 32])
def test_edges_along_a_straight_layer_are_bounded(cells):
    mesh = square(cells)
    metric = metric_from_hessian(mesh, np.exp(-mesh.p[0] / 0.05))
    shortest, longest = np.median(np.linalg.eigvalsh(metric[centres(mesh)[0] < 0.1]) ** -0.5, axis=0)[::-1]
    assert 0.2 < longest < 0.5
    assert longest > 100 * shortest


@dimensions
@pytest.mark.parametrize("order", [2, 3, 4])
def test_derivatives_of_polynomials_are_exact(dim, order):
    mesh = FINER[dim]
    direction = np.arange(1.0, dim + 1)
    values = (direction @ mesh.p + 0.5) ** order + mesh.p[0]
    derivatives, found = highest_derivatives(mesh, np.zeros(mesh.nelements, dtype=np.int64), values, order)
    wanted = factorial(order) * reduce(np.multiply.outer, [direction] * order)
    assert found.mean() > 0.9
    assert_allclose(derivatives[found], np.broadcast_to(wanted, derivatives[found].shape), rtol=5e-3)


@dimensions
@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_it_turns_with_the_mesh_and_scales_with_lengths_only(dim, scale):
    mesh, turn = MESHES[dim], turned_by(dim, 3)
    u, eta = np.tanh(5 * (mesh.p[0] - 0.3 * mesh.p[1] ** 2)), np.linspace(1, 2, mesh.nelements)
    for indicators in (None, eta):
        metric = metric_from_hessian(mesh, u, indicators)
        other = metric_from_hessian(mapped(mesh, scale * turn), 1e7 * u, indicators)
        assert_allclose(scale**2 * turn.T @ other @ turn, metric, rtol=1e-5, atol=1e-6 * metric.max())


@pytest.mark.parametrize(
    "mesh",
    [
        MeshTri(),
        MeshTet(),
        MeshTri.init_tensor(np.linspace(0, 1, 9), np.array([0.0, 0.1])),
        MeshTet.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 1, 5), np.array([0.0, 0.1])),
        square(3).with_subdomains({str(k): np.array([k]) for k in range(18)}),
    ],
    ids=["two triangles", "five tetrahedra", "a layer of triangles", "a layer of tetrahedra", "regions of one element"],
)
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_elements_are_round_if_nothing_can_be_recovered(mesh, order):
    metric = metric_from_hessian(mesh, np.cos(3 * mesh.p[0]) * mesh.p[1], order=order)
    assert_allclose(ratio_of(metric), 1.0)
    assert nodes_of(mesh, metric) == pytest.approx(mesh.nvertices)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_indicators_of_elements_of_the_right_shape_count_as_they_are(order, ratio):
    equilateral = mapped(square(9), np.array([[1.0, -0.5], [0.0, np.sqrt(0.75)]]))
    longer = STRETCHES[order] if ratio > 1 else 1.0
    mesh = mapped(equilateral, np.diag(np.sqrt(ratio * longer) ** np.array([-1.0, 1.0])))
    eta = np.linspace(1, 2, mesh.nelements)
    metric = metric_from_hessian(mesh, np.array([ratio**2, 1.0]) @ mesh.p**2, eta, order=order)
    assert ratio_of(metric) == pytest.approx(ratio * longer, rel=1e-6)
    density = NODES[2] * np.sqrt(np.linalg.det(metric))
    assert_allclose(density, density_from_indicators(mesh, eta, order=order), rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"values": np.zeros(8)}, r"values must have shape \(nvertices,\) = \(9,\); got \(8,\)"),
        ({"values": np.full(9, 1j)}, "values must be real numbers; got complex128"),
        ({"values": np.where(np.arange(9) == 4, np.inf, 1.0)}, "values must be finite; .* first 4"),
        ({"values": np.zeros(9), "order": 0}, "order must be the degree of the elements, 1 to 4; got 0"),
        ({"values": np.zeros(9), "norm": "H1"}, "norm must be 'energy' or 'L2'; got 'H1'"),
        ({"values": np.zeros(9), "indicators": -np.ones(8)}, "indicators must be finite and >= 0; element 0 has -1.0"),
    ],
)
def test_bad_input_gets_one_line(arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        metric_from_hessian(square(2), **arguments)
    assert "\n" not in str(error.value)


HALVES = {
    2: square(6).with_subdomains({"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}),
    3: halved_cube((6, 4, 4), 0),
}


@dimensions
def test_a_kink_at_an_interface_is_no_curvature(dim):
    mesh = HALVES[dim]
    kink = np.abs(mesh.p[0] - 0.5) + mesh.p[1]
    assert ratio_of(metric_from_hessian(mesh, kink)).max() == pytest.approx(1.0)
    assert ratio_of(metric_from_hessian(type(mesh)(mesh.p, mesh.t), kink)).max() > 5.0
