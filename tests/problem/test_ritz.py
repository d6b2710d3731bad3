"""The functional as stated, in terms of a triangulation, and its solution carried to where nodes have gone."""

import numpy as np
import pytest
from helpers.meshes import SHAPES, inset, junction, l_shape, on_rim, slit, square
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Ritz, Rules, Schedule, Stage
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, SLIDING
from kohonen_adapt.mesh.locate import Locator
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Draw, density_of

ZEROS, FIXED, REGION = np.zeros(4), np.array([True, False, False, False]), np.array([0, 1])


def functional_for(mesh, values, fixed):
    return Functional.of(Ritz(values, fixed, 1.0), MovableMesh.of(mesh, Rules()))


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((np.zeros((2, 2)), FIXED, 1.0), r"values of Ritz must have shape \(nunknowns,\); got \(2, 2\)\."),
        ((ZEROS * 1j, FIXED, 1.0), r"values of Ritz must be real numbers; got complex128\."),
        ((ZEROS + np.nan, FIXED, 1.0), r"values of Ritz must be finite; 4 of 4 are not\."),
        (
            (ZEROS, [0, 1], 1.0),
            r"fixed of Ritz must be bool of shape .* = \(4,\); got int64 of shape \(2,\)",
        ),
        (
            (ZEROS, FIXED[:3], 1.0),
            r"fixed of Ritz must be bool of shape .* = \(4,\); got bool of shape \(3,\)",
        ),
        ((ZEROS, FIXED), r"coefficient of Ritz is missing: .* if every region has a law, give coefficient=1\.0\."),
        ((ZEROS, FIXED, 0.0), r"coefficient of Ritz must be > 0; got 0\.0\."),
        ((ZEROS, FIXED, [1.0, -2.0], 0.0, (0.0, 0.0), REGION), r"coefficient of Ritz must be > 0; got -2\.0\."),
        ((ZEROS, FIXED, "iron"), r"coefficient of Ritz must be real numbers"),
        ((ZEROS, FIXED, np.inf), r"coefficient of Ritz must be finite; 1 of 1 are not\."),
        ((ZEROS, FIXED, [1.0, 2.0]), r"coefficient of Ritz is a table of 2 values and requires region"),
        ((ZEROS, FIXED, 1.0, 0.0, 1.0), r"flux of Ritz must have shape \(2,\) or \(2, nregions\), on .* got \(\)\."),
        ((ZEROS, FIXED, 1.0, 0.0, np.zeros((4, 2)), REGION), r"flux of Ritz must have shape .* got \(4, 2\)\."),
        ((ZEROS, FIXED, 1.0, 0.0, np.zeros((3, 2, 1)), REGION), r"flux of Ritz must have shape .* got \(3, 2, 1\)\."),
        (
            (ZEROS, FIXED, 1.0, [[1.0]], (0.0, 0.0), REGION),
            r"source of Ritz must have shape \(\) or \(nregions,\)",
        ),
        (
            (ZEROS, FIXED, 1.0, [1.0, 2.0], (0.0, 0.0), [0, 2]),
            r"source of Ritz must have a value for every region number from 0 to 2; got 2 values\.",
        ),
        (
            (ZEROS, FIXED, 1.0, 0.0, (0.0, 0.0), [0.0, 1.0]),
            r"region of Ritz must be integers of shape \(nelements,\)",
        ),
        ((ZEROS, FIXED, 1.0, 0.0, (0.0, 0.0), [0, -1]), r"region of Ritz must hold numbers >= 0; got -1\."),
    ],
)
def test_what_a_functional_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        Ritz(*arguments)


def test_a_functional_keeps_its_own_numbers():
    values = np.zeros(4)
    ritz = Ritz(values, FIXED, 1)
    values[:] = 7.0
    assert ritz.values.max() == 0.0


