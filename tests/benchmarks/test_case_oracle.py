"""A case is compared with NGSolve, which has the same minimiser in the same space, or with given values."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from benchmarks.peers.case_oracle import report
from benchmarks.peers.ngsolve_field import NgsolveField
from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.magnetostatics import Magnetostatics, Material, StoredEnergy

BOXES = {
    "magnet": ((0.25, 0.25), (0.5, 0.5)),
    "bar": ((0.25, 0.625), (0.75, 0.75)),
    "coil": ((0.625, 0.25), (0.75, 0.5)),
}
STEEL = {"bh": [[1.0, 100.0], [1.5, 700.0], [1.8, 8000.0], [2.1, 60000.0]]}
CASE = {
    "mesh": "device.msh",
    "order": 2,
    "materials": {
        "magnet": {"permeability": 1.05, "remanence": [0.6, 1.0]},
        "bar": STEEL,
        "coil": {},
        "air": {},
    },
    "potential": {"bottom": 0.0, "top": 0.0},
    "ampere_turns": {"coil": 2e4},
    "outputs": {
        "linkage": {"quantity": "flux_linkage", "coil": "coil", "turns": 100},
        "gap": {"quantity": "flux_density", "at": [0.41, 0.57], "component": "y"},
        "a": {"quantity": "potential", "at": [0.41, 0.57]},
        "coenergy": {"quantity": "coenergy"},
    },
}
TEXT = """
mesh = "device.msh"
order = 2
materials.magnet = {permeability = 1.05, remanence = [0.0, 1.2]}
materials.bar = {permeability = 100.0}
materials.coil = {}
materials.air = {}
potential.bottom = 0.0
adapt.passes = 1
outputs.pull = {quantity = "force", body = "magnet", component = "y"}
"""
NONLINEAR_MAGNET = {"bh": {"law": "brauer", "k1": 5e4, "k2": 10.0, "k3": 1.5}, "coercivity": [2e4, 5e4]}
VARIANTS = {
    "tabulated steel": {},
    "nonlinear magnet and a depth": {"depth": 0.2, "materials": CASE["materials"] | {"magnet": NONLINEAR_MAGNET}},
    "linear potentials": {"potential": {"left": 0.1, "right": -0.2, "bottom": "0.1 - 0.3*x"}},
    "a table": {"potential": {"left": {"over": "y", "points": [[0.0, 0.0], [0.5, 0.2], [1.0, 0.1]]}}},
    "antiperiodic": {"antiperiodic": [["left", "right"]]},
    "periodic": {"periodic": [["left", "right"]]},
    "Halbach": {
        "materials": CASE["materials"]
        | {"magnet": {"remanence": {"pattern": "halbach", "magnitude": 1.2, "pole_pairs": 2}}}
    },
}


def in_box(x, low, high):
    return np.all((x > np.reshape(low, (2, 1))) & (x < np.reshape(high, (2, 1))), axis=0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The mesh of a magnet, a bar and a coil in a square of air."""
    folder, mesh = tmp_path_factory.mktemp("oracle"), MeshTri().refined(4).with_defaults()
    parts = {name: (lambda x, box=box: in_box(x, *box)) for name, box in BOXES.items()}
    parts["air"] = lambda x: ~np.any([in_box(x, *box) for box in BOXES.values()], axis=0)
    ka.write_mesh(folder / "device.msh", mesh.with_subdomains(parts))
    return folder


@pytest.mark.parametrize("variant", VARIANTS)
def test_ngsolve_has_the_same_minimiser_in_the_same_space(folder, variant):
    pytest.importorskip("ngsolve")
    case = case_of(CASE | VARIANTS[variant], folder)
    mesh = fitting_mesh(case)
    ours, theirs = case.problem.solve(mesh), NgsolveField(mesh, case.problem, 2)
    assert theirs.energy == pytest.approx(ours.energy, rel=1e-6)
    for output in case.outputs.values():
        assert output.function(theirs) == pytest.approx(output(ours), rel=1e-6)


def test_force_torque_and_parts_agree_at_high_order(folder):
    pytest.importorskip("ngsolve")
    case = case_of(CASE | {"order": 4}, folder)
    mesh = fitting_mesh(case)
    ours, theirs = case.problem.solve(mesh), NgsolveField(mesh, case.problem, 4)
    assert_allclose(theirs.force("magnet"), ours.force("magnet"), rtol=0.01)
    assert theirs.torque("magnet", (0.4, 0.4)) == pytest.approx(ours.torque("magnet", (0.4, 0.4)), rel=0.01)
    assert theirs.energy_in("bar") == pytest.approx(StoredEnergy("bar")(ours), rel=1e-6)


