"""What faces cut off curved surfaces, counted: a bound of the true functional, which nodes on the surfaces descend."""

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.diffusion_solids import Diffusion, Rising
from helpers.magnet_solids import bar, nested_balls
from helpers.solids import volumes
from numpy.testing import assert_allclose
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

LAWS = {"linear": (), "laws": (Rising(2.0), None), "laws outside": (None, Rising())}


MESHES = {"ball": lambda: nested_balls(2), "bar": bar}
each_case = pytest.mark.parametrize(("name", "laws"), [("ball", "linear"), ("ball", "laws outside"), ("bar", "laws")])


def settled(mesh, laws=(), given=True, source=(0.0, 0.0), seed=0):
    """The mesh taken apart, with a solution of constants and fluxes of any kind."""
    rng, slope = np.random.default_rng(seed), np.array([0.5, -1.0, 2.0])
    values = {"outer": lambda x: 1.0 + slope @ x} if given else {}
    problem = Diffusion(10.0 ** rng.uniform(-1, 1, 2), source, rng.normal(size=(3, 2)), values, laws)
    movable = MovableSolid.of(mesh, Rules())
    ritz = problem.ritz(mesh, problem.solve(mesh))
    return movable, SolidFunctional.of(ritz, movable, mesh)


def on_curves(functional, movable):
    """Nodes that slide on curved patches whose slivers are counted, or at the ends of these."""
    elements, tet = movable.tetrahedralization.elements, movable.tetrahedralization
    e, k = np.nonzero(functional.faces.counted[elements.patch] & (elements.patch >= 0))
    found = np.zeros(tet.nnodes, dtype=bool)
    for j in range(3):
        found[elements.node[e, (k + 1 + j) % 4]] = True
    return found & (functional.freedom(movable.freedom, functional.solution.fixed).number != HELD)


def test_slivers_of_a_linear_function_have_the_volume_that_the_mesh_lacks():
    mesh = nested_balls(2)
    slope, coefficient, flux = np.array([1.0, -0.5, 2.0]), np.array([3.0, 1.0]), np.zeros((3, 2))
    problem = Diffusion(coefficient, [0.0, 0.0], flux, {"outer": lambda x: slope @ x})
    movable = MovableSolid.of(mesh, Rules())
    ritz = problem.ritz(mesh, slope @ mesh.p)
    functional = SolidFunctional.of(ritz, movable, mesh)
    ball = np.abs(volumes(mesh))[mesh.subdomains["ball"]].sum()
    lacking = 4.0 / 3.0 * np.pi - ball, 32.0 / 3.0 * np.pi - np.abs(volumes(mesh)).sum()
    # the ball lacks what is counted with the air's coefficient, the whole what goes on linearly beyond it
    exact = 0.5 * (slope @ slope) * ((coefficient[0] - coefficient[1]) * lacking[0] + coefficient[1] * lacking[1])
    tet = movable.tetrahedralization
    found = functional.faces.value(tet.position, tet.elements, slope @ mesh.p)
    assert functional.faces.counted.all() and functional.comparable
    assert found == pytest.approx(2.0 * exact, rel=0.02)


@each_case
def test_sweeps_lower_what_they_say_and_nodes_slide_on_their_surfaces(name, laws):
    movable, functional = settled(MESHES[name](), LAWS[laws])
    descent, slides = descent_of(movable, functional), on_curves(functional, movable)
    parts, before = descent.opened.parts(), descent.value()
    freedom = functional.freedom(descent.opened.mesh.freedom, descent.trial.fixed)
    start = descent.opened.mesh.position.copy()
    gain = sum(descent.sweep(parts, freedom) for _ in range(2))
    assert gain > 0.0 and before - descent.value() == pytest.approx(gain, rel=1e-6 if LAWS[laws] else 1e-9)
    rows = np.flatnonzero(slides)
    moved = descent.opened.mesh.position[rows] - start[rows]
    assert np.mean(np.linalg.norm(moved, axis=1) > 1e-4) > 0.05  # faces of this ball go far around already
    radius = np.linalg.norm(descent.opened.mesh.position[:, : 3 if name == "ball" else 2], axis=1)
    was = np.linalg.norm(start[:, : 3 if name == "ball" else 2], axis=1)
    assert_allclose(radius[rows], was[rows], rtol=1e-12)


def value(mesh, problem):
    """The functional of the solution with what is counted."""
    movable = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(problem.ritz(mesh, problem.solve(mesh)), movable, mesh)
    return functional.value(movable.tetrahedralization, functional.solution), functional


def test_where_slivers_are_not_known_nodes_on_surfaces_stay():
    ball = nested_balls(2)
    inner, outer = np.isclose(np.linalg.norm(ball.p, axis=0), 1.0), np.isclose(np.linalg.norm(ball.p, axis=0), 2.0)
    hollow = ball.restrict("air")
    hollow = MeshTet(hollow.p, hollow.t).with_subdomains({"air": lambda x: x[0] < 9.0})
    hole = hollow.with_boundaries({"hole": lambda x: np.linalg.norm(x, axis=0) < 1.5})
    within = np.isclose(np.linalg.norm(hole.p, axis=0), 1.0)
    flux, one = np.zeros((3, 2)), {"outer": lambda x: 1.0 + x[0]}
    cases = (
        (ball, Diffusion([1.0, 2.0], [1.0, 0.0], flux, one), inner, ~outer),  # a source ends there
        (ball, Diffusion([1.0, 2.0], [1.0, 1.0], flux, one), outer, inner),  # one goes on, with values other than 0
        (ball, Diffusion([1.0, 2.0], [0.0, 0.0], flux, {"outer": lambda x: x[0] * x[1]}), outer, inner),
        (hole, Diffusion([1.0], [0.0], flux[:, :1], {"hole": lambda x: x[0]}), within, ~within),  # chords cut into it
    )
    for mesh, problem, stays, moves in cases:
        after = ka.polish(mesh, problem, topology="fixed", sweeps=2)
        step = np.linalg.norm(after.p - mesh.p, axis=0)
        assert not step[stays].any() and step[moves].max() > 1e-4
        assert not value(mesh, problem)[1].comparable
