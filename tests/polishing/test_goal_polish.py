"""The polish for a goal: the sum of two functionals falls, and with it the product of the errors of both solutions."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.descents import Start, descent_of
from helpers.meshes import inset, junction, perturbed
from helpers.scalar_problems import Aimed, slab
from numpy.testing import assert_array_equal
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.polishing.polish import descend_and_recycle

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
MESHES = {"inset": lambda: perturbed(inset(8), 1), "junction": lambda: perturbed(junction(8), 2)}
each_mesh = pytest.mark.parametrize("name", MESHES)
each_order = pytest.mark.parametrize("order", (1, 2, 3))


def two_functionals(mesh, seed, share=1.0, dual=True, order=1):
    """Any two of one coefficient, with values given on two sides: linear ones, and zeros."""
    rng, (x, y) = np.random.default_rng(seed), Basis(mesh, ELEMENTS[order]()).doflocs
    region = MovableMesh.of(mesh, Rules()).triangulation.elements.region
    count, ends = region.max() + 1, (x == x.min()) | (x == x.max())
    coefficient = 10.0 ** rng.uniform(-1, 1, count)

    def one(given):
        bump = np.exp(-30.0 * ((x - rng.random()) ** 2 + (y - rng.random()) ** 2))
        tables = coefficient, rng.normal(size=count), rng.normal(size=(2, count))
        return ka.Ritz(np.where(ends, given, bump), ends, *tables, region, order=order)

    first, second = one(1.0 + y), one(0.0)
    return replace(first, dual=second if dual else None, share=share)


def polished(mesh, ritz):
    """Position and elements after moves, flips and recycling."""
    at = Start.of(mesh, ritz)
    descend_and_recycle(descent_of(at.movable, at.functional, at.trial))
    return at.movable.triangulation.position, at.movable.triangulation.elements.node


@each_order
@each_mesh
def test_a_dual_that_is_the_solution_itself_and_one_that_is_nothing_change_no_bit(name, order):
    mesh = MESHES[name]()
    one = two_functionals(mesh, 3, dual=False, order=order)
    nothing = replace(one, values=np.zeros(len(one.values)), source=0.0, flux=(0.0, 0.0))
    expected = polished(mesh, one)
    for dual in (one, nothing):
        for found, wanted in zip(polished(mesh, replace(one, dual=dual)), expected, strict=True):
            assert_array_equal(found, wanted)


# --- in the loop -----------------------------------------------------------------------------------------------


ZEROS = {"values": np.zeros(4), "fixed": np.array([True, False, False, False]), "coefficient": 1.0}


class Law:
    field_strength = energy = staticmethod(np.abs)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"share": 0.0}, "share of Ritz must be a finite number > 0; got 0.0"),
        ({"comparable": 1}, "comparable of Ritz must be True or False; got 1"),
        ({"dual": ZEROS}, "dual of Ritz must be a Ritz without a dual, or None"),
        ({"dual": ka.Ritz(**ZEROS, laws=[Law()])}, "a Ritz with a dual must have no laws"),
        ({"dual": ka.Ritz(**ZEROS), "laws": [Law()]}, "a Ritz with a dual must have no laws"),
        ({"dual": ka.Ritz(**ZEROS, order=2)}, "a Ritz and its dual must have the same order; got 1 and 2"),
        ({"dual": ka.Ritz(**ZEROS), "axisymmetric": True}, "a Ritz with a dual must not be axisymmetric"),
        (
            {"dual": ka.Ritz(np.zeros(4), np.ones(4, bool), 1.0)},
            "must equal fixed of Ritz, with 1 fixed unknowns; got 4, or others",
        ),
    ],
)
def test_what_a_dual_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        ka.Ritz(**{**ZEROS, **arguments})


class Shared(Aimed):
    """With a share that every mesh would have another of."""

    def ritz(self, mesh, values):
        return replace(super().ritz(mesh, values), share=1.0 + float(mesh.p.mean()))


def test_a_run_keeps_the_share_of_its_first_pass_and_so_does_one_that_goes_on(tmp_path):
    whole = ka.adapt(slab(), Shared(1), passes=2)
    assert "polish" not in whole.message
    assert {step.share for step in whole.history} == {1.0 + slab().p.mean()}
    assert all(step.comparable for step in whole.history)
    assert whole.best.functional == min(step.functional for step in whole.history) < whole.history[0].functional
    ka.adapt(slab(), Shared(1), passes=1, checkpoint=tmp_path)
    resumed = ka.adapt(slab(), Shared(1), passes=2, checkpoint=tmp_path)
    assert [step.functional for step in resumed.history] == [step.functional for step in whole.history]
    assert_array_equal(resumed.mesh.p, whole.mesh.p)
