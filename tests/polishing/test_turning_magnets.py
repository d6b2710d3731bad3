"""Magnets that turn inside their region: kernels know their flux near every element, and the polish lowers errors."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.exact_fields import halbach_field
from helpers.tensor_meshes import disk
from numpy.testing import assert_allclose
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material, halbach, radial
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.measures import area, inner_points
from kohonen_adapt.problem.functional_value import functional_value


def error_of(field):
    x = inner_points(field.mesh.p[:, field.mesh.t])
    off = field.flux_density[:, None] - halbach_field(x.reshape(2, -1)).reshape(x.shape)
    return np.sqrt(np.sum(area(field.mesh) * np.mean(np.sum(off**2, axis=0), axis=0)) / VACUUM_PERMEABILITY)


def test_a_halbach_cylinder_is_polished():
    mesh = disk(np.linspace(0.0, 0.06, 19)[1:], {"bore": 6, "ring": 12, "air": 18})
    materials = {"bore": Material(), "ring": Material(remanence=halbach(1.0, 1)), "air": Material()}
    problem = Magnetostatics(materials, {"outer": 0.0}, order=1)
    with_polish, without = (ka.adapt(mesh, problem, polish=polish) for polish in (True, False))
    assert "No polish" not in with_polish.message
    assert all(step.polish_gain > 0.0 for step in with_polish.history[1:])
    start, polished, moved = (error_of(each) for each in (problem.solve(mesh), with_polish.solution, without.solution))
    assert polished < 0.9 * moved < 0.5 * start  # 1.16 - 1.19, 1.34 - 1.35, 2.70
    for each in (problem.solve(mesh), with_polish.solution, without.solution):
        for estimator in ("residual", "recovery"):
            found = replace(problem, estimator=estimator).indicators(each.mesh, each)
            assert 0.9 < np.linalg.norm(found) / error_of(each) < 1.25  # 0.99 - 1.17
    bore = with_polish.solution.flux_density[:, with_polish.mesh.subdomains["bore"]]
    assert_allclose(bore.mean(axis=1), [np.log(2.0), 0.0], atol=2e-3)


@pytest.mark.parametrize(
    ("flux", "message"),
    [
        (lambda x, number: x[0], r"flux of Ritz must have shape \(2, n\) = \(2, .*\); got \(.*,\)\."),
        (lambda x, number: x / 0.0, r"flux of Ritz must be finite; it is not at .* points, first "),
    ],
)
def test_a_flux_that_is_none_is_refused(flux, message):
    mesh = MeshTri().refined(2)
    with np.errstate(all="ignore"), pytest.raises(ValueError, match=message):
        functional_value(mesh, ka.Ritz(mesh.p[0], mesh.p[0] < 0.0, 1.0, flux=flux))


def ring(k, outside="air"):
    """A ring from 20 to 40 mm around a bore, with 6 mm of something else around it, in air up to 60 mm."""
    parts = {"bore": k // 3, "ring": 2 * k // 3, outside: 5 * k // 6, "air": k}
    return disk(np.linspace(0.0, 0.06, k + 1)[1:], parts)


def poles(x):
    """Eight poles in turn in one region: what the callable says jumps inside."""
    return np.sign(np.sin(4.0 * np.arctan2(x[1], x[0]) + 0.3)) * radial(1.0)(x)


@pytest.mark.parametrize("topology", ["flip", "fixed"])
def test_a_flux_that_jumps_inside_a_region_never_raises_the_functional(topology):
    materials = {"bore": Material(), "ring": Material(remanence=poles), "air": Material()}
    problem, mesh = Magnetostatics(materials, {"outer": 0.0}, order=1), ring(9)
    values = [functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))]
    for _ in range(3):
        mesh = ka.polish(mesh, problem, topology=topology)
        values.append(functional_value(mesh, problem.ritz(mesh, problem.solve(mesh))))
    assert np.all(np.diff(values) <= 0.0)
    history = ka.adapt(ring(9), problem, passes=2).history
    assert all(step.polish_gain >= 0.0 for step in history)
