"""Passes that are compared by estimates count what their sides and faces cut off curves."""

import numpy as np
import pytest
from helpers.meshes import centres, ring
from helpers.random_solids import ball, bar

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area

GAIN = 1e-4


class Nearby:
    """Errors near a point, whose estimate is better by a ten-thousandth after every pass."""

    def __init__(self, point):
        self.point, self.solves = np.asarray(point)[:, None], 0

    def solve(self, mesh):
        self.solves += 1
        return self.solves

    def indicators(self, mesh, solution):
        centre = centres(mesh)
        density = 1e-3 + np.exp(-np.sum((centre - self.point) ** 2, axis=0) / 0.1)
        eta = density * area(mesh) ** (0.5 + 1 / len(mesh.p))
        return (1.0 - GAIN * solution) * eta / np.linalg.norm(eta)


def plane_ring():
    return ring(40, 4), {}, 0.75 * np.pi, (1.0, 0.0)


def solid(build, volume, point):
    mesh, surface = build(6)
    return mesh, {"surfaces": {"side": surface}}, volume, point


BODIES = {
    "ring": plane_ring,
    "ball": lambda: solid(ball, 4 / 3 * np.pi, (1.0, 0.0, 0.0)),
    "bar": lambda: solid(bar, np.pi, (1.0, 0.0, 0.5)),
}


def cut_off(record, whole):
    """The area or volume of the body that is no part of the mesh."""
    return whole - area(record.mesh).sum()


@pytest.mark.parametrize(
    ("body", "topology"), [("ring", "fixed"), ("ring", "flip"), ("ball", "fixed"), ("ball", "flip"), ("bar", "flip")]
)
def test_a_body_cut_down_is_not_bought_with_an_estimate_that_is_hardly_better(body, topology):
    mesh, options, whole, point = BODIES[body]()
    result = ka.adapt(mesh, Nearby(point), passes=3, topology=topology, **options)
    cut = np.array([cut_off(step, whole) for step in result.history])
    assert np.all(np.diff([step.estimate for step in result.history]) < 0)
    assert cut.max() > 1.2 * cut.min()
    assert cut[result.best.number] < 1.05 * cut.min()


@pytest.mark.parametrize("body", BODIES)
def test_what_is_cut_off_is_told_by_the_measure(body):
    """With one error density everywhere the measure is that of the whole body, but for what is cut off the far side."""
    mesh, options, whole, _ = BODIES[body]()

    class Even:
        def solve(self, mesh):
            return None

        def indicators(self, mesh, solution):
            return np.sqrt(area(mesh))

    (step,) = ka.adapt(mesh, Even(), passes=0, **options).history
    assert step.estimate**2 == pytest.approx(area(mesh).sum())
    convex = whole if body != "ring" else area(mesh).sum() + np.pi * 1.25 * (1 - np.sin(np.pi / 20) / (np.pi / 20))
    assert step.worth**2 == pytest.approx(convex, rel=0.01)
    assert step.worth**2 - step.estimate**2 == pytest.approx(convex - area(mesh).sum(), rel=0.1)


def test_a_polygon_cuts_off_nothing():
    (step,) = ka.adapt(ring(8, 2), Nearby((1.0, 0.0)), passes=0).history
    assert step.worth == step.estimate
