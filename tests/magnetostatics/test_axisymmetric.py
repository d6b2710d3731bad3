"""Axisymmetric magnetostatics against known inductances and exact fields."""

import numpy as np
import pytest
from helpers.devices import INCH, coil, coil_mesh
from helpers.meshes import generic_square
from skfem import MeshTri

from kohonen_adapt.magnetostatics import Brauer, Magnetostatics, Material
from kohonen_adapt.magnetostatics.materials.laws import flux_density_of

MU0 = 4e-7 * np.pi


def on_axis(z):
    """B_z of the coil at 1 A on its axis, in free space: the integral over the rings of its current."""
    density, inner, outer = 1000.0 / (2 * INCH**2), 0.5 * INCH, 1.5 * INCH

    def up_to(s):
        return s * np.log((outer + np.hypot(outer, s)) / (inner + np.hypot(inner, s)))

    return MU0 * density / 2 * (up_to(z + INCH) - up_to(z - INCH))


@pytest.mark.parametrize(
    ("order", "finenesses", "mean", "bounds", "rate"),
    [(1, (1, 2, 4), 0.005, (0.014, 0.012), 0.95), (2, (1, 2), 0.001, (5e-4, 3e-4), 1.9)],
    ids=["order 1", "order 2"],
)
def test_the_field_of_a_coil_on_its_axis(order, finenesses, mean, bounds, rate):
    """As the elements have it, and recovered."""
    z = np.linspace(-1.2, 1.2, 49) * INCH
    assert on_axis(0.0) == pytest.approx(0.0176510851)  # by loops, integrated numerically
    errors = []
    for fineness in finenesses:
        field = coil(order=order).solve(coil_mesh(fineness, 3.0))
        both = [field.flux_density_at([0 * z, z], recovered=recovered) for recovered in (False, True)]
        errors.append([np.sqrt(np.mean((b[1] / on_axis(z) - 1.0) ** 2)) for b in both])
        assert np.mean(both[0][1] / on_axis(z)) == pytest.approx(1.0, abs=mean)
    assert np.all(np.array(errors[-1]) < bounds)
    assert np.all(-np.polyfit(np.log(finenesses), np.log(errors), 1)[0] > rate)


def in_uniform_field(mesh, order=1):
    """A_phi = 0.4 r all round, so that B_z is 0.8 T."""
    mesh = mesh.with_subdomains({"air": lambda x: x[0] < 2}).with_boundaries({"all": lambda x: x[0] > -1})
    problem = Magnetostatics({"air": Material()}, {"all": lambda x: 0.4 * x[0]}, axisymmetric=True, order=order)
    return problem.solve(mesh)


@pytest.mark.parametrize("order", [2, 3])
def test_a_uniform_field_is_exact_of_higher_order(order):
    """In every element, whatever its shape, and at every point: on the axis, beside it and between nodes there."""
    field, z = in_uniform_field(generic_square(8), order), np.linspace(0.0, 1.0, 41)
    np.testing.assert_allclose(field.flux_density, [[0.0], [0.8]] * np.ones(field.mesh.t.shape[1]), atol=1e-10)
    assert field.energy == pytest.approx(np.pi * 0.8**2 / (2 * MU0), rel=1e-12)
    for r in (0.0, 1e-12, 1e-3, 0.3):
        x = np.stack([np.full(41, r), z])
        np.testing.assert_allclose(field.flux_density_at(x), [[0.0], [0.8]] * np.ones(41), atol=1e-7)
        np.testing.assert_allclose(field.potential_at(x), 0.4 * r, atol=1e-15, rtol=1e-10)
    places = field.elements.doflocs
    np.testing.assert_allclose(field.values, 0.4 * places[0], atol=1e-14)
    assert np.linalg.norm(
        Magnetostatics({"air": Material()}, {"all": 0.0}, axisymmetric=True, order=order).indicators(field.mesh, field)
    ) < 1e-8 * np.sqrt(2 * field.energy)


@pytest.mark.parametrize(("order", "counts", "bound", "rate"), [(1, (16, 32, 64), 0.002, 1.5), (2, (8, 16), 2e-5, 2.5)])
def test_a_long_solenoid_with_an_iron_core(order, counts, bound, rate):
    """Between two planes that flux crosses at a right angle H is uniform inside, and 0 outside, whatever the iron."""
    law, height, turns, errors = Brauer(100.0, 10.0, 1.8), 0.01, 100.0, []
    for n in counts:
        mesh = MeshTri.init_tensor(np.linspace(0, 0.02, 2 * n + 1), np.linspace(0, height, n // 2 + 1))
        parts = {"core": lambda x: x[0] < 0.01, "coil": lambda x: (x[0] > 0.01) & (x[0] < 0.015)}
        mesh = mesh.with_subdomains(parts | {"air": lambda x: x[0] > 0.015})
        materials = {"core": Material(bh=law), "coil": Material(), "air": Material()}
        problem = Magnetostatics(materials, ampere_turns={"coil": turns}, axisymmetric=True, order=order)
        field, strength = problem.solve(mesh), turns / height
        density = flux_density_of(law, np.array([strength]))[0]
        core = mesh.subdomains["core"]
        errors.append(
            abs(np.sum((field.volume * field.flux_density[1])[core]) / (np.pi * 0.01**2 * height * density) - 1)
        )
        flux = 2 * np.pi * 0.01 * field.potential_at([[0.01], [0.005]])[0]
    assert flux == pytest.approx(np.pi * 0.01**2 * density, rel=bound)
    assert errors[-1] < bound and field.newton[-1].converged
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > rate


def test_wrong_axisymmetric_problems_are_named():
    mesh = coil_mesh(1, 0.1)
    shifted = MeshTri(mesh.p - np.array([[0.01], [0.0]]), mesh.t).with_subdomains(mesh.subdomains)
    shifted = shifted.with_boundaries({"far": lambda x: x[0] > 0.08})
    message = r"an axisymmetric mesh must lie at r = x >= 0; \d+ nodes do not, first node 0 at r = -0\.01 m\."
    with pytest.raises(ValueError, match=message):
        coil().solve(shifted)
    with pytest.raises(
        ValueError, match=r"an axisymmetric problem has no depth, its results are totals; got depth 0\.1"
    ):
        Magnetostatics({"air": Material()}, {"far": 0.0}, axisymmetric=True, depth=0.1)
    apart = MeshTri(mesh.p + np.array([[0.01], [0.0]]), mesh.t).with_subdomains(mesh.subdomains)
    with pytest.raises(ValueError, match="the potential is fixed nowhere on 1 of the 1 connected parts"):
        Magnetostatics(coil().materials, axisymmetric=True).solve(apart)
