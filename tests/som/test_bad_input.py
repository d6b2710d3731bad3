"""What map, relocation, densities and interpolation refuse, and what they then say."""

import numpy as np
import pytest
from helpers.meshes import square
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Schedule, Stage

MESH = square(4)
ONES = np.ones(32)
TWO = np.full((2, 2), 0.5)
FIRST = Schedule((Stage(0, 1, 0.3),))


def changed(place, value):
    values = np.ones(32)
    values[place] = value
    return values


PER_ELEMENT = [
    (np.ones(25), r"must have shape \(nelements,\) = \(32,\); got \(25,\)\."),
    (np.ones((1, 32)), r"must have shape \(nelements,\) = \(32,\); got \(1, 32\)\."),
    (1.0, r"must have shape \(nelements,\) = \(32,\); got \(\)\."),
    (changed(5, -0.5), r"must be finite and >= 0; element 5 has -0\.5\."),
    (changed(6, np.nan), r"must be finite and >= 0; element 6 has nan\."),
    (1j * ONES, r"must be real numbers; got complex128\."),
    (["a"] * 32, r"must be real numbers; got <U1\."),
]


@pytest.mark.parametrize(("values", "message"), PER_ELEMENT)
def test_values_per_element(values, message):
    with pytest.raises(ValueError, match=f"^density {message}$"):
        ka.relocate(MESH, values)
    with pytest.raises(ValueError, match=f"^indicators {message}$"):
        ka.density_from_indicators(MESH, values)
    with pytest.raises(ValueError, match=f"^sizes {message}$"):
        ka.density_from_sizes(MESH, values)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: 1.0, r"a callable density must return shape \(n,\) = \((\d+),\); got \(\)\."),
        (
            lambda x: np.ones((2, x.shape[1])),
            r"a callable density must return shape \(n,\) = \((\d+),\); got \(2, \1\)\.",
        ),
        (lambda x: x[0] - 0.5, r"density must be finite and >= 0; at \(0\.\d+, 0\.\d+\) it is -0\.\d+\."),
        (
            lambda x: np.where(x[0] > 0.5, np.nan, 1.0),
            r"density must be finite and >= 0; at \(0\.\d+, 0\.\d+\) it is nan\.",
        ),
        (lambda x: x[0] + 1j, r"density must be real numbers; got complex128\."),
    ],
)
def test_callables_that_return_something_else(function, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        ka.relocate(MESH, function)


def test_an_exception_of_a_callable_comes_through():
    def broken(x):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        ka.relocate(MESH, broken)


@pytest.mark.parametrize(("order", "shown"), [(0, "0"), (5, "5"), (1.5, r"1\.5"), ("1", "'1'"), (True, "True")])
def test_orders(order, shown):
    with pytest.raises(ValueError, match=rf"^order must be the degree of the elements, 1 to 4; got {shown}\.$"):
        ka.density_from_indicators(MESH, ONES, order=order)


@pytest.mark.parametrize("seed", [-1, 0.5, 3.0, None, "a", True])
def test_seeds(seed):
    with pytest.raises(ValueError, match=rf"^seed must be an integer >= 0; got {seed!r}\.$"):
        ka.relocate(MESH, ONES, seed=seed)


@pytest.mark.parametrize("schedule", [3, (), Stage(1, 1, 0.3), "paper"])
def test_schedules_of_another_kind(schedule):
    with pytest.raises(ValueError, match=r"^schedule must be a kohonen_adapt\.Schedule or None; got "):
        ka.relocate(MESH, ONES, schedule=schedule)


class Given:
    """A problem with a functional, of which nothing is asked once the arguments are refused."""

    def solve(self, mesh):
        raise AssertionError("solved")

    ritz = solve


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"min_quality": 1.0}, r"min_quality must be 'auto' or from 0 to below 1; got 1\.0\."),
        ({"pinned": 3}, r"pinned must be a sequence of node numbers and names; got 3\."),
        ({"pinned": ["coil"]}, r"pinned name 'coil' is not in the mesh; .* are: none\."),
        ({"curves": {"rim": ka.Arc((0, 0), 1)}}, r"curves has 'rim', which is no boundary of the mesh; .* are: none\."),
        ({"periodic": [("left",)]}, r"periodic must hold pairs of names of boundaries, .*; got \('left',\)\."),
        ({"layers": {"gap": 2}}, r"layers has 'gap', which is no subdomain of the mesh; .* are: none\."),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_the_rules_refuse_every_call_refuses(rule, message):
    for call in (
        lambda: ka.relocate(MESH, ONES, **rule),
        lambda: KohonenMap(MESH, **rule),
        lambda: ka.polish(MESH, Given(), **rule),
    ):
        with pytest.raises(ValueError, match=f"^{message}$"):
            call()


