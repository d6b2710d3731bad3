"""`polish`: the error never grows, the geometry stays, and given values stay what they are."""

import numpy as np
import pytest
from helpers.linear_problems import assembled, solved
from helpers.meshes import junction, l_shape, perturbed, square
from helpers.scalar_problems import loaded, magnet, magnet_mesh
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.mesh.triangulation import Triangulation


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
