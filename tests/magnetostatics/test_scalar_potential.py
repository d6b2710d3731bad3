"""Magnets and iron in space against fields that are known, and what is refused."""

from functools import partial

import numpy as np
import pytest
from helpers.magnet_solids import blocks, cuboids, dipole, nested_balls
from helpers.sheets import MU0
from helpers.solids import box
from scipy.optimize import brentq
from skfem import MeshTet, MeshTet2, MeshTri
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Magnetostatics, Material

MAGNETISATION = 1e6
of_order_1 = partial(MagneticScalarPotential, order=1)
AIR = Material()
CELLS = (2, 4)


def rate(errors, cells=CELLS):
    """The power of the element size that errors fall by."""
    return float(np.log(errors[0] / errors[-1]) / np.log(cells[-1] / cells[0]))


def middles(mesh):
    return mesh.p[:, mesh.t].mean(axis=1)


def energy_error(field, exact):
    """``sqrt(int mu |H - H_h|^2)``, the exact field strength (3, nelements) at the middles."""
    difference = np.sum((field.field_strength - exact) ** 2, axis=0)
    return float(np.sqrt(np.sum(field.elements.volumes / field.reluctivity * difference)))


def mean_inside(field, name="ball"):
    rows = field.mesh.subdomains[name]
    volume = field.elements.volumes[rows]
    return field.flux_density[:, rows] @ volume / volume.sum()


@pytest.fixture(scope="module")
def balls():
    return [nested_balls(cells) for cells in CELLS]


@pytest.fixture(scope="module")
def magnetised(balls):
    """A ball magnetised along z: inside B = 2/3 mu0 M."""
    problem = of_order_1(
        {"ball": Material(remanence=(0.0, 0.0, MU0 * MAGNETISATION)), "air": AIR},
        {"outer": lambda x: dipole(x, MAGNETISATION / 3.0)[0]},
    )
    return problem, [problem.solve(mesh) for mesh in balls]


def test_magnetised_ball(magnetised):
    problem, fields = magnetised
    inside, errors = [], []
    for field in fields:
        exact = dipole(middles(field.mesh), MAGNETISATION / 3.0)[1]
        exact[:, field.mesh.subdomains["ball"]] = np.array([[0.0], [0.0], [-MAGNETISATION / 3.0]])
        errors.append(energy_error(field, exact))
        inside.append(abs(mean_inside(field)[2] / (2.0 / 3.0 * MU0 * MAGNETISATION) - 1.0))
        assert 0.85 < np.linalg.norm(problem.indicators(field.mesh, field)) / errors[-1] < 1.15
        assert np.abs(mean_inside(field)[:2]).max() < 0.005 * MU0 * MAGNETISATION
    assert rate(errors) > 0.85 and rate(inside) > 1.6 and inside[1] < 0.05


def inside_of_ball(law, uniform):
    """B in T where ``B = mu0 (3 H0 - 2 H(B))``."""
    return brentq(lambda b: b + MU0 * (2.0 * law.field_strength(np.array([b]))[0] - 3.0 * uniform), 0.0, 5.0)


@pytest.mark.parametrize("bh", [None, Froehlich(500.0, 1.6)])
def test_permeable_ball_in_a_uniform_field(balls, bh):
    """Inside ``B = mu0 (3 H0 - 2 H)`` whatever the law is; as an applied field and by potentials it is one solution."""
    uniform = 1e5 if bh else 1e3
    iron = Material(bh=bh) if bh else Material(1000.0)
    b = inside_of_ball(bh, uniform) if bh else 3000.0 / 1002.0 * MU0 * uniform
    moment, errors = uniform - 0.5 * (3.0 * uniform - b / MU0), []
    rim = lambda x: dipole(x, moment)[0]  # noqa: E731
    applied = of_order_1({"ball": iron, "air": AIR}, {"outer": rim}, applied_field=(0.0, 0.0, uniform))
    given = of_order_1(applied.materials, {"outer": lambda x: rim(x) - uniform * x[2]})
    for mesh in balls:
        one, other = applied.solve(mesh), given.solve(mesh)
        scale = np.abs(other.flux_density).max()
        np.testing.assert_allclose(one.flux_density, other.flux_density, atol=1e-6 * scale)
        np.testing.assert_allclose(one.potential - uniform * mesh.p[2], other.potential, atol=1e-6 * uniform)
        assert all(steps[-1].converged for steps in (one.newton, other.newton)) if bh else not one.newton
        assert one.energy == pytest.approx(other.energy, rel=1e-5)
        errors.append(abs(mean_inside(one)[2] / b - 1.0))
    assert rate(errors) > 1.5 and errors[1] < 0.12


