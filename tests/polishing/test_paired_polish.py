"""The polish beside periodic pairs, whose nodes stay."""

import numpy as np
import pytest
from helpers.descents import Start
from helpers.devices import machine
from helpers.meshes import apart, disk, perturbed, ring, square
from helpers.paired import sector

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value

LINES = {"left": (0, 0), "right": (0, 1), "low": (1, 0), "top": (1, 1)}
SIDES = {name: lambda x, i=i, at=at: x[i] == at for name, (i, at) in LINES.items()}


def cell():
    mesh = perturbed(square(5), 3).with_boundaries(SIDES)
    return mesh, {("left", "right"): -1, ("low", "top"): 1}, [("left", "right"), ("low", "top")]


def sixth():
    """A sector whose sides are uneven in radius."""
    return sector(5, np.pi / 3, power=1.3), {("first", "last"): -1}, [("first", "last")]


def folded():
    """A square whose left side is one with its lower one, mirrored in the diagonal: the mesh folds there."""
    mesh = perturbed(square(5), 3).with_boundaries(SIDES)
    mirror = ka.Reflection((0.0, 0.0), (1.0, -1.0))
    return mesh, {("left", "low"): 1}, [("left", "low", mirror)]


def circles():
    """A disc turned in a ring."""
    disc = disk(4, 0.02)
    mesh = apart(disc.with_boundaries({"rim": disc.boundary_facets()}), ring(24, 4, inner=0.02, outer=0.06))
    return mesh, {("0 rim", "1 inner"): 1}, [("0 rim", "1 inner", ka.Rotation(np.pi / 12))]


WORLDS = {"cell": cell, "sector": sixth, "folded": folded, "circles": circles}
each_world = pytest.mark.parametrize("world", WORLDS)


@pytest.mark.parametrize("order", [1, 2, 3])
@each_world
def test_pairs_stay_with_their_values_while_the_functional_falls(world, order):
    mesh, signs, periodic = WORLDS[world]()
    count = count_unknowns(mesh, order)
    values = np.random.default_rng(2).normal(size=count)
    ritz = ka.Ritz(values, np.zeros(count, bool), 1.3, 0.7, (0.3, -0.2), order=order, signs=signs)
    at = Start.of(mesh, ritz, Rules("flip", periodic=periodic).guarded())
    x, paired = at.movable.triangulation.position, at.movable.constraints.periodic.partner >= 0
    (place, value), before = (x.copy(), at.trial.values.copy()), at.value()
    assert 0.0 < at.sweep() <= (before - at.value()) * (1.0 + 1e-9)
    assert np.array_equal(x[paired], place[paired]) and np.array_equal(at.trial.values[paired], value[paired])
    assert np.any(x != place)
    at.recycle()
    assert np.isin(np.flatnonzero(paired), at.recycled.old).all()


def test_values_on_sides_that_are_no_pairs_of_the_mesh_are_given():
    mesh, problem = machine()
    ritz = problem.ritz(mesh, problem.solve(mesh))
    functional = Functional.of(ritz, MovableMesh.of(mesh, Rules()), mesh)
    nodes = np.unique(mesh.facets[:, np.concatenate([mesh.boundaries["left"], mesh.boundaries["right"]])])
    assert functional.solution.fixed[nodes].all() and not functional.sign.any()
    assert not np.asarray(ritz.fixed)[nodes].all()
    tight = ka.polish(mesh, problem)  # not told of the pairs: these stay where they are
    assert np.abs(tight.p[:, nodes] - mesh.p[:, nodes]).max() < 1e-15


@pytest.mark.parametrize(
    ("signs", "message"),
    [
        ([("left", "right", 1)], r"signs of Ritz must map pairs of names of boundaries to 1 or -1; got \["),
        ({"left": 1}, r"signs of Ritz must map pairs of names of boundaries to 1 or -1; got 'left': 1\."),
        (
            {("left", "right"): 0.5},
            r"to 1 or -1; got \('left', 'right'\): 0\.5\.",
        ),
        ({("left", "nowhere"): 1}, "nowhere"),
    ],
)
def test_signs_that_are_none_are_refused(signs, message):
    mesh = cell()[0]
    with pytest.raises(ValueError, match=message):
        functional_value(mesh, ka.Ritz(np.zeros(36), np.zeros(36, bool), 1.0, signs=signs))
