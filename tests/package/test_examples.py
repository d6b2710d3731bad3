"""The examples run as a reader would run them, and keep what they promise."""

import ast
import importlib
import runpy
import sys
import tomllib

import meshio
import numpy as np
import pytest
from helpers.mesh_files import gmsh, gmsh_session, needs_gmsh
from helpers.places import EXAMPLES, names_in
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case
from kohonen_adapt.loop.figures import energy_norm_error
from kohonen_adapt.mesh.measures import area

pytestmark = pytest.mark.slow


def run(name, folder, **sizes):
    return runpy.run_path(str(EXAMPLES / name))["main"](folder, **sizes)


def example(name):
    """Return a fixture of the folder of an example and of what its `main` returns."""

    @pytest.fixture(scope="module", name=name)
    def ran(tmp_path_factory):
        folder = tmp_path_factory.mktemp(name)
        found = run(f"{name}.py", folder)
        return folder, *(found if isinstance(found, tuple) else [found])

    return ran


EXAMPLES_RUN = ("magnet", "l_shape", "own_problem", "motor", "actuator", "fichera", "bracket")
magnet, l_shape, own_problem, motor, actuator, fichera, bracket = map(example, EXAMPLES_RUN)


SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py") if "__main__" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_says_what_it_shows_and_where_it_writes(name, monkeypatch, capsys):
    """As `python examples/NAME --help`, which would import everything anew for each."""
    monkeypatch.setattr(sys, "argv", [str(EXAMPLES / name), "--help"])
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.syspath_prepend(EXAMPLES)
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    said = capsys.readouterr().out
    assert end.value.code == 0
    doc = ast.get_docstring(ast.parse((EXAMPLES / name).read_text(encoding="utf-8")))
    assert doc.splitlines()[0] in said and "--out" in said


@pytest.mark.parametrize("name", ["magnet", "actuator"])
def test_a_case_is_what_its_script_is(request, name):
    """The same mesh, bit for bit; the case of the magnet has a tolerance instead of passes."""
    case = read_case(EXAMPLES / f"{name}.toml")
    if name == "magnet":
        script = runpy.run_path(str(EXAMPLES / "magnet.py"))
        after = ka.adapt(ka.read_mesh(script["MESH"], scale=1e-3), script["PROBLEM"], rtol=case.adapt["rtol"])
    else:
        after = request.getfixturevalue(name)[1][0]
    again = ka.adapt(fitting_mesh(case), case.problem, outputs=case.outputs, **case.adapt)
    assert_array_equal(again.mesh.p, after.mesh.p)
    assert_array_equal(again.mesh.t, after.mesh.t)


def test_every_case_has_been_compared():
    assert {path.stem for path in EXAMPLES.glob("*.toml")} == {"magnet", "actuator", "plunger"}


@needs_gmsh
def test_the_drawn_case_is_the_actuator_of_its_gap():
    """The same materials and sources as the case of 1 mm, on the mesh that the script reads."""
    drawn_case, case = (read_case(EXAMPLES / f"{name}.toml") for name in ("plunger", "actuator"))
    drawn_keys, keys = (tomllib.loads(each.text) for each in (drawn_case, case))
    assert {**drawn_keys, "mesh": ..., "adapt": ...} == {**keys, "mesh": ..., "adapt": ...}
    mesh = fitting_mesh(drawn_case)
    nodes = {name: np.unique(mesh.t[:, mesh.subdomains[name]]) for name in ("plunger", "core")}
    height = {name: mesh.p[1, each[mesh.p[0, each] < 1e-9]] for name, each in nodes.items()}  # on the axis
    gap = 1e-3 * drawn_case.mesh.parameters["gap"]
    assert height["plunger"].min() - height["core"].max() == pytest.approx(gap, rel=1e-9)


def test_the_high_order_has_an_error_below_three_in_ten_thousand_and_states_it(tmp_path):
    result = run("high_order.py", tmp_path)
    error = np.sqrt(0.2140758022 - result.best.energy_norm**2)  # the square of the exact norm, by order 8
    assert result.best.order == 4 and error < 3e-4 * result.best.energy_norm
    assert 0.6 < result.estimate / error < 1.4


def test_own_problem_shows_an_energy_error_that_is_near_the_truth(own_problem):
    """It said 30 % where the error was 4.9 %."""
    result = own_problem[1]
    for step in result.history:
        error = np.sqrt(0.2140758 - step.energy_norm**2)  # that of the exact solution is known
        assert energy_norm_error(step) == pytest.approx(100.0 * error / step.energy_norm, rel=0.1)
    assert "Energy-norm error %" in str(result)


def test_magnet_writes_its_files(magnet):
    folder, _, after = magnet
    assert names_in(folder) == ["magnet.html", "magnet.msh", "magnet.png", "magnet.vtu"]
    file = meshio.vtu.read(folder / "magnet.vtu")
    assert {"B (T)", "H (A per m)", "indicator", "region"} <= file.cell_data.keys()
    assert_array_equal(file.point_data["A (Wb per m)"], after.solution.potential)
    for name in ("magnet.msh", "magnet.vtu"):
        back = ka.read_mesh(folder / name)
        assert_array_equal(back.p, after.mesh.p)
        assert set(back.subdomains) == {"iron", "magnet", "air"} and set(back.boundaries) == {"outer"}