def test_values_at_points(magnetised):
    _, (_, field) = magnetised
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 200))
    element = ka.find_elements(field.mesh, x)
    assert np.array_equal(field.flux_density_at(x), field.flux_density[:, element])
    np.testing.assert_allclose(field.potential_at(x), ka.interpolate(field.mesh, field.potential, x))
    assert np.isnan(field.flux_density_at([[9.0], [0.0], [0.0]])).all()
    exact = np.where(np.linalg.norm(x, axis=0) < 1.0, 0.0, dipole(x, MAGNETISATION / 3.0)[1])
    off = np.linalg.norm(x, axis=0) > 1.1
    plain, recovered = (
        np.linalg.norm((field.flux_density_at(x, recovered=kind) / MU0 - exact)[:, off]) for kind in (False, True)
    )
    assert recovered < 0.7 * plain
    with pytest.raises(ValueError, match=r"x must have shape \(3, n\); got \(2, 1\)"):
        field.flux_density_at([[0.0], [0.0]])


def test_flux_through_surfaces():
    """Of a uniform B through the sides of a box, and through a wall in it, which may have a side."""
    mesh = blocks([np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3)], {})
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    wall = np.flatnonzero(np.abs(middle[0] - 1.0) < 1e-9)
    low = (middles(mesh)[0, mesh.f2t[0, wall]] > 1.0).astype(np.int32)  # out of the lower half, towards larger x
    named = {
        **mesh.boundaries,
        "wall": wall,
        "out": OrientedBoundary(wall, low),
        "back": OrientedBoundary(wall, 1 - low),
    }
    mesh = MeshTet(mesh.p, mesh.t, _boundaries=named, _subdomains=mesh.subdomains)
    problem = of_order_1({"air": Material(1000.0)}, {"x-": 2.0, "x+": 0.0})  # H = 1 A/m along x
    field, flux = problem.solve(mesh), 1000.0 * MU0
    for name, wanted in {"x+": flux, "x-": -flux, "y-": 0.0, "wall": flux, "out": flux, "back": -flux}.items():
        assert field.flux(name) == pytest.approx(wanted, abs=1e-9 * flux)
    np.testing.assert_allclose(
        field.flux_density, np.array([[flux], [0.0], [0.0]]) * np.ones(mesh.nelements), atol=1e-12
    )
    with pytest.raises(ValueError, match=r"flux has 'air', which is no surface of the mesh; .* It is a subdomain"):
        field.flux("air")


def mirrored(mesh, axis):
    """The mesh and its image in the plane where that coordinate is 0, joined, with names of both."""
    scale = np.ones(3)
    scale[axis] = -1.0
    whole = mesh + MeshTet(mesh.p * scale[:, None], mesh.t)
    middle = np.where(np.arange(3)[:, None] == axis, np.abs(middles(whole)), middles(whole))
    element = mesh.element_finder()(*middle)
    names = {name: np.flatnonzero(np.isin(element, rows)) for name, rows in mesh.subdomains.items()}
    return whole.with_subdomains(names).with_boundaries({"outer": lambda x: np.full(x.shape[1], True)})