def two_each(number, rng):
    return rng.random((2, number)), None


def trained(points=TWO, schedule=FIRST, **given):
    return lambda: KohonenMap(MESH).train(points, schedule, **given)


REFUSED = {
    "a density of zeros": (
        lambda: ka.relocate(MESH, np.zeros(32)),
        r"density must not be zero everywhere; give it a positive value where",
    ),
    "a callable of zeros": (
        lambda: ka.relocate(MESH, lambda x: np.zeros(x.shape[1])),
        r"density must not be zero everywhere; the callable is at all \d+ points",
    ),
    "a size of zero": (
        lambda: ka.density_from_sizes(MESH, changed(3, 0.0)),
        r"sizes must be above zero; element 3 has 0\.0\.$",
    ),
    "another norm": (
        lambda: ka.density_from_indicators(MESH, ONES, norm="H1"),
        r"norm must be 'energy' or 'L2'; got 'H1'\.$",
    ),
    "relocation without a guard": (
        lambda: ka.relocate(MESH, ONES, min_quality=None),
        r"min_quality must be 'auto' or a number here; only KohonenMap works unchecked\. Got None\.$",
    ),
    "weights beside a callable": (
        trained(two_each, weights=np.ones(3)),
        r"weights must come from the callable when points is one; got both\.$",
    ),
    "a callable without weights": (
        trained(lambda number, rng: rng.random((2, number))),
        r"points as a callable must return \(points, weights\)",
    ),
    "complex points": (trained(1j * TWO), r"points must be real numbers; got complex ones"),
    "a stage as schedule": (
        trained(schedule=Stage(1, 1, 0.3)),
        r"schedule must be a kohonen_adapt\.Schedule or None; got Stage",
    ),
    "sweeps without a density": (
        trained(schedule=Schedule((), sweeps=2)),
        r"train has no density to sweep with; got sweeps = 2\. Use kohonen_adapt\.relocate\.$",
    ),
}


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        call()


TRAINING = [
    (
        np.array([[0.5, 2.0], [0.5, 0.1]]),
        r"training points must lie in the mesh; 1 do not, point 1 at \(2\.0, 0\.1\)\.",
    ),
    (np.ones((3, 4)), r"points must have shape \(2, n\); got \(3, 4\)\."),
    (np.ones((2, 0)), r"points must hold at least one training point; got none\."),
    (
        lambda number, rng: (2 + rng.random((2, number)), None),
        r"training points must lie in the mesh; 50 do not, point 0",
    ),
    (
        lambda number, rng: (rng.random((2, number)), np.ones(3)),
        r"weights must have shape \(n,\) = \(50,\); got \(3,\)\.",
    ),
]


@pytest.mark.parametrize(("points", "message"), TRAINING)
def test_training_points(points, message):
    som = KohonenMap(MESH)
    with pytest.raises(ValueError, match=f"^{message}"):
        som.train(points, FIRST)
    assert_array_equal(som.mesh.p, MESH.p)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.ones(3), r"weights must have shape \(n,\) = \(4,\); got \(3,\)\."),
        (-np.ones(4), r"weights must be finite and >= 0; that of point 0 is -1\.0\."),
    ],
)
def test_weights(weights, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        KohonenMap(MESH).train(np.full((2, 4), 0.5), FIRST, weights=weights)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("mesh", [MeshTri().refined(3), MeshTet().refined(1)], ids=["tri", "tet"])
@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_ratios_of_a_density_may_be_beyond_the_range_of_numbers(mesh, topology):
    x = mesh.p[0, mesh.t].mean(axis=0)
    moved = ka.relocate(mesh, np.where(x > 0.5, 1e308, 1e-308), topology=topology)
    assert ka.quality(moved).min() > 0.19 and not np.array_equal(moved.p, mesh.p)
    if topology == "flip":  # larger where it was not looked at first
        moved = ka.relocate(mesh, lambda x: np.where(np.abs(x[0] - 0.501) < 1e-4, 1e308, 1e-308))
        assert ka.quality(moved).min() > 0.19
