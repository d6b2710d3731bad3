"""Nonlinear magnetostatics: exact fields and energies, Newton's method, warm starts, what has no solution."""

import warnings

import numpy as np
import pytest
from helpers.devices import BRAUER, CURRENT, OUTER, WIRE, tube, wire_mesh
from helpers.examples import examples
from helpers.meshes import disk, square
from helpers.steel import STEEL
from hypothesis import assume, given
from hypothesis import strategies as st
from skfem import Basis, ElementTriP1

from kohonen_adapt.magnetostatics import (
    Arctan,
    Brauer,
    Froehlich,
    Magnetostatics,
    Material,
    NotConverged,
    Table,
)
from kohonen_adapt.magnetostatics.materials.laws import flux_density_of

MU0 = 4e-7 * np.pi

# --- exact: a wire in an iron tube, H = I / (2 pi r) whatever the material --------------------------------------


def tube_error(mesh, field):
    """sqrt(int (H - H_h) . (B - B_h)): the energy norm of the error, where the material is linear."""
    basis = Basis(mesh, ElementTriP1(), intorder=6)
    x = np.asarray(basis.global_coordinates())
    radius = np.maximum(np.hypot(*x), 1e-9)
    inside = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["wire"])[:, None]
    strength = CURRENT / (2 * np.pi) * np.where(inside, radius / WIRE**2, 1 / radius)
    iron = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["iron"])[:, None]
    density = np.where(iron, flux_density_of(BRAUER, strength), MU0 * strength)
    around = np.stack((-x[1], x[0])) / radius
    gap = (strength * around - field.field_strength[:, :, None]) * (density * around - field.flux_density[:, :, None])
    return np.sqrt(np.sum(gap.sum(axis=0) * basis.dx))


def test_a_wire_in_an_iron_tube_converges_to_its_exact_field_and_energies():
    rings, errors, totals = (10, 20, 40), [], []
    for number in rings:
        mesh = wire_mesh(number)
        field = tube().solve(mesh)
        errors.append(tube_error(mesh, field))
        stored, spare = (field.volume * each for each in (field.energy_density, field.coenergy_density))
        parts = [stored[mesh.subdomains[name]].sum() for name in ("iron", "air", "wire")]
        totals.append([*parts, field.energy, spare[mesh.subdomains["iron"]].sum(), field.potential[0]])
    assert 0.95 < -np.polyfit(np.log(rings), np.log(errors), 1)[0] < 1.05
    exact = np.array([6.1319620363, 0.4815891217, 0.1, 6.7135511580, 71.2838172511, 0.0393894788])
    distance = np.abs(np.array(totals) - exact) / exact
    assert np.all(distance[2] < [0.001, 0.0001, 0.02, 0.001, 0.0003, 0.0003])
    rates = -np.polyfit(np.log(rings), np.log(distance[:, [0, 2, 3, 4, 5]]), 1)[0]
    assert np.all((rates > 1.8) & (rates < 2.2))


@pytest.mark.parametrize(
    ("estimator", "low", "high"), [("residual", 0.9, 1.3), ("recovery", 0.84, 0.9), ("equilibrated", 1.0, 1.2)]
)
def test_estimates_of_the_tube_are_near_its_error(estimator, low, high):
    for rings in (10, 20):
        mesh, problem = wire_mesh(rings), tube(estimator=estimator)
        field = problem.solve(mesh)
        assert low < np.linalg.norm(problem.indicators(mesh, field)) / tube_error(mesh, field) < high


def test_the_bound_is_for_plane_problems_with_potentials():
    message = "estimator 'equilibrated' bounds .* this one has an open boundary and antiperiodic sides: use 'residual'"
    with pytest.raises(ValueError, match=message):
        tube(estimator="equilibrated", open_boundary="outer", potential=None, antiperiodic=[("left", "right")])


# --- Newton's method ---------------------------------------------------------------------------------------------


