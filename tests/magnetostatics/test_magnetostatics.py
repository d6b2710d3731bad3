"""Magnetostatics against exact fields, energy identities and wrong input."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.exact_fields import (
    LAYERS,
    RECTANGLE,
    random_mesh,
    rectangle_mesh,
    sheet_field,
    sheet_potential,
)
from helpers.sheets import MU0
from helpers.tensor_meshes import everywhere
from skfem import Basis, ElementTriP1, MeshQuad, MeshTri

from kohonen_adapt.magnetostatics import Magnetostatics, Material


def true_error(mesh, field, exact):
    """sqrt(int nu |B_h - B|^2) by a quadrature that copes with the logarithm at a magnet's corner."""
    basis = Basis(mesh, ElementTriP1(), intorder=12)
    difference = field.flux_density[:, :, None] - exact(np.asarray(basis.global_coordinates()))
    return np.sqrt(np.sum(field.reluctivity[:, None] * np.sum(difference**2, axis=0) * basis.dx))


# --- exact: a transverse cylinder in a finite disk --------------------------------------------------------------


# --- exact: a rectangle magnet in free space ---------------------------------------------------------------------


def test_rectangle_magnet_converges_to_its_exact_field():
    """Of first order but for a logarithm: B is infinite at the corners of the magnet."""
    fineness, errors = (2, 4, 8), []
    points = np.array([[0.0, 0.0, 0.015, 0.009], [0.0, 0.01, 0.0, 0.002]])
    for n in fineness:
        mesh = rectangle_mesh(n)
        field = RECTANGLE.solve(mesh)
        errors.append(true_error(mesh, field, sheet_field))
        here, there = field.flux_density_at(points), field.potential_at(points)
        assert np.max(np.abs(here - sheet_field(points))) < 0.2 / n
        assert np.max(np.abs(there - sheet_potential(points))) < 6e-4 / n**2
        bands = {"residual": (0.9, 1.1), "recovery": (0.95, 1.05), "equilibrated": (1.0, 1.1)}
        for name, (low, high) in bands.items():
            estimate = np.linalg.norm(replace(RECTANGLE, estimator=name).indicators(mesh, field))
            assert low < estimate / errors[-1] < high
    assert 0.8 < -np.polyfit(np.log(fineness), np.log(errors), 1)[0] < 1.0


# --- exact in every mesh: what P1 holds without error ------------------------------------------------------------


@pytest.mark.parametrize("estimator", ["residual", "recovery"])
def test_layers_side_by_side_share_one_field_strength(estimator):
    """Flux along y between two fixed potentials: H_y is the same in every layer, whatever the mesh."""
    mesh = random_mesh()
    problem = Magnetostatics(LAYERS, potential={"left": 0.0, "right": -2.5}, estimator=estimator)
    field = problem.solve(mesh)
    # 2.5 Wb/m = the sum of By over three layers of 1 m each, By = Br + mu0 mu H.
    strength = (2.5 - 1.2) / (MU0 * (1000.0 + 1.05 + 1.0))
    np.testing.assert_allclose(field.field_strength[1], strength, rtol=1e-9)
    np.testing.assert_allclose(field.field_strength[0], 0.0, atol=1e-9 * strength)
    for name, material in LAYERS.items():
        wanted = material.remanence[1] + MU0 * material.permeability * strength
        np.testing.assert_allclose(field.flux_density[1, mesh.subdomains[name]], wanted, rtol=1e-9)
    assert field.energy == pytest.approx(0.5 * 3 * strength * (2.5 - 1.2), rel=1e-9)
    assert np.linalg.norm(problem.indicators(mesh, field)) < 1e-7 * problem.energy_norm(mesh, field)


# --- identities --------------------------------------------------------------------------------------------------


def loaded():
    """Iron, a magnet and a coil, A = 0 around: everything the linear problem has."""
    materials = LAYERS | {"air": Material(current_density=2e6)}
    return Magnetostatics(materials, potential=dict.fromkeys(("left", "right", "bottom", "top"), 0.0), order=1)


