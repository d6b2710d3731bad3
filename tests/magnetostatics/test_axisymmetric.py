"""Axisymmetric magnetostatics against known inductances and exact fields."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import INCH, coil, coil_mesh, plunger
from helpers.mesh_files import gmsh, gmsh_session, needs_gmsh
from helpers.meshes import generic_square, square
from skfem import Basis, ElementTriP0, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Brauer, Magnetostatics, Material
from kohonen_adapt.magnetostatics.materials.laws import flux_density_of
from kohonen_adapt.problem.functional_value import functional_value

MU0 = 4e-7 * np.pi
INDUCTANCE = 22.94524e-3  # H, of FEMM's coil: `benchmarks.problems.thick_coil`


@pytest.mark.parametrize(("order", "bound"), [(1, 0.003), (2, 5e-5), (3, 2e-5)])
def test_a_coil_has_its_inductance(order, bound):
    """22.945 mH in free space, of which energies are lower bounds."""
    meshes = [coil_mesh(fineness, 3.0) for fineness in ((3, 2) if order == 1 else (1,))]
    found = [2.0 * coil(order=order).solve(mesh).energy for mesh in meshes]
    assert 1.0 - bound < found[0] / INDUCTANCE < 1.0
    if order == 1:
        assert (9 * found[0] - 4 * found[1]) / 5 == pytest.approx(INDUCTANCE, rel=0.0005)


@needs_gmsh
def test_an_open_boundary_removes_the_error_of_a_wall(tmp_path):
    """A = 0 at 0.15 m gives 22.66 mH, the open boundary there the inductance in free space, by the flux linkage."""
    conditions = {"walled": {"potential": {"rim": 0.0}}, "open": {"open_boundary": "rim"}}
    wanted = {"walled": 22.66e-3, "open": 22.945e-3}
    found = {name: [] for name in conditions}
    for size in (INCH / 4, INCH / 8):
        mesh = drawn_half_disk(tmp_path, 0.15, size)
        for name, given in conditions.items():
            problem = Magnetostatics(coil().materials, ampere_turns={"coil": 1000.0}, axisymmetric=True, **given)
            found[name].append(linkage(mesh, problem.solve(mesh)))
    for name, (coarse, fine) in found.items():
        assert (4 * fine - coarse) / 3 == pytest.approx(wanted[name], rel=0.002)


def linkage(mesh, field):
    """Flux through the turns of the coil at 1 A: int 2 pi r A J over its section."""
    moment = field.volume / mesh.p[0, mesh.t].mean(axis=0) * field.current_density
    return np.sum(moment * field.unknown[mesh.t].mean(axis=0))


def drawn_half_disk(folder, radius, size):
    """The coil in a half disk of air, by Gmsh."""
    with gmsh_session() as model:
        disk = [(2, model.occ.addDisk(0, 0, 0, radius, radius))]
        half = [(2, model.occ.addRectangle(0, -2 * radius, 0, 2 * radius, 4 * radius))]
        section = [(2, model.occ.addRectangle(0.5 * INCH, -INCH, 0, INCH, 2 * INCH))]
        _, parts = model.occ.fragment(model.occ.intersect(disk, half)[0], section)
        model.occ.synchronize()
        (_, inside), surfaces = parts[1][0], [tag for _, tag in model.getEntities(2)]
        model.addPhysicalGroup(2, [inside], name="coil")
        model.addPhysicalGroup(2, [tag for tag in surfaces if tag != inside], name="air")
        arcs = [tag for _, tag in model.getEntities(1) if model.getType(1, tag) != "Line"]
        model.addPhysicalGroup(1, arcs, name="rim")
        for bound in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(bound, size)
        model.mesh.generate(2)
        gmsh.write(str(folder / "half.msh"))
    return ka.read_mesh(folder / "half.msh")


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


def test_cubic_elements_have_the_field_on_the_axis_of_a_coarse_mesh():
    field, z = coil(order=3).solve(coil_mesh(1, 3.0)), np.linspace(-1.2, 1.2, 49) * INCH
    np.testing.assert_allclose(field.flux_density_at([0 * z, z])[1], on_axis(z), rtol=1e-3)


@needs_gmsh
def test_the_field_on_the_axis_of_an_irregular_mesh(tmp_path):
    """In the elements that touch the axis, as Gmsh meshes them: 1 % of the largest where 26 % were wrong."""
    mesh = drawn_half_disk(tmp_path, 0.15, INCH / 8)
    field = Magnetostatics(coil().materials, open_boundary="rim", ampere_turns={"coil": 1000.0}, axisymmetric=True)
    touching = np.any(mesh.p[0, mesh.t] == 0.0, axis=0)
    r, z = mesh.p[:, mesh.t[:, touching]].mean(axis=1)
    slope = (on_axis(z + 1e-5) - on_axis(z - 1e-5)) / 2e-5
    off = field.solve(mesh).flux_density[:, touching] - np.stack((-0.5 * r * slope, on_axis(z)))
    assert np.sqrt(np.mean(np.sum(off**2, axis=0))) < 0.015 * on_axis(0.0)


def in_uniform_field(mesh, order=1):
    """A_phi = 0.4 r all round, so that B_z is 0.8 T."""
    mesh = mesh.with_subdomains({"air": lambda x: x[0] < 2}).with_boundaries({"all": lambda x: x[0] > -1})
    problem = Magnetostatics({"air": Material()}, {"all": lambda x: 0.4 * x[0]}, axisymmetric=True, order=order)
    return problem.solve(mesh)


def test_a_uniform_field_is_told_exactly_at_the_axis():
    """Of order 1 by every element that has a side there, if nodes have what is exact."""
    field = in_uniform_field(generic_square(8))
    field = replace(field, potential=0.4 * field.mesh.p[0])
    beside = np.sum(field.mesh.p[0, field.mesh.t] == 0.0, axis=0) == 2
    np.testing.assert_allclose(field.flux_density[:, beside], [[0.0], [0.8]] * np.ones(beside.sum()), atol=1e-12)
    assert field.energy_density[beside] == pytest.approx(0.8**2 / (2 * MU0), rel=1e-12)


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


DEVICES = {
    "coil": lambda: (coil_mesh(1, 0.1), coil()),
    "steel": plunger,
    "magnet": lambda: magnet(),
    "open": lambda: opened(),
}


@pytest.mark.parametrize(
    ("order", "device"),
    [(1, "coil"), (2, "coil"), (3, "coil"), (1, "steel"), (2, "steel"), (1, "magnet"), (3, "magnet")]
    + [(order, "open") for order in (1, 2, 3)],
)
def test_the_equations_minimise_the_functional(order, device):
    """No change of the solution lowers the value of `Ritz`; of linear material it is less half of what is stored."""
    mesh, problem = DEVICES[device]()
    problem = replace(problem, order=order)
    field = problem.solve(mesh)
    ritz = problem.ritz(mesh, field)
    least, scale = functional_value(mesh, ritz), np.abs(field.unknown).max()
    change = np.where(ritz.fixed, 0.0, 1e-3 * scale * np.random.default_rng(0).normal(size=field.unknown.size))
    up, down = (functional_value(mesh, replace(ritz, values=ritz.values + sign * change)) for sign in (1.0, -1.0))
    assert min(up, down) > least and abs(up - down) < 0.02 * (up + down - 2.0 * least)
    if device == "coil":
        assert least == pytest.approx(-0.5 * problem.energy_norm(mesh, field) ** 2, rel=1e-9)


def opened():
    """A ball of iron in a uniform field, with an open boundary."""
    materials, given = {"ball": Material(5.0), "air": Material()}, {"applied_field": (0.0, 3e5)}
    return half_disk(8, 0.02), Magnetostatics(materials, open_boundary="rim", axisymmetric=True, **given)


def magnet():
    """A ball magnet that turns, in a half disk of air."""
    mesh = half_disk(8, 0.02)
    ball = Material(remanence=lambda x: np.stack([20.0 * x[0], 1.0 + 20.0 * x[1]]))
    return mesh, Magnetostatics({"ball": ball, "air": Material()}, {"rim": 0.0}, axisymmetric=True)


@pytest.mark.parametrize("estimator", ["residual", "recovery"])
def test_the_estimate_of_the_coil_is_near_its_error(estimator):
    """The error against a finer solution: with 1 / r at the middle of elements it is not what the energy lacks."""
    problem, mesh = coil(estimator), coil_mesh(1, 3.0)
    field, finer = problem.solve(mesh), problem.solve(coil_mesh(4, 3.0))
    basis = Basis(mesh, ElementTriP0(), intorder=4)
    x = np.asarray(basis.global_coordinates())
    off = finer.flux_density_at(x.reshape(2, -1), recovered=True).reshape(x.shape) - field.flux_density[:, :, None]
    error = np.sqrt(np.sum(2 * np.pi * x[0] * off**2 * basis.dx) / MU0)
    assert problem.energy_norm(mesh, field) == pytest.approx(np.sqrt(2 * field.energy))
    assert 0.85 < np.linalg.norm(problem.indicators(mesh, field)) / error < 1.25


def test_flux_linkage_and_energy_agree():
    mesh = coil_mesh(1, 0.15)
    field = coil().solve(mesh)
    assert field.axisymmetric
    assert 0.5 * linkage(mesh, field) == pytest.approx(field.energy, rel=1e-9)
    inside = field.flux_density_at(np.array([[0.003], [0.0]]))[:, 0]
    assert inside[1] > 0.0 and abs(inside[0]) < 0.2 * inside[1]  # current along phi, flux along z
    axis = mesh.p[0] == 0
    assert not field.potential[axis].any() and np.all(field.potential[~axis & (np.hypot(*mesh.p) < 0.1)] > 0.0)


def half_disk(n, radius):
    """The half x > 0 of a disk, 2 n x n squares bent to circles; the ball within half of the radius."""
    quarter = square(n, 0.0, radius)
    whole = quarter + quarter.mirrored((0.0, -1.0))
    x, y = whole.p
    bent = whole.p * np.maximum(np.abs(x), np.abs(y)) / np.maximum(np.hypot(x, y), 1e-30)
    mesh = MeshTri(bent, whole.t).with_boundaries({"rim": lambda x: np.hypot(*x) > (1 - 0.25 / n) * radius})
    inside = np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) < radius / 2
    return mesh.with_subdomains({"ball": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})


@pytest.mark.parametrize(
    ("order", "counts", "bounds"), [(1, (9, 18, 36), (0.003, 0.015, 0.003)), (2, (4, 8, 16), (5e-4, 1e-3, 0.003))]
)
def test_a_ball_magnet_sees_no_open_boundary(order, counts, bounds):
    """B = 2/3 Br inside, the field of a dipole outside; the energy in the ball is Br^2 / 18 mu0 of its volume."""
    errors = []
    for n in counts:
        mesh = half_disk(n, 0.02)
        problem = Magnetostatics(
            {"ball": Material(remanence=(0.0, 1.2)), "air": Material()},
            open_boundary="rim",
            axisymmetric=True,
            order=order,
        )
        field = problem.solve(mesh)
        ball = mesh.subdomains["ball"]
        volume = field.volume[ball]
        along = np.sum(volume * field.flux_density[1, ball]) / volume.sum()
        stored = np.sum((field.volume * field.energy_density)[ball]) / volume.sum()
        rim = np.flatnonzero((np.hypot(*mesh.p) > 0.0199) & (mesh.p[0] > 0.005))
        dipole = 1.2 * 0.01**3 / 3 * mesh.p[0, rim] / 0.02**3
        off = np.linalg.norm(field.potential[rim] - dipole) / np.linalg.norm(dipole)
        errors.append([abs(along / 0.8 - 1), abs(stored / (1.2**2 / 18 / MU0) - 1), off])
    assert np.all(np.array(errors[-1]) < bounds)
    rates = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert np.all(rates[2 * (order - 1) :] > 1.5)  # of order 2 what the ball's energy lacks is rounding of its outline


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


def test_adapting_a_coil():
    mesh = coil_mesh(1, 0.5)
    problem = coil()
    result = ka.adapt(mesh, problem, passes=2)
    assert result.estimate < 0.8 * np.linalg.norm(problem.indicators(mesh, problem.solve(mesh)))
    values = [step.functional for step in result.history]
    assert values == sorted(values, reverse=True) and all(step.polish_gain > 0.0 for step in result.history[1:])
    assert 2 * problem.solve(mesh).energy < 2 * result.solution.energy < 22.945e-3
    assert np.sum(result.mesh.p[0] == 0.0) > 0 and result.mesh.p[0].min() == 0.0


@pytest.mark.parametrize(("order", "curved"), [(1, False), (2, False), (2, True)])
def test_an_open_boundary_is_polished(order, curved):
    """And its functional is that of the solutions."""
    mesh, problem = opened()
    problem = replace(problem, order=order, curved=curved)
    result = ka.adapt(mesh, problem, passes=1)
    last = result.history[-1]
    assert "No polish" not in result.message and last.polish_gain > 0.0
    value = functional_value(last.mesh, problem.ritz(last.mesh, problem.solve(last.mesh)))
    assert value == pytest.approx(last.functional, rel=1e-12)


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