@pytest.mark.parametrize("kind", ["normal", "parallel"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_half_a_body(order, kind):
    """Energies, and forces along the plane, of the half that a plane of symmetry cuts off are half of the whole's."""
    axes = [np.linspace(-3.0, 3.0, 7), np.linspace(-3.0, 3.0, 7), np.linspace(0.0, 3.0, 4)]
    half = blocks(axes, {"a": ((-2.0, -1.0, 0.0), (-1.0, 1.0, 1.0)), "b": ((1.0, -2.0, 0.0), (2.0, 1.0, 1.0))})
    along = (0.0, 0.0, 1.0) if kind == "normal" else (1.0, 0.5, 0.0)
    materials = {name: Material(remanence=along) for name in "ab"} | {"air": AIR}
    far = [name for name in half.boundaries if name not in ("outer", "z-")]
    of_part = MagneticScalarPotential(materials, dict.fromkeys(far, 0.0), symmetry={"z-": kind}, order=order)
    of_whole = MagneticScalarPotential(materials, {"outer": 0.0}, order=order)
    part, whole = of_part.solve(half), of_whole.solve(mirrored(half, 2))
    assert 2.0 * part.energy == pytest.approx(whole.energy, rel=1e-9)
    for name in "ab":
        np.testing.assert_allclose(2.0 * part.force(name), whole.force(name), rtol=1e-6, atol=1e-2)
        np.testing.assert_allclose(2.0 * part.torque(name), whole.torque(name), rtol=1e-6, atol=1e-2)
    if order == 1:
        stored = of_part.vector_potential.solve(half).energy, of_whole.vector_potential.solve(mirrored(half, 2)).energy
        assert 2.0 * stored[0] == pytest.approx(stored[1], rel=1e-9)
    free = MagneticScalarPotential(materials, dict.fromkeys(far, 0.0), order=order).solve(half)
    with pytest.raises(ValueError, match=r"facets that are on no plane of symmetry.* Name them in symmetry"):
        free.force("a")


def test_cuboid_magnets_against_magpylib():
    """B at points, force and torque between two; of first order and better than that."""
    magpylib = pytest.importorskip("magpylib", reason="magpylib is the oracle; it is in the test extra")
    polarisation = {"a": (0.0, 0.0, 1.2), "b": (0.0, 0.5, 1.0)}
    one = magpylib.magnet.Cuboid(dimension=(0.02, 0.02, 0.01), polarization=polarisation["a"])
    other = magpylib.magnet.Cuboid(
        dimension=(0.02, 0.02, 0.01), polarization=polarisation["b"], position=(0.004, 0.0, 0.015)
    )
    force, torque = magpylib.getFT(one, other, pivot=(0.0, 0.0, 0.0), meshing=3000)
    materials = {name: Material(remanence=given) for name, given in polarisation.items()} | {"air": AIR}
    x = np.random.default_rng(0).uniform([-0.02, -0.02, -0.015], [0.02, 0.02, 0.03], (300, 3)).T
    exact = magpylib.getB([one, other], x.T, sumup=True).T
    errors = []
    for step, layers in ((0.005, 3), (0.0025, 5)):
        field = of_order_1(materials, {"outer": 0.0}).solve(cuboids(step, layers=layers))
        pairs = (
            (field.flux_density_at(x, recovered=True), exact),
            (field.force("b"), force),
            (field.torque("b"), torque),
        )
        errors.append([np.linalg.norm(one - other) / np.linalg.norm(other) for one, other in pairs])
        reaction = field.force("a") + field.force("b")
        assert np.linalg.norm(reaction) < 0.03 * np.linalg.norm(force)
    at_points, of_force, of_torque = np.log2(np.divide(*errors))
    assert at_points > 0.9 and of_force > 1.2 and of_torque > 0.9 and errors[1][1] < 0.13


BOX = blocks([np.linspace(0.0, 1.0, 3)] * 3, {"magnet": ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))})
MAGNET = {"magnet": Material(remanence=(0.0, 0.0, 1.0)), "air": AIR}


def refused(match, mesh=BOX, materials=MAGNET, **arguments):
    with pytest.raises(ValueError, match=match):
        of_order_1(materials, **arguments).solve(mesh)


def test_bad_input():
    flat = {"magnet": Material(remanence=(0.0, 1.0)), "air": AIR}
    refused(
        r"remanence of 'magnet' must have three components \(x, y, z\) in space; got \(0\.0, 1\.0\)\.", materials=flat
    )
    with pytest.raises(ValueError, match=r"remanence of 'magnet' must have two components \(x, y\) in the plane; got"):
        Magnetostatics(MAGNET, {"outer": 0.0})
    refused("current density.* as applied_field", materials={**MAGNET, "air": Material(current_density=1.0)})
    refused("potential has 'air', which is no surface of the mesh; its boundaries are 'outer'.* It is a subdomain",
            potential={"air": 0.0})  # fmt: skip
    refused("symmetry has 'left', which is no surface", symmetry={"left": "normal"})
    refused("symmetry of 'z-' must be 'parallel' or 'normal'", symmetry={"z-": "odd"})
    refused("'outer' must be plane", symmetry={"outer": "normal"})
    refused("estimator must be one of 'residual', 'recovery', 'bracket'", estimator="equilibrated")
    refused("applied_field must be a function", applied_field=(1.0, 2.0))
    refused(r"applied_field must have shape \(3, n\)", applied_field=lambda x: x[:2], potential={"outer": 0.0})
    refused("potential must map names", potential=0.0)
    refused(r"materials\['air'\] must be a Material", materials={"air": 1.0})


def test_a_symmetry_that_is_not_closed():
    part = BOX.with_boundaries({"part": lambda x: (x[2] < 1e-9) & (x[0] < 0.5)})
    refused(r"the symmetry at 'part' is not closed: \d+ of the \d+ facets", part, symmetry={"part": "parallel"})


def test_other_kinds_of_mesh():
    plane = MeshTri().refined(2).with_defaults().with_subdomains({"air": lambda x: x[0] < 9.0})
    refused("mesh must be a skfem.MeshTet; got MeshTri1. Plane meshes are for Magnetostatics", plane, {"air": AIR})
    solid = box(1).with_defaults().with_subdomains({"air": lambda x: x[0] < 9.0})
    for mesh in (solid, MeshTet2.from_mesh(solid)):
        with pytest.raises(ValueError, match=r"got MeshTet\d\. .*Tetrahedra are for MagneticScalarPotential"):
            Magnetostatics({"air": AIR}, {"left": 0.0}).solve(mesh)