@st.composite
def laws(draw):
    """One of those with a formula, or any rising table: kinks, plateaus and S-shapes, whose energy stays convex."""
    law = draw(st.sampled_from([BRAUER, Froehlich(4000.0, 2.1), Arctan(2000.0, 1.9), Table(STEEL), None, None, None]))
    if law is None:
        steps = draw(st.lists(st.tuples(st.floats(0.02, 0.5), st.floats(1e-4, 1.0)), min_size=2, max_size=10))
        points = np.cumsum([(rise, share * rise / MU0) for rise, share in steps], axis=0)
        assume(points[-1, 0] - MU0 * points[-1, 1] < 3.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                law = Table(points)
            except ValueError:
                assume(False)
    return law


@given(laws(), st.floats(0.0, 6.0))
@examples(60)
def test_newton_converges_for_any_law_and_current(law, power):
    """Ampere's law holds along a ring of elements in the iron."""
    mesh, current = wire_mesh(10), 10.0**power
    materials = {"wire": Material(), "iron": Material(bh=law), "air": Material()}
    field = Magnetostatics(materials, {"outer": 0.0}, ampere_turns={"wire": current}, order=1).solve(mesh)
    assert field.newton[-1].converged and len(field.newton) < 30
    assert field.energy >= 0.0 and field.coenergy >= 0.0
    iron, middle = mesh.subdomains["iron"], np.hypot(*mesh.p[:, mesh.t].mean(axis=1))
    around = 2 * np.pi * middle[iron] * np.hypot(*field.field_strength[:, iron])
    assert around.mean() == pytest.approx(current, rel=0.05)


def test_a_warm_start_saves_steps_and_ends_in_the_same_place():
    coarse, fine = wire_mesh(10), wire_mesh(20)
    old = tube().solve(coarse)
    cold, warm = tube().solve(fine), tube().solve_from(fine, coarse, old)
    assert len(warm.newton) < len(cold.newton)
    np.testing.assert_allclose(warm.potential, cold.potential, atol=1e-9 * cold.potential.max())
    again = tube().solve_from(coarse, coarse, old)
    assert len(again.newton) == 1
    small = disk(10, 0.8 * OUTER)
    elsewhere = Magnetostatics({"air": Material(current_density=1.0)}, {"outer": 0.0}, order=1).solve(
        small.with_subdomains({"air": lambda x: x[0] < 1}).with_boundaries({"outer": lambda x: np.hypot(*x) > 0.03})
    )
    outside = tube().solve_from(fine, elsewhere.mesh, elsewhere)  # nodes outside the old mesh have its nearest value
    np.testing.assert_allclose(outside.potential, cold.potential, atol=1e-9 * cold.potential.max())


class Falling:
    """No law: H falls again beyond 1 T."""

    def field_strength(self, b):
        return 1000.0 * np.sin(np.pi / 2 * b)

    def slope(self, b):
        return 500.0 * np.pi * np.cos(np.pi / 2 * b)

    def energy(self, b):
        return 2000.0 / np.pi * (1 - np.cos(np.pi / 2 * b))


class Broken:
    """No law: its slope is no number beyond 1 T."""

    def field_strength(self, b):
        return 1000.0 * b

    def slope(self, b):
        return np.where(b < 1.0, 1000.0, np.nan)

    def energy(self, b):
        return 500.0 * b**2


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("law", [Falling(), Broken()])
def test_what_does_not_converge_says_so_and_hands_over_the_last_iterate(law, order):
    materials = {"wire": Material(), "iron": Material(bh=law), "air": Material()}
    problem = Magnetostatics(materials, potential={"outer": 0.0}, ampere_turns={"wire": CURRENT}, order=order)
    message = r"Newton's method has not converged in \d+ steps: the last relative residuals are .*, required 1e-08\."
    with pytest.raises(NotConverged, match=message) as caught:
        problem.solve(wire_mesh(10))
    assert isinstance(caught.value, ValueError)
    assert np.all(np.isfinite(caught.value.field.potential)) and caught.value.field.potential.any()
    assert caught.value.steps == caught.value.field.newton and not caught.value.steps[-1].converged


# --- magnets by coercivity, by curves, by direction ---------------------------------------------------------------


def magnet_problem(magnet):
    mesh = wire_mesh(10)
    return mesh, Magnetostatics({"wire": magnet, "iron": Material(1000.0), "air": Material()}, {"outer": 0.0}, order=1)


def test_coercivity_and_remanence_say_the_same():
    mesh, by_remanence = magnet_problem(Material(1.05, remanence=(0.3, 1.1)))
    strength = np.array([0.3, 1.1]) / (1.05 * MU0)
    _, by_coercivity = magnet_problem(Material(1.05, coercivity=tuple(strength)))
    _, by_callable = magnet_problem(Material(1.05, remanence=lambda x: np.array([[0.3], [1.1]]) * np.ones(x.shape[1])))
    fields = [problem.solve(mesh) for problem in (by_remanence, by_coercivity, by_callable)]
    for field in fields[1:]:
        np.testing.assert_allclose(field.potential, fields[0].potential, atol=1e-12)
        np.testing.assert_allclose(field.remanence, fields[0].remanence, atol=1e-12)
        assert field.energy == pytest.approx(fields[0].energy, rel=1e-10)
    for problem in (by_coercivity, by_callable):
        difference = problem.ritz(mesh, fields[0]).values - by_remanence.ritz(mesh, fields[0]).values
        assert not difference.any()


def test_a_magnet_with_a_curve_stores_no_energy_at_its_remanence():
    """Around it iron without end: the magnet is shorted, B = Br, and H = 0."""
    mesh = (
        square(6)
        .with_subdomains({"magnet": lambda x: x[0] < 2})
        .with_boundaries({"left": lambda x: x[0] == 0, "right": lambda x: x[0] == 1})
    )
    law = Table([(0.5, 0.45 / MU0), (1.0, 0.93 / MU0), (1.4, 1.32 / MU0)])
    by_remanence = Material(bh=law, remanence=(0.0, 1.2))
    by_coercivity = Material(bh=law, coercivity=(0.0, float(law.field_strength(np.float64(1.2)))))
    for magnet in (by_remanence, by_coercivity):
        field = Magnetostatics({"magnet": magnet}, potential={"left": 0.0, "right": -1.2}, order=1).solve(mesh)
        assert np.abs(field.field_strength).max() < 1e-3 and abs(field.energy) < 1e-6
        field = Magnetostatics({"magnet": magnet}, potential={"left": 0.0, "right": -0.7}, order=1).solve(mesh)
        assert field.energy > 0.0 and np.all(field.field_strength[1] < -0.3 / MU0)
        wanted = law.energy(np.float64(0.7)) - law.energy(np.float64(1.2))
        wanted += law.field_strength(np.float64(1.2)) * 0.5
        assert field.energy == pytest.approx(float(wanted), rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"bh": STEEL, "permeability": 100.0}, r"a bh curve or a permeability; got both, permeability 100\."),
        ({"remanence": (0.0, 1.0), "coercivity": (0.0, 1e6)}, "a remanence or a coercivity, .*; got both"),
        ({"coercivity": 1e6}, r"coercivity must have two components \(x, y\); got 1000000\.0\."),
        ({"coercivity": (0.0, np.inf)}, r"coercivity must be finite; got inf\."),
        ({"bh": Brauer}, r"bh must be a law with its parameters, or points; got the class Brauer\."),
        ({"bh": [(1.0, 100.0)]}, "bh must have at least two points"),
    ],
)
def test_wrong_materials_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Material(**arguments)


