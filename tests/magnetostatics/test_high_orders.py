"""Elements of order 4 to 8 against exact fields, scikit-fem's elements and their own estimates."""

import numpy as np
import pytest
from helpers.curved_meshes import with_midsides
from helpers.exact_fields import HALF, RECTANGLE, rectangle_mesh, sheet_field
from helpers.own_curves import Ellipse
from helpers.sheets import MU0
from scipy.special import iv
from skfem import Basis, ElementTriP1, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import NotOffered
from kohonen_adapt.magnetostatics import FluxLinkage, Magnetostatics, Material

ORDERS = range(4, 9)


@pytest.mark.parametrize("axisymmetric", [False, True])
def test_smooth_fields_converge_exponentially(axisymmetric):
    """Bessel's field around an axis, and ``sinh(k y) sin(k x)`` in the plane across an antiperiodic pair."""
    k, grid = np.pi, np.linspace(0.0, 1.0, 4)
    mesh = MeshTri.init_tensor(grid, grid).with_defaults().with_subdomains({"air": lambda x: x[0] > -1.0})

    def exact(x):
        return iv(1, k * x[0]) * np.sin(k * x[1]) if axisymmetric else np.sinh(k * x[1]) * np.sin(k * x[0])

    x, errors = np.random.default_rng(2).random((2, 200)), []
    for order in ORDERS:
        sides = ["right", "bottom", "top"] if axisymmetric else ["bottom", "top"]
        pairs = [] if axisymmetric else [("left", "right")]
        problem = Magnetostatics(
            {"air": Material()}, dict.fromkeys(sides, exact), axisymmetric=axisymmetric, antiperiodic=pairs, order=order
        )
        errors.append(np.abs(problem.solve(mesh).potential_at(x) - exact(x)).max())
    assert np.all(np.divide(errors[1:], errors[:-1]) < 0.12)


@pytest.mark.parametrize("layers", [0, 3])
@pytest.mark.parametrize("order", [4, 6])
def test_estimates_are_near_the_error_of_singular_fields(order, layers):
    mesh = rectangle_mesh(1)
    corners = np.flatnonzero(np.all(np.isclose(np.abs(mesh.p.T), HALF), axis=1))
    mesh = ka.refined_at(mesh, corners, layers=layers) if layers else mesh
    problem = Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=order)
    field = problem.solve(mesh)
    told = np.linalg.norm(problem.indicators(mesh, field))
    assert 0.85 < told / error_at_corners(field, corners) < 1.25


def error_at_corners(field, corners):
    """The error in the energy norm, by a rule that is fine at the corners."""
    basis = Basis(ka.refined_at(field.mesh, corners, layers=6), ElementTriP1(), intorder=12)
    x = np.asarray(basis.global_coordinates())
    difference = field.flux_density_at(x.reshape(2, -1)) - sheet_field(x.reshape(2, -1))
    return np.sqrt(np.sum(np.sum(difference**2, axis=0).reshape(x.shape[1:]) * basis.dx) / MU0)


def test_a_goal_has_indicators_and_an_error():
    mesh = rectangle_mesh(1)
    goal = FluxLinkage({next(iter(RECTANGLE.materials)): 1})
    problem, finer = (
        Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=order, goal=goal) for order in (4, 8)
    )
    field = problem.solve(mesh)
    error = goal(finer.solve(mesh)) - goal(field)
    assert problem.goal_error(field) == pytest.approx(error, rel=0.5)
    assert np.sum(problem.indicators(mesh, field) ** 2) > 0.5 * abs(error)
    with pytest.raises(NotOffered, match="elements of order 4 are not polished"):
        problem.ritz(mesh, field)


@pytest.mark.parametrize("order", [0, 9, 2.5, "5"])
def test_the_order_of_a_solve_is_checked(order):
    with pytest.raises(ValueError, match=rf"must be a whole number from 1 to 8; got {order!r}"):
        Magnetostatics(RECTANGLE.materials, RECTANGLE.potential).solve(rectangle_mesh(1), order=order)


def elliptic_conductor():
    circle = MeshTri.init_circle(2, smoothed=False)
    mesh = MeshTri(circle.p * np.array([[2.0], [1.0]]), circle.t)
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()}).with_subdomains({"wire": lambda x: x[0] < 9.0})

    def place(mesh, facets):
        middle = mesh.p[:, mesh.facets].mean(axis=1)
        middle[:, mesh.boundaries["rim"]] = Ellipse(2.0, 1.0).project(middle[:, mesh.boundaries["rim"]])
        return middle

    return with_midsides(mesh, place)


def test_sides_follow_a_curve_that_is_known_by_its_projection():
    """In an elliptic conductor A is a polynomial of degree 2 that is zero on the ellipse."""
    mesh, errors, x = elliptic_conductor(), {}, np.random.default_rng(3).uniform(-0.6, 0.6, (2, 50))
    exact = MU0 * 1e6 / 2.0 * (4.0 / 5.0) * (1.0 - x[0] ** 2 / 4.0 - x[1] ** 2)
    for sides in (None, {"rim": Ellipse(2.0, 1.0)}):
        for order in (4, 6, 8):
            given = {"materials": {"wire": Material(current_density=1e6)}, "potential": {"rim": 0.0}}
            field = Magnetostatics(**given, order=order, sides=sides).solve(mesh)
            errors[sides is None, order] = np.abs(field.potential_at(x) - exact).max() / exact.max()
    assert errors[False, 8] < 1e-7 < 1e-6 < errors[True, 8]
    assert errors[False, 8] < 0.1 * errors[False, 6] < 0.01 * errors[False, 4]


def test_wrong_sides_are_named():
    with pytest.raises(ValueError, match="sides must map boundary names to curves with a method project; got"):
        Magnetostatics({"air": Material()}, {"rim": 0.0}, sides={"rim": 1.0})
    problem = Magnetostatics({"wire": Material()}, {"rim": 0.0}, order=4, sides={"ring": Ellipse(2.0, 1.0)})
    with pytest.raises(ValueError, match="boundary 'ring' is not in the mesh; it has 'rim'"):
        problem.solve(elliptic_conductor())