def test_solving_changes_nothing_and_repeats_bit_for_bit():
    mesh, problem = random_mesh(), loaded()
    arrays = [mesh.p, mesh.t, *mesh.subdomains.values(), *mesh.boundaries.values()]
    before = [array.copy() for array in arrays]
    for array in arrays:
        array.setflags(write=False)
    first, second = problem.solve(mesh), problem.solve(mesh)
    assert np.array_equal(first.potential, second.potential)
    assert np.array_equal(problem.indicators(mesh, first), problem.indicators(mesh, second))
    assert all(np.array_equal(old, new) for old, new in zip(before, arrays, strict=True))


def test_a_problem_keeps_its_own_copy_of_what_it_was_given():
    materials, potential = dict(LAYERS), {"left": 0.0, "right": 1.0}
    problem = Magnetostatics(materials, potential=potential)
    before = problem.solve(random_mesh()).potential
    materials["iron"] = Material()
    potential.clear()
    assert np.array_equal(problem.solve(random_mesh()).potential, before)


# --- names, materials, boundaries --------------------------------------------------------------------------------


def test_where_boundaries_meet_the_last_counts():
    mesh = random_mesh()
    corner = np.flatnonzero((mesh.p[0] == 0.0) & (mesh.p[1] == 0.0))[0]
    for potential in ({"left": 1.0, "bottom": 2.0}, {"bottom": 2.0, "left": 1.0}):
        field = Magnetostatics(LAYERS, potential=potential).solve(mesh)
        assert field.potential[corner] == list(potential.values())[-1]


def test_a_mesh_without_free_nodes_has_the_given_potential():
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    mesh = mesh.with_subdomains({"air": everywhere}).with_boundaries({"outer": everywhere})
    field = Magnetostatics({"air": Material()}, potential={"outer": lambda x: 3 * x[0] - x[1]}).solve(mesh)
    np.testing.assert_allclose(field.flux_density, [[-1.0], [-3.0]], atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"permeability": 0.0}, r"permeability must be positive \(relative to vacuum, air 1\.0\); got 0\.0\."),
        ({"permeability": np.inf}, r"permeability must be finite; got inf\."),
        ({"permeability": "iron"}, r"permeability must be a number; got 'iron'\."),
        ({"remanence": 1.2}, r"remanence must have two components \(x, y\); got 1\.2\."),
        (
            {"remanence": (0.0, 1.2, 0.0, 0.0)},
            r"remanence must have two components \(x, y\); got \(0\.0, 1\.2, 0\.0, 0",
        ),
        ({"remanence": (0.0, np.nan)}, r"remanence must be finite; got nan\."),
        ({"current_density": np.nan}, r"current_density must be finite; got nan\."),
        ({"current_density": None}, r"current_density must be a number; got None\."),
    ],
)
def test_wrong_materials_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Material(**arguments)


def test_magnets_in_space_are_not_for_the_plane():
    magnet = Material(remanence=(0.0, 1.2, 0.0))
    with pytest.raises(
        ValueError, match=r"remanence of 'magnet' must have two components \(x, y\) in the plane; got \("
    ):
        Magnetostatics({"magnet": magnet}, {"outer": 0.0})
    assert Material(remanence=(0.0, 0.0, 0.0)) == Material()  # which is none, in the plane as in space


def test_materials_are_values():
    given = Material(np.float32(2.0), remanence=np.array([0.0, 1.0]), current_density=3)
    assert given == Material(2, (0, 1), 3.0) and hash(given) == hash(Material(2, (0, 1), 3.0))
    assert given.reluctivity == pytest.approx(1 / (2 * MU0), rel=1e-15)
    with pytest.raises(AttributeError):
        given.permeability = 3.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"potential": None}, r"potential must fix A on at least one boundary, .* up to a constant; got None\."),
        ({"potential": {}}, r"potential must fix A on at least one boundary, .* up to a constant; got {}\."),
        ({"estimator": "jump"}, r"estimator must be one of 'residual', 'recovery', 'equilibrated'; got 'jump'\."),
        ({"materials": {"iron": 1000.0}}, r"materials\['iron'\] must be a Material; got 1000\.0\."),
        ({"materials": ["iron"]}, r"materials must map subdomain names to Materials; got \['iron'\]\."),
    ],
)
def test_wrong_problems_are_named(arguments, message):
    given = {"materials": LAYERS, "potential": {"left": 0.0}, "estimator": "residual"} | arguments
    with pytest.raises(ValueError, match=message):
        Magnetostatics(given["materials"], potential=given["potential"], estimator=given["estimator"])