@pytest.mark.parametrize(
    ("direction", "message"),
    [
        (lambda x: x[0], r"remanence of 'wire' must have shape \(2, n\) = \(2, 6\); got \(6,\)\."),
        (lambda x: x * np.nan, r"remanence of 'wire' must be finite; it is not at 6 of 6 points, first "),
    ],
)
def test_wrong_directions_are_named(direction, message):
    mesh, problem = magnet_problem(Material(remanence=direction))
    with pytest.raises(ValueError, match=message):
        problem.solve(mesh)


def test_materials_with_curves_are_values():
    assert Material(bh=STEEL) == Material(bh=Table(STEEL)) and hash(Material(bh=STEEL)) == hash(Material(bh=STEEL))
    assert Material(bh=BRAUER).reluctivity == pytest.approx(110.0)


# --- coils ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("turns", "message"),
    [
        ({"coil": 10.0}, r"ampere_turns has 'coil', which is not among the materials: 'air', 'iron', 'wire'\."),
        ({"wire": np.nan}, r"ampere_turns of 'wire' must be a finite number in A; got nan\."),
        ({"wire": "much"}, r"ampere_turns of 'wire' must be a finite number in A; got 'much'\."),
        (10.0, r"ampere_turns must map subdomain names to amperes; got 10\.0\."),
    ],
)
def test_wrong_ampere_turns_are_named(turns, message):
    with pytest.raises(ValueError, match=message):
        tube(ampere_turns=turns)


def test_a_coil_of_two_currents_or_no_area_is_refused():
    materials = {"wire": Material(current_density=1.0), "rest": Material()}
    with pytest.raises(ValueError, match=r"the coil 'wire' has ampere_turns or a current density; got both, 1 A/m\^2"):
        Magnetostatics(materials, {"outer": 0.0}, ampere_turns={"wire": 1.0}, order=1)
    mesh = wire_mesh(10).with_subdomains({"coil": np.array([], dtype=int)})
    materials = dict.fromkeys(("wire", "iron", "air", "coil"), Material())
    with pytest.raises(ValueError, match="the coil 'coil' has no area in the mesh, so its ampere_turns cannot"):
        Magnetostatics(materials, {"outer": 0.0}, ampere_turns={"coil": 1.0}, order=1).solve(mesh)


@pytest.mark.parametrize("depth", [0.0, -1.0, np.inf, "deep"])
def test_wrong_depths_are_named(depth):
    with pytest.raises(ValueError, match=r"depth must be a finite number > 0 in metres, or None; got"):
        tube(depth=depth)