def disc_with_a_core(half):
    """A disc, or the right half of a disc, with a named rim."""
    mesh = MeshTri.init_circle(3)
    if half:
        inside = mesh.p[0, mesh.t].min(axis=0) > -1e-9
        mesh = mesh.restrict(np.flatnonzero(inside))
    sides = mesh.boundary_facets()
    rim = sides[np.abs(mesh.p[:, mesh.facets[:, sides]]).max(axis=(0, 1)) > 0.0]
    rim = rim[np.hypot(*mesh.p[:, mesh.facets[:, rim]]).min(axis=0) > 1.0 - 1e-9]
    parts = {"core": lambda x: np.hypot(*x) < 0.5, "air": lambda x: np.hypot(*x) >= 0.5}
    return MeshTri(mesh.p, mesh.t).with_boundaries({"rim": rim}).with_subdomains(parts)


@pytest.mark.parametrize(("axisymmetric", "order", "rel"), [(False, 2, 1e-9), (True, 6, 1e-5)])
def test_an_open_boundary_with_an_applied_field_agrees(axisymmetric, order, rel):
    """Around an axis the unknowns are r A here and A / r there, so that only the limits agree."""
    pytest.importorskip("ngsolve")
    mesh, materials = disc_with_a_core(axisymmetric), {"core": Material(100.0), "air": Material()}
    applied = {"open_boundary": "rim", "applied_field": (0.0 if axisymmetric else 1e5, 2e5)}
    problem = Magnetostatics(materials, **applied, axisymmetric=axisymmetric, order=order)
    ours, theirs = problem.solve(mesh), NgsolveField(mesh, problem, order)
    assert theirs.energy == pytest.approx(ours.energy, rel=rel)


def test_curved_sides_agree():
    pytest.importorskip("ngsolve")
    disc = MeshTri2.init_circle(2)
    disc = disc.with_boundaries({"rim": disc.boundary_facets()}).with_subdomains({"coil": lambda x: x[0] < 2.0})
    problem = Magnetostatics({"coil": Material(current_density=1e3)}, {"rim": 0.0}, order=2)
    ours, theirs = problem.solve(disc), NgsolveField(disc, problem, 2)
    near_the_rim = 0.985 * np.array([[np.cos(0.3)], [np.sin(0.3)]])
    assert theirs.energy == pytest.approx(ours.energy, rel=1e-9)
    assert_allclose(theirs.potential_at(near_the_rim), ours.potential_at(near_the_rim), rtol=1e-6)


def written(folder, name, text):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def case_file(folder):
    return written(folder, "device.toml", TEXT)


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_case_beside_ngsolve(case_file):
    pytest.importorskip("ngsolve")
    _, header, _, energy, pull = report(case_file, 1, None).splitlines()
    assert "NGSolve, order 3" in header and cells(energy)[0] == "energy (J/m)" and cells(pull)[0] == "pull (N/m)"
    *_, difference, change = map(float, cells(energy)[1:])
    assert change < difference < 5.0


def test_a_case_beside_values_of_another_program(folder, case_file, monkeypatch):
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    first = report(case_file, 0, written(folder, "values.toml", "pull = 1.0"))
    value = float(cells(first.splitlines()[-1])[1])
    again = report(case_file, 0, written(folder, "values.toml", f"pull = {value / 1.01!r}"))
    assert float(cells(again.splitlines()[-1])[-1]) == pytest.approx(1.0, rel=1e-3)
    assert len(again.splitlines()) == 4


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("pul = 1.0", "no output 'pul'.*Did you mean 'pull'"),
        ("pull = 'a'", "pull must be a finite number"),
        ("pull", "is not TOML"),
        ("", "there are no values"),
    ],
)
def test_values_that_do_not_fit(folder, case_file, text, fault):
    with pytest.raises(ValueError, match=fault):
        report(case_file, 0, written(folder, "values.toml", text))


def test_what_the_oracle_needs(folder, case_file, monkeypatch):
    pytest.importorskip("ngsolve")
    at_points = written(folder, "points.toml", f"{TEXT}potential.node = 0.0\npoints.node = [0.5, 0.5]\n")
    with pytest.raises(ValueError, match="potentials on boundaries only"):
        report(at_points, 0, None)
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    with pytest.raises(ValueError, match="install the extra 'bench'"):
        report(case_file, 0, None)