def test_a_functional_of_another_mesh_is_refused():
    mesh = inset(4)
    movable = MovableMesh.of(mesh, Rules())
    n, m = mesh.nvertices, mesh.nelements
    fixed = np.zeros(n, dtype=bool)
    with pytest.raises(ValueError, match=r"values of Ritz must have shape \(nnodes,\) = \(25,\); got \(4,\)\."):
        Functional.of(Ritz(ZEROS, FIXED, 1.0), movable)
    with pytest.raises(ValueError, match=r"region of Ritz must have shape \(nelements,\) = \(32,\); got \(2,\)\."):
        Functional.of(Ritz(np.zeros(n), fixed, 1.0, region=REGION), movable)
    number = np.zeros(m, dtype=int)
    number[mesh.subdomains["core"]] = 1
    Functional.of(Ritz(np.zeros(n), fixed, 1.0, region=number), movable)
    number[mesh.subdomains["core"][2]] = 0
    with pytest.raises(ValueError, match=r"constant on each region of the mesh; elements \d+ and \d+ are"):
        Functional.of(Ritz(np.zeros(n), fixed, 1.0, region=number), movable)


def test_constants_stay_with_their_regions_wherever_nodes_and_edges_go():
    mesh, rng = junction(6), np.random.default_rng(0)
    number = np.full(mesh.nelements, 2)
    for k, rows in enumerate(mesh.subdomains.values()):
        number[rows] = k
    coefficient, source, flux = rng.uniform(1, 9, 3), rng.normal(size=3), rng.normal(size=(2, 3))
    movable = MovableMesh.of(mesh, Rules())
    n = mesh.nvertices
    ritz = Ritz(np.zeros(n), np.zeros(n, dtype=bool), coefficient, source, flux, number)
    functional = Functional.of(ritz, movable)
    learn(movable, lambda x: 1 / (0.1 + np.hypot(*x)))
    after = movable.mesh()
    assert not np.array_equal(after.t, mesh.t)
    for k, rows in enumerate(after.subdomains.values()):  # at a junction elements may have changed sides
        number[rows] = k
    data = np.column_stack([coefficient, source, flux.T])[number]
    ours = functional.constants[movable.triangulation.elements.region]
    assert_array_equal(ours, data)


def test_nodes_whose_given_values_no_formula_carries_are_held():
    mesh = square(6)
    x, y = mesh.p
    inside, left, floor = (x == 0.5) & (y == 0.5), x == 0.0, y == 0.0
    outline = MovableMesh.of(mesh, Rules()).outline
    fixed = left | inside | floor
    functional = functional_for(mesh, np.where(left, y**2, x), fixed)
    before, after = outline.constraints.kind, functional.kinds(outline, fixed)
    assert set(np.flatnonzero(before != after)) == set(np.flatnonzero((left & (y > 0) & (y < 1)) | inside))
    assert np.all(after[before != after] == HELD)


each_mesh = pytest.mark.parametrize("name", ["square", "delaunay", "inset", "named", "l"])


def learn(movable, density):
    """Train with points of a density, a callable, as a map does."""
    schedule, rng = Schedule.default(movable.nnodes, topology="flip"), np.random.default_rng(0)
    Trainer.of(movable).learn(density_of(movable.triangulation, density).draw, schedule, rng)


def carried_by(mesh, ritz, change, rules=None):
    """The mesh after a change of the movable mesh, and the values and what is given at its nodes."""
    movable = MovableMesh.of(mesh, rules or Rules())
    functional, before = Functional.of(ritz, movable), movable.copy()
    start_element = unchanged(movable.triangulation).start_element
    change(movable)
    return movable, *transferred(functional, before, movable, start_element)[:2]


@each_mesh
def test_where_nothing_moved_a_solution_is_what_it_was(name):
    mesh = SHAPES[name]
    rng = np.random.default_rng(0)
    ritz = Ritz(rng.normal(size=mesh.nvertices), on_rim(mesh), 1.0)
    _, values, fixed = carried_by(mesh, ritz, lambda movable: None)
    assert_allclose(values, ritz.values, atol=1e-12)
    assert_array_equal(fixed, ritz.fixed)


@each_mesh
def test_where_nodes_moved_a_solution_is_what_it_was_there(name):
    mesh = SHAPES[name]
    ritz = Ritz(np.sin(3 * mesh.p[0]) * mesh.p[1], on_rim(mesh), 1.0)
    movable, values, fixed = carried_by(
        mesh, ritz, lambda movable: learn(movable, lambda x: 1 / (0.001 + np.abs(x[0] * x[1])))
    )
    after = movable.mesh()
    assert np.abs(after.p - mesh.p).max() > 0.1
    assert_allclose(values, ka.interpolate(mesh, ritz.values, after.p), atol=1e-9)
    assert_array_equal(np.flatnonzero(fixed), np.sort(after.boundary_nodes()))