def test_l_shape_has_less_than_half_the_error_at_the_same_nodes_and_tells_it(l_shape):
    folder, after, errors = l_shape
    assert after.mesh.nvertices == 833 and errors[0] == pytest.approx(0.079118, abs=1e-6)
    assert min(errors) * np.sqrt(833) < 0.9  # 2.28 at the start
    assert errors[after.best.number] < 1.05 * min(errors)
    for step, error in zip(after.history, errors, strict=True):
        assert energy_norm_error(step) == pytest.approx(100.0 * error / step.energy_norm, rel=0.15)
    assert names_in(folder) == ["l_shape.png", "l_shape.vtu"]
    assert_array_equal(meshio.vtu.read(folder / "l_shape.vtu").point_data["u"], after.solution)


@pytest.mark.parametrize(
    ("example", "share", "rel"), [("magnet", 0.8, 1e-12), ("motor", 0.5, 2e-2), ("actuator", 0.6, 2e-2)]
)
def test_devices_have_a_smaller_error_at_the_same_nodes_and_names(request, example, share, rel):
    found = request.getfixturevalue(example)
    before, after = found[1:] if example == "magnet" else (found[1][0].history[0], found[1][0])
    assert after.estimate < share * before.estimate
    assert after.mesh.nvertices == before.mesh.nvertices
    assert ka.quality(after.mesh).min() >= 0.02
    assert after.mesh.boundaries.keys() == before.mesh.boundaries.keys()
    assert after.mesh.subdomains.keys() == before.mesh.subdomains.keys()
    for name, elements in before.mesh.subdomains.items():  # facets on an arc may come to cut off more of it, or less
        wanted = area(before.mesh)[elements].sum()
        assert area(after.mesh)[after.mesh.subdomains[name]].sum() == pytest.approx(wanted, rel=rel)


def test_motor_keeps_its_circles_and_two_layers_in_the_gap(motor):
    mesh = motor[1][0].mesh
    radius = np.hypot(*mesh.p)
    for name, wanted in (("outer", 0.080), ("ring", 0.0445), ("inner", 0.015)):
        assert_allclose(radius[mesh.facets[:, mesh.boundaries[name]]], wanted, rtol=1e-12)
    corners = radius[mesh.t[:, mesh.subdomains["gap"]]]
    assert corners.min() == pytest.approx(0.044, rel=1e-12)
    assert corners.max() == pytest.approx(0.045, rel=1e-12)
    assert np.ptp(corners, axis=0).max() < 0.00098  # no element from the rotor to the bore


def test_motor_starts_every_angle_from_the_last(motor):
    """The mesh of Gmsh has thrice the error of an adapted one; a turned adapted mesh hardly more."""
    first, *others = motor[1]
    assert first.history[0].estimate > 2.5 * first.estimate
    for result in others:
        assert result.history[0].estimate < 1.1 * result.estimate < 1.15 * first.estimate


def test_motor_has_the_mean_torque_of_its_electric_power(motor):
    """Twelve angles integrate what is periodic over the slot pitch."""
    _, _, (plain, adapted) = motor
    eggshell, electric, cogging = adapted[:, :-1].mean(axis=1)
    assert eggshell == pytest.approx(electric, rel=1.5e-3)
    assert abs(cogging) < 0.015 * np.ptp(adapted[2])
    off = abs(plain[0, :-1].mean() / plain[1, :-1].mean() - 1.0)
    assert 2.0 * abs(eggshell / electric - 1.0) < off


def test_actuator_pulls_as_its_co_energy_grows(actuator):
    """F = dW'/dgap at constant current; the rest is mostly what adapted meshes of 1600 nodes leave out."""
    _, results, force, _ = actuator
    coenergy = [result.solution.coenergy for result in results]
    work = runpy.run_path(str(EXAMPLES / "actuator.py"))["work"]
    assert work(force[1]) == pytest.approx(coenergy[0] - coenergy[-1], rel=0.01)


def test_actuator_adapted_is_nearer_to_the_fine_meshes(actuator):
    _, _, (before, after), fine = actuator
    assert np.all(2.0 * np.abs(after - fine) < np.abs(before - fine))


def test_fichera_has_less_than_two_fifths_of_the_error_at_the_same_nodes(fichera):
    """A uniform mesh would need twenty times the nodes for that."""
    folder, result = fichera
    errors = [np.sqrt(0.3979433 + 2.0 * step.functional) for step in result.history]
    assert errors[0] == pytest.approx(0.2027, abs=1e-4) and min(errors) < 0.36 * errors[0]
    assert {step.mesh.nvertices for step in result.history} == {1206}
    for step in result.history:
        mesh = step.mesh
        assert area(mesh).sum() == pytest.approx(7.0, rel=1e-12) and ka.quality(mesh).min() > 0.05 * (1 - 1e-9)
    back = ka.read_mesh(folder / "fichera.msh")
    corner = back.p[:, back.facets[:, back.boundaries["corner"]]]
    assert np.all(np.isclose(corner.min(axis=0), 0.0, atol=1e-12)) and np.all(corner > -1e-12)