AIR = Material()


@pytest.mark.parametrize(
    ("materials", "potential", "message"),
    [
        (LAYERS | {"coil": AIR}, 0.0, r"subdomain 'coil' is not in the mesh; it has 'air', 'iron', 'magnet'\."),
        (
            {"iron": AIR, "air": AIR},
            0.0,
            r"every element needs a material; 216 of 648 have none, first element \d+ \(in subdomain 'magnet'\)\. Add",
        ),
        (LAYERS, {"rim": 0.0}, r"boundary 'rim' is not in the mesh; it has 'bottom', 'left', 'right', 'top'\."),
        (LAYERS, np.nan, r"potential of 'left' must be finite; it is not at 19 of 19 points, first "),
        (LAYERS, lambda x: x, r"potential of 'left' must have shape \(n,\) = \(19,\); got \(2, 19\)\."),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_does_not_fit_the_mesh_is_named(materials, potential, message):
    potential = potential if isinstance(potential, dict) else {"left": potential}
    with pytest.raises(ValueError, match=message):
        Magnetostatics(materials, potential=potential, order=1).solve(random_mesh())


def test_an_element_with_two_materials_is_named():
    mesh = random_mesh().with_subdomains({"gap": lambda x: x[0] > 2.5})
    problem = Magnetostatics(LAYERS | {"gap": AIR}, potential={"left": 0.0})
    with pytest.raises(ValueError, match=r"element \d+ has two materials, 'air' and 'gap'; give it exactly one\."):
        problem.solve(mesh)


def test_a_mesh_without_names_is_told_so():
    mesh = MeshTri().refined(1)
    with pytest.raises(
        ValueError, match=r"'air' is not in the mesh; it has none\. Name subdomains by mesh\.with_subdomains\."
    ):
        Magnetostatics({"air": AIR}, potential={"outer": 0.0}).solve(mesh)
    with pytest.raises(ValueError, match=r"boundary 'outer' is not in the mesh; it has none\."):
        Magnetostatics({"air": AIR}, potential={"outer": 0.0}).solve(mesh.with_subdomains({"air": everywhere}))
    with pytest.raises(ValueError, match=r"8 of 8 have none, first element 0 \(in no subdomain\)\."):
        Magnetostatics({}, potential={"outer": 0.0}).solve(mesh)


def test_a_part_without_a_fixed_value_is_named():
    square = MeshTri().refined(1)
    apart = MeshTri(np.hstack((square.p, square.p + 5)), np.hstack((square.t, square.t + square.p.shape[1])))
    mesh = apart.with_subdomains({"air": everywhere}).with_boundaries({"left": lambda x: x[0] < 1e-9})
    message = r"fixed nowhere on 1 of the 2 connected parts of the mesh, first the part of node 9\."
    with pytest.raises(ValueError, match=message):
        Magnetostatics({"air": AIR}, potential={"left": 0.0}).solve(mesh)


def test_extreme_numbers_have_no_finite_solution():
    with pytest.raises(np.linalg.LinAlgError, match="the potential is infinite or not a number"):
        Magnetostatics(LAYERS, potential={"left": 1e308, "right": -1e308}).solve(random_mesh())


def test_other_meshes_and_fields_are_refused():
    problem = Magnetostatics({"air": AIR}, potential={"outer": 0.0}, order=1)
    with pytest.raises(ValueError, match=r"mesh must be a skfem\.MeshTri; got MeshQuad1"):
        problem.solve(MeshQuad().with_subdomains({"air": everywhere}).with_boundaries({"outer": everywhere}))
    mesh, other = random_mesh(), random_mesh(cells=4)
    field = loaded().solve(other)
    with pytest.raises(
        ValueError, match=r"field must belong to the mesh, with 361 nodes .* its own has 169 and .* Solve"
    ):
        loaded().indicators(mesh, field)
