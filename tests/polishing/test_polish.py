"""`polish`: the error never grows, the geometry stays, and given values stay what they are."""

import numpy as np
import pytest
from helpers.linear_problems import assembled, solved
from helpers.meshes import generic_square, inset, junction, l_shape, perturbed, square
from helpers.scalar_problems import loaded, magnet, magnet_mesh
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value


class Diffusion:
    """-div(c grad u - g) = f with constants by region; u given at the left and the right end, nothing elsewhere."""

    def __init__(self, seed=0, contrast=100.0, load=1.0, left=lambda y: 0 * y, right=lambda y: 1 + 0 * y):
        rng = np.random.default_rng(seed)
        self.coefficient = contrast ** rng.uniform(0, 1, 9)
        self.source, self.flux = load * rng.normal(size=9), load * rng.normal(size=(2, 9))
        self.left, self.right = left, right

    def solve(self, mesh):
        number = Triangulation.of(mesh).elements.region
        given = self.coefficient[number], self.source[number], self.flux[:, number]
        return solved(*assembled(mesh, *given), *self.ends(mesh))

    def ritz(self, mesh, solution):
        number, fixed = Triangulation.of(mesh).elements.region, self.ends(mesh)[1]
        return ka.Ritz(solution, fixed, self.coefficient, self.source, self.flux, number)

    def ends(self, mesh):
        x, y = mesh.p
        left, right = x == x.min(), x == x.max()
        return np.where(left, self.left(y), self.right(y)), left | right


def functional_of(mesh, problem):
    """The functional of the solution on a mesh, and whether it may be compared."""
    ritz = problem.ritz(mesh, problem.solve(mesh))
    functional = Functional.of(ritz, MovableMesh.of(mesh, Rules()))
    return functional_value(mesh, ritz), functional.comparable


@pytest.mark.parametrize(
    "build, problem",
    [
        (lambda: magnet_mesh(20, False), magnet(iron=False)),
        (lambda: magnet_mesh(20, True), magnet()),
        (lambda: l_shape(8), loaded()),
    ],
    ids=["magnet", "magnet over iron", "example 22"],
)
@pytest.mark.parametrize("topology", ["flip", "fixed"])
def test_the_error_falls_and_goes_on_falling(build, problem, topology):
    mesh = build()
    errors = [problem.error(mesh, problem.solve(mesh))]
    for _ in range(3):
        mesh = ka.polish(mesh, problem, topology=topology)
        errors.append(problem.error(mesh, problem.solve(mesh)))
    assert errors[1] < 0.8 * errors[0]
    assert np.all(np.diff(errors) <= 1e-12)


@pytest.mark.parametrize("topology", ["flip", "fixed"])
def test_no_sweeps_change_nothing(topology):
    mesh = perturbed(inset(8), 2)
    result = ka.polish(mesh, Diffusion(2), sweeps=0, topology=topology)
    assert_array_equal(result.p, mesh.p)
    assert_array_equal(result.t, mesh.t)


class InOtherUnits(Diffusion):
    """The same with u in units of 2^-k and the functional in units of 2^-2: every term of it grows by 2^(2 + 2k)."""

    def __init__(self, exponent):
        super().__init__(3)
        self.unit = 2.0**exponent

    def solve(self, mesh):
        return self.unit * super().solve(mesh)

    def ritz(self, mesh, solution):
        given, load = super().ritz(mesh, solution), 4 * self.unit
        return ka.Ritz(
            solution, given.fixed, 4 * given.coefficient, load * given.source, load * given.flux, given.region
        )


@pytest.mark.parametrize("exponent", [-30, 30])
def test_units_do_not_matter(exponent):
    mesh = perturbed(junction(6), 4)
    one, other = ka.polish(mesh, Diffusion(3)), ka.polish(mesh, InOtherUnits(exponent))
    assert_array_equal(one.p, other.p)
    assert_array_equal(one.t, other.t)
    assert not np.array_equal(one.p, mesh.p)


def ends_of(mesh):
    return np.flatnonzero((mesh.p[0] == 0.0) | (mesh.p[0] == 1.0))


def test_nodes_with_given_values_slide_where_those_are_linear():
    mesh = square(8)
    problem = Diffusion(5, load=10.0, left=lambda y: 3 * y - 1)
    result = ka.polish(mesh, problem)
    ends = ends_of(mesh)
    assert np.array_equal(ends, ends_of(result))
    assert np.abs(result.p[1, ends] - mesh.p[1, ends]).max() > 0.01
    assert functional_of(mesh, problem)[1]


def test_nodes_with_other_given_values_stay():
    mesh = square(8)
    problem = Diffusion(5, load=10.0, left=lambda y: y**2)
    result = ka.polish(mesh, problem)
    left, right = mesh.p[0] == 0.0, mesh.p[0] == 1.0
    assert_array_equal(result.p[:, left], mesh.p[:, left])
    assert np.abs(result.p[1, right] - mesh.p[1, right]).max() > 0.01
    assert not functional_of(mesh, problem)[1]


class NoRitz:
    def solve(self, mesh):
        return np.zeros(mesh.p.shape[1])


class WrongRitz(NoRitz):
    def ritz(self, mesh, solution):
        return solution


class Quadratic(Diffusion):
    order = 2


@pytest.mark.parametrize(
    "problem, arguments, message",
    [
        (
            NoRitz(),
            {},
            r"polish requires the functional .*: NoRitz has no method ritz\(mesh, solution\)\.",
        ),
        (object(), {}, r"polish requires a problem with the method solve\(mesh\); object has none\."),
        (WrongRitz(), {}, r"ritz of the problem must return a kohonen_adapt\.Ritz; got ndarray\."),
        (
            Quadratic(),
            {},
            r"polish requires the functional .*: the order of Ritz is 1, the order of the problem is 2\.",
        ),
        (Diffusion(), {"sweeps": -1}, r"sweeps must be an integer >= 0; got -1\."),
        (Diffusion(), {"sweeps": True}, r"sweeps must be an integer >= 0; got True\."),
        (
            Diffusion(),
            {"topology": "recycle"},
            r"topology must be 'fixed' or 'flip', because polish keeps all nodes; got",
        ),
        (Diffusion(), {"seed": -1}, r"seed must be an integer >= 0; got -1\."),
    ],
)
def test_what_it_refuses(problem, arguments, message):
    with pytest.raises(ValueError, match=message):
        ka.polish(square(4), problem, **arguments)


class Level:
    """A straight line that is given as a curve of one's own."""

    def project(self, x):
        return np.stack([x[0], np.zeros_like(x[0])])


def test_nodes_slide_on_curves_of_ones_own():
    mesh, problem = generic_square(10).with_boundaries({"floor": lambda x: x[1] == 0.0}), Diffusion(5, load=30.0)
    own = ka.polish(mesh, problem, curves={"floor": Level()})
    floor = np.flatnonzero(mesh.p[1] == 0.0)
    assert np.any(own.p[0, floor] != mesh.p[0, floor]) and np.all(own.p[1, floor] == 0.0)
    assert functional_of(own, problem)[0] < functional_of(mesh, problem)[0]