def test_bracket_is_nearer_to_fine_meshes_with_its_nodes_on_its_cylinders(bracket):
    """Meshes of Gmsh of up to 23 500 nodes, and elements of second order, go to 0.1763 W."""
    folder, mesh, heats = bracket
    assert mesh.nvertices == 803 and abs(heats[-1] - 0.1763) < abs(heats[0] - 0.1763) / 3.0
    x, y, _ = mesh.p[:, np.unique(mesh.facets[:, mesh.boundaries["bore"]])]
    assert_allclose(np.hypot(x - 0.03, y - 0.01), 0.005, rtol=1e-12)
    back, before = ka.read_groups(folder / "bracket.msh"), ka.read_groups(EXAMPLES / "bracket.msh")
    assert back.names == before.names and set(mesh.subdomains) == {"pin", "plate"}


def test_gripper_pulls_as_on_fine_meshes_once_it_is_adapted(tmp_path, monkeypatch):
    """Around its axis in the plane, of order 2 and adapted, it is 76.11 N and 0.1291 J."""
    monkeypatch.syspath_prepend(EXAMPLES)
    gripper = importlib.import_module("gripper")  # which the processes of a sweep can import, too
    row = gripper.gripped(1e-3)
    assert row["nodes"] == pytest.approx(1510, rel=0.02)
    assert row["energy adapted (J)"] == pytest.approx(0.1291, rel=0.003)
    assert abs(row["force adapted (N)"] - 76.11) < abs(row["force as drawn (N)"] - 76.11) / 3.0
    gripper.main(tmp_path, gaps=(1e-3,), passes=0)
    assert {file.name for file in tmp_path.iterdir()} == {"gripper.csv", "gripper.png", "gripper.vtu"}
    mesh = ka.read_mesh(EXAMPLES / "gripper.msh", scale=1e-3)
    wide = gripper.with_gap(mesh, 3e-3)
    for part in ("magnet", "pot", "plate"):
        assert area(wide)[wide.subdomains[part]].sum() == pytest.approx(area(mesh)[mesh.subdomains[part]].sum())
    assert ka.quality(wide).min() > 0.05


def test_team_20_has_the_measured_force_within_three_percent(tmp_path):
    result, table = run("team20.py", tmp_path, currents=(5000.0,), passes=1)
    ((current, force, error),) = table
    measured = dict(np.loadtxt(EXAMPLES / "team20_forces.csv", delimiter=",", skiprows=2))
    assert force == pytest.approx(measured[current], rel=0.03) and abs(error) < 0.03 * force
    assert result.mesh.nvertices < 2500 and (tmp_path / "team20.png").stat().st_size > 50_000


@pytest.mark.parametrize(
    ("example", "name"),
    [*((name, name) for name in EXAMPLES_RUN), ("motor", "motor_torque")],
)
def test_pictures_are_pictures(request, example, name):
    folder = request.getfixturevalue(example)[0]
    content = (folder / f"{name}.png").read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) > 100_000


@pytest.mark.parametrize(
    ("name", "drawing", "numbers", "rel"),
    [
        ("c_core", "c_core", {}, 1e-9),
        ("motor", "motor", {}, 1e-3),
        ("bracket", "bracket", {}, 1e-3),
        ("gripper", "gripper", {}, 1e-2),
        ("team20", "team20", {}, 1e-3),
        *((f"actuator_{gap}", "actuator", {"gap": gap}, 1e-3) for gap in range(1, 6)),
    ],
)
@needs_gmsh
def test_the_drawing_makes_the_mesh(tmp_path, name, drawing, numbers, rel):
    """The .geo holds the very groups and measures of the mesh beside it; arcs a little finer or coarser."""
    again, mesh = drawn(drawing, tmp_path, **numbers), ka.read_mesh(EXAMPLES / f"{name}.msh", scale=1e-3)
    assert again.nvertices == pytest.approx(mesh.nvertices, rel=0.05)  # Gmsh's versions differ a little
    assert again.boundaries.keys() == mesh.boundaries.keys()
    for part, elements in mesh.subdomains.items():
        assert area(again)[again.subdomains[part]].sum() == pytest.approx(area(mesh)[elements].sum(), rel=rel)


def drawn(name, folder, **numbers):
    """What Gmsh makes of a drawing, with these numbers set."""
    with gmsh_session() as model:
        for key, value in numbers.items():
            gmsh.onelab.setNumber(key, [value])
        gmsh.open(str(EXAMPLES / f"{name}.geo"))
        model.mesh.generate(3)
        gmsh.write(str(folder / "drawn.msh"))
    return ka.read_mesh(folder / "drawn.msh", scale=1e-3)