def test_a_corner_keeps_what_is_given_there_whichever_node_is_in_it():
    mesh = square(6)
    rules = Rules("fixed", min_quality=0.1)
    kind = MovableMesh.of(mesh, rules).constraints.kind
    ritz = Ritz(mesh.p[0] + 2 * mesh.p[1], mesh.p[0] == 0.0, 1.0)

    def pull_at_the_corner(movable):
        point = np.array([[0.07, 0.02]])
        element = Locator(movable.triangulation).find(point)
        shown = Draw(point, element, movable.triangulation.elements.region[element], np.ones(1))
        once = Schedule((Stage(0, 1, 1.0),))
        Trainer.of(movable).learn(lambda number, rng: shown, once, np.random.default_rng(0))

    movable, values, fixed = carried_by(mesh, ritz, pull_at_the_corner, rules)
    x, y = movable.mesh().p
    assert np.any((kind == HELD) & (movable.constraints.kind == SLIDING))  # a corner was handed over
    assert_array_equal(fixed, x == 0.0)
    assert_allclose(values, x + 2 * y, atol=1e-12)


def test_given_values_that_are_linear_are_looked_up_on_their_chain():
    mesh = square(8)
    x, y = mesh.p
    left = x == 0.0
    ritz = Ritz(np.where(left, 2 * y - 1, 5 * np.sin(9 * x)), left, 1.0)
    movable, values, fixed = carried_by(mesh, ritz, lambda movable: learn(movable, lambda x: x[0] < 0.3))
    x, y = movable.mesh().p
    assert np.any((x == 0.0) & (y != mesh.p[1]))
    assert_array_equal(fixed, x == 0.0)
    assert_allclose(values[fixed], 2 * y[fixed] - 1, rtol=0, atol=1e-15)


def test_both_sides_of_a_slit_keep_their_values():
    mesh = slit(8)
    upper = np.zeros(mesh.nvertices, dtype=bool)
    upper[mesh.t[:, mesh.p[1, mesh.t].mean(axis=0) > 0.5]] = True
    tip = (mesh.p[0] > 0.55) & (mesh.p[1] == 0.5)
    ritz = Ritz(np.where(upper & ~tip, 1.0, -1.0), np.zeros(mesh.nvertices, dtype=bool), 1.0)
    movable, values, _ = carried_by(mesh, ritz, lambda movable: learn(movable, lambda x: x[0] < 0.5))
    moved = movable.mesh()
    cut = (moved.p[1] == 0.5) & (moved.p[0] < 0.5)
    above = np.zeros_like(upper)
    above[moved.t[:, moved.p[1, moved.t].mean(axis=0) > 0.5]] = True
    assert_allclose(values[cut & above], 1.0)
    assert_allclose(values[cut & ~above], -1.0)
    assert np.any(moved.p[:, cut & above] != mesh.p[:, cut & above])


def test_a_piece_given_throughout_stays_given():
    """A region whose values are all given, such as a conductor: its free nodes are given as well."""
    mesh = inset(8)
    core = np.isin(np.arange(mesh.nvertices), mesh.t[:, mesh.subdomains["core"]])
    ritz = Ritz(np.where(core, 2.0, 0.0), core, 1.0)
    movable, values, fixed = carried_by(mesh, ritz, lambda movable: learn(movable, lambda x: np.ones(x.shape[1])))
    after = movable.mesh()
    still = np.isin(np.arange(mesh.nvertices), after.t[:, after.subdomains["core"]])
    assert_array_equal(fixed, still)
    assert_allclose(values[fixed], 2.0)
    kind = movable.constraints.kind
    assert np.any(fixed & (kind == FREE)) and np.any(fixed & (kind == SLIDING)) and np.any(fixed & (kind == HELD))


def test_far_hints_are_searched_for():
    mesh = l_shape(8)
    movable = MovableMesh.of(mesh, Rules())
    star = movable.triangulation.star
    ritz = Ritz(mesh.p[0] ** 2, np.zeros(mesh.nvertices, dtype=bool), 1.0)
    corner = np.argmax(mesh.p[0] - mesh.p[1])  # no straight way leads from here to the other leg
    start_element = np.full(movable.nnodes, star.element[star.start[corner]])
    values = transferred(Functional.of(ritz, movable), movable.copy(), movable, start_element).values
    assert_allclose(values, ritz.values, atol=1e-12)
