"""Robin conditions and open boundaries: the functional has them, and sweeps lower it with the nodes there in place."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.curved_meshes import on_circles, with_midsides
from helpers.meshes import disk as hexagonal_disk
from helpers.tensor_meshes import disk
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.problem.functional_value import functional_value


@pytest.mark.parametrize("axisymmetric", [False, True], ids=["plane", "axis"])
@pytest.mark.parametrize("order", (2, 3))
def test_the_solution_is_stationary_where_the_rim_is_curved(order, axisymmetric):
    """On a coarse one, whose chords are 1 % shorter: what is minimised has to be what the equations are of."""
    mesh = bent_disk(2, 1.0, half=axisymmetric)
    field = {"applied_field": (0.0, 2e5)} if axisymmetric else {"applied_field": (1.8e5, 2.4e5)}
    given = {"open_boundary": "outer", "order": order, "axisymmetric": axisymmetric, **field}
    problem = Magnetostatics({"air": Material(current_density=1e5)}, **given)
    ritz = problem.ritz(mesh, problem.solve(mesh))
    change = np.where(ritz.fixed, 0.0, np.random.default_rng(0).normal(size=len(ritz.values)))
    change *= np.abs(ritz.values).max() / np.abs(change).max()
    less, value, more = (functional_value(mesh, replace(ritz, values=ritz.values + t * change)) for t in (-1, 0, 1))
    assert abs(more - less) < 1e-6 * (more + less - 2.0 * value)


def bent_disk(rings, radius, half=False):
    """A disk of air, turned so that nodes are on x = 0, or the half of it beyond, whose rim is bent to its circle."""
    plain = hexagonal_disk(rings, radius)
    mesh = MeshTri(plain.p[::-1], plain.t[[0, 2, 1]])
    mesh = mesh.restrict(np.flatnonzero(mesh.p[0, mesh.t].min(axis=0) > -1e-9)) if half else mesh
    mesh = mesh.with_subdomains({"air": lambda x: x[0] > -9.0})
    mesh = mesh.with_boundaries({"outer": lambda x: np.hypot(*x) > 0.8 * radius}, boundaries_only=True)
    return with_midsides(mesh, on_circles)


@pytest.mark.parametrize(
    ("robin", "message"),
    [
        ([("left", 1.0)], r"robin of Ritz must map names of boundaries to \(coefficient, load\); got \["),
        ({"left": 1.0}, r"robin of Ritz must map names of boundaries to \(coefficient, load\); got 1\.0 for 'left'"),
        ({"left": (-1.0, 0.0)}, r"the coefficient in robin of Ritz must be a number >= 0; got -1\.0, 'left'\."),
        ({"left": (1.0, np.nan)}, r"the load in robin of Ritz must be a number or a function of x; got nan, 'left'\."),
        ({"rim": (1.0, 0.0)}, "rim"),
        ({"middle": (1.0, 0.0)}, r"boundary 'middle' in robin of Ritz must be on the outer boundary of the mesh"),
        ({"left": (1.0, lambda x: x)}, r"a load in robin of Ritz must have shape \(n,\) = \(\d+,\); "),
    ],
)
def test_conditions_that_are_none_are_refused(robin, message):
    mesh = MeshTri().refined(2).with_defaults()
    mesh = mesh.with_boundaries({"middle": lambda x: x[0] == 0.5}, boundaries_only=False)
    with pytest.raises(ValueError, match=message):
        functional_value(mesh, ka.Ritz(np.zeros(25), np.zeros(25, bool), 1.0, robin=robin))


def cylinder(k):
    """Of 10 mm radius in air up to 20 mm."""
    return disk(np.linspace(0.0, 0.02, k + 1)[1:], {"iron": k // 2, "air": k})


def in_field(order):
    materials = {"iron": Material(5.0), "air": Material()}
    return Magnetostatics(materials, open_boundary="outer", applied_field=(1.8e5, 2.4e5), order=order)


def above_least(problem, mesh):
    """What the functional lies above its value of order 3 on the mesh, half the square of the error."""
    finer = replace(problem, order=3)
    value, least = (functional_value(mesh, each.ritz(mesh, each.solve(mesh))) for each in (problem, finer))
    return value - least


@pytest.mark.parametrize("order", (1, 2))
def test_the_mesh_in_an_open_boundary_is_polished(order):
    problem, mesh = in_field(order), cylinder(8)
    result = ka.adapt(mesh, problem, passes=2)
    assert "No polish" not in result.message
    assert all(step.polish_gain > 0.0 for step in result.history[1:])
    polished = ka.polish(mesh, problem)
    assert above_least(problem, polished) < 0.96 * above_least(problem, mesh)
    assert polished.nvertices == mesh.nvertices
