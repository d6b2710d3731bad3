"""A movable mesh: taken apart and put together, copied, kept and taken up again, and flipped until nothing flips."""

import io

import numpy as np
import pytest
from helpers.meshes import generic_square, junction, named, ring, slit, square
from helpers.solids import box, cut, l_shape, two_regions
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules, Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.som.relocate import move, move_in_space

SHORT = Schedule((Stage(2, 1, 0.4), Stage(0, 1, 0.4)), rounds=1)


def paired(n):
    """A square whose left and right sides are a pair."""
    return square(n).with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})


def banded(n):
    """A square with a thin band of two layers across it."""
    ticks = np.linspace(0, 1, n + 1)
    mesh = MeshTri.init_tensor(ticks, np.concatenate([ticks * 0.4, [0.45], 0.5 + ticks * 0.5]))
    return mesh.with_subdomains(
        {"band": lambda x: np.abs(x[1] - 0.45) < 0.05, "rest": lambda x: np.abs(x[1] - 0.45) > 0.05}
    )


WORLDS = {
    "square": (lambda: generic_square(10), {}),
    "names": (lambda: named(12), {"pinned": "floor"}),
    "junction": (lambda: junction(10), {}),
    "slit": (lambda: slit(12), {}),
    "arcs": (lambda: ring(40, 6), {"curves": {"inner": ka.Arc((0.0, 0.0), 0.5)}}),
    "pair": (lambda: paired(12), {"periodic": [("left", "right")]}),
    "layers": (lambda: banded(12), {"layers": {"band": 2}}),
    "box": (box, {"min_quality": 0.1}),
    "L in space": (l_shape, {"min_quality": 0.1}),
    "two regions in space": (two_regions, {"min_quality": 0.1}),
    "sheet": (cut, {"min_quality": 0.1}),
}
each_world = pytest.mark.parametrize(("build", "options"), WORLDS.values(), ids=WORLDS)


def movables(mesh, options, count):
    kind = MovableMesh if mesh.dim() == 2 else MovableSolid
    return [kind.of(mesh, Rules("recycle", **options)) for _ in range(count)]


def work_on(movable, seed=0):
    """Recycle, train or swap, and smooth towards a place."""
    x = movable.tessellation.centroids()
    place = x.mean(axis=0) + np.array([0.3, 0.2, 0.1 * seed])[: x.shape[1]]
    density = 1.0 / (0.01 + ((x - place) ** 2).sum(axis=1)) ** 2
    moves, schedule = (move, SHORT) if x.shape[1] == 2 else (move_in_space, None)
    return moves(movable, density, schedule, "recycle", np.random.default_rng(seed)).recycled


def kept(movable):
    """The state, as a file gives it back: with no array that the mesh goes on to change."""
    file = io.BytesIO()
    np.savez(file, **movable.state())
    file.seek(0)
    return dict(np.load(file))


def assert_same_state(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        assert array.dtype == other[name].dtype, name
        assert array.tobytes() == other[name].tobytes(), name


def assert_same_mesh(one, other):
    assert type(one) is type(other)
    assert (one.p.tobytes(), one.t.tobytes()) == (other.p.tobytes(), other.t.tobytes())
    for sets in ("boundaries", "subdomains"):
        ours, theirs = getattr(one, sets) or {}, getattr(other, sets) or {}
        assert list(ours) == list(theirs)
        for name, rows in ours.items():
            assert np.array_equal(rows, theirs[name])
            assert np.array_equal(getattr(rows, "ori", ()), getattr(theirs[name], "ori", ()))


@each_world
def test_a_state_gives_the_same_mesh_back_and_it_goes_on_in_the_same_way(build, options):
    mesh = build()
    movable, again = movables(mesh, options, 2)
    assert movable.start() is mesh
    assert work_on(movable).splits > 0
    work_on(again, seed=7)  # which a state may follow
    again.restore(kept(movable))
    for _ in range(2):
        assert_same_mesh(again.mesh(), movable.mesh())
        assert_same_state(again.state(), movable.state())
        for each in (movable, again):
            work_on(each, seed=1)


@each_world
def test_a_copy_and_its_original_leave_each_other_alone(build, options):
    (movable,) = movables(build(), options, 1)
    work_on(movable)
    copy, before, mesh = movable.copy(), kept(movable), movable.mesh()
    work_on(movable, seed=1)
    assert np.any(movable.state()["position"] != before["position"])
    assert_same_state(copy.state(), before)
    assert_same_mesh(copy.mesh(), mesh)
    after = kept(movable)
    work_on(copy, seed=1)
    assert_same_state(movable.state(), after)
    assert_same_state(copy.state(), after)  # what is the same goes on in the same way
