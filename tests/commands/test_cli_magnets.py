"""The commands `init` and `run` on tetrahedra: magnets by the keys of the plane, with three components."""

import tomllib

import meshio
import numpy as np
import pytest
from helpers.cases import report_in, run_command, table_of
from helpers.magnet_solids import blocks
from helpers.places import EXAMPLES
from helpers.worlds import without_matplotlib
from numpy.testing import assert_allclose
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case
from kohonen_adapt.magnetostatics import (
    FluxDensityAt,
    MagneticScalarPotential,
    Magnetostatics,
    Material,
    StoredEnergy,
    Torque,
    bracket,
)

PICTURES = ["adaptation.png", "cut.png", "density.png", "estimate.png", "passes.gif", "quality.png", "surface.png"]
POTENTIAL = dict.fromkeys(["x-", "x+", "y-", "y+", "z+"], 0.0)
CASE = """
mesh = "half.msh"
scale = 1e-3
symmetry = {"z-" = "normal"}
[materials.magnet]
permeability = 1.05
remanence = [0.0, 0.0, 1.2]
[materials.air]
[potential]
"x-" = 0
"x+" = 0
"y-" = 0
"y+" = 0
"z+" = 0
[adapt]
passes = 1
[outputs.pull]
quantity = "force"
body = "magnet"
component = "z"
[outputs.through]
quantity = "flux"
surface = "z-"
[outputs.there]
quantity = "flux_density"
at = [0.0, 0.0, 0.015]
component = "z"
[outputs.phi]
quantity = "potential"
at = [0.0, 0.0, 0.015]
[outputs.turn]
quantity = "torque"
body = "magnet"
component = "x"
"""


@pytest.fixture
def folder(tmp_path):
    """A magnet above the plane z = 0, drawn in millimetres, and its case."""
    wide = np.array([-60.0, -30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 60.0])
    mesh = blocks([wide, wide, np.array([0.0, 5.0, 10.0, 20.0, 30.0, 60.0])],
                  {"magnet": ((-10.0, -10.0, 10.0), (10.0, 10.0, 20.0))})  # fmt: skip
    sides = {name: rows for name, rows in mesh.boundaries.items() if name != "outer"}
    ka.write_mesh(tmp_path / "half.msh", type(mesh)(mesh.p, mesh.t, sides, mesh.subdomains))
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


@pytest.mark.slow
def test_run_adapts_as_python_does(folder, capsys):
    assert run_command("run", folder / "case.toml", "--out", folder / "out") == 0
    said = capsys.readouterr().out
    names = {"adapted.msh", "adapted.vtu", "inside.vtu", "history.csv", "passes", "report.html", *PICTURES}
    assert {file.name for file in (folder / "out").iterdir()} == names
    assert "pull (N)" in said and "through (Wb)" in said and "phi (A)" in said and "there (T)" in said
    materials = {"magnet": Material(1.05, remanence=(0.0, 0.0, 1.2)), "air": Material()}
    problem = MagneticScalarPotential(materials, POTENTIAL, symmetry={"z-": "normal"})
    result = ka.adapt(ka.read_mesh(folder / "half.msh", scale=1e-3), problem, passes=1)
    last = table_of(folder / "out" / "history.csv")[-1]
    field = result.solution
    assert float(last["output pull (N)"]) == pytest.approx(field.force("magnet")[2], rel=1e-6)
    assert float(last["output through (Wb)"]) == pytest.approx(field.flux("z-"), rel=1e-6)
    fields = meshio.read(folder / "out" / "adapted.vtu")
    assert_allclose(fields.point_data["phi (A)"], field.potential, atol=1e-6)
    assert fields.cell_data["B (T)"][0].shape[1] == 3
    inside = meshio.read(folder / "out" / "inside.vtu")
    (cells,) = inside.cells
    at = [inside.point_data[f"B_{axis} (T)"][cells.data[:, :4]].mean(axis=1) for axis in "xyz"]
    assert cells.type == "VTK_LAGRANGE_TETRAHEDRON"  # B is linear in elements
    assert_allclose(np.transpose(at), fields.cell_data["B (T)"][0], atol=1e-6)


def test_init_writes_a_case_that_runs(folder, capsys):
    assert run_command("init", folder / "half.msh", "-o", folder / "new.toml", "--scale", "1e-3") == 0
    text = (folder / "new.toml").read_text()
    assert "% of the volume" in text and "0.12 x 0.12 x 0.06 m" in text and "phi in A" in text
    assert run_command("run", folder / "new.toml", "--dry-run") == 0
    assert "no faults found" in capsys.readouterr().out
    case = read_case(folder / "new.toml")
    mesh = fitting_mesh(case)
    assert isinstance(case.problem, MagneticScalarPotential) and case.problem.symmetry == {}
    assert mesh.nvertices == 486 and case.goal is None and case.energy_unit == "J"
    examples = "\n".join(line.removeprefix("# ") for line in text.splitlines() if not line.startswith("#  "))
    examples = examples[examples.index("[outputs.force]") :]
    outputs = tomllib.loads(examples)["outputs"]
    (folder / "asked.toml").write_text((folder / "new.toml").read_text() + "\n" + examples)
    assert len(outputs) == 7 and set(read_case(folder / "asked.toml").outputs) == set(outputs)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[0.0, 0.0, 1.2]", "[0.0, 1.2]", "remanence of 'magnet' must have three components"),
        ('"normal"', '"odd"', "symmetry of 'z-' must be 'parallel' or 'normal'"),
        ('scale = 1e-3', "scale = 1e-3\ndepth = 0.1", "depth is for meshes of triangles only"),
        ('"flux"\nsurface', '"flux_linkage"\ncoil', "'z-' is no coil of the problem; its coils are none"),
        ('surface = "z-"', 'surface = "air"', "flux has 'air', which is no surface of the mesh"),
        ('"z-" = "normal"', '"magnet" = "normal"', "symmetry has 'magnet', which is no surface"),
        ("at = [0.0, 0.0, 0.015]", "at = [0.0, 0.015]", r"x must have shape (3, n); got (2, 1)"),
        ("scale", 'goal = {quantity = "force", body = "air", direction = [0, 1]}\nscale', "vectors (x, y, z) in"),
        ("scale", 'goal = {quantity = "flux_linkage", circuit = {air = 1}}\nscale', "'air' is no coil of the problem"),
        ("scale", 'goal = {quantity = "energy", part = "rotor"}\nscale', "goal: subdomain 'rotor' is not in the mesh"),
        ("[adapt]", "[turn]\nmagnet = 3.0\n[adapt]", "turn is for meshes of triangles only"),
    ],
)  # fmt: skip
def test_wrong_cases_are_refused_before_anything_is_solved(folder, refused, before, after, said):
    assert before in CASE
    refused(CASE.replace(before, after, 1), said)


def plain_with(key):
    """The case without what is of space alone, and with another key."""
    return CASE.replace('symmetry = {"z-" = "normal"}', key).replace("remanence = [0.0, 0.0, 1.2]", "")


def test_goals_by_their_keys(folder):
    """One with vectors of three components makes it a case of space; an energy is one of either."""
    goals = {
        'quantity = "torque", body = "magnet", centre = [0, 0, 0.01], axis = [0, 3, 4]': (
            Torque("magnet", (0.0, 0.0, 0.01), (0.0, 0.6, 0.8)), MagneticScalarPotential, "N m"),
        'quantity = "flux_density", x = [0, 0, 0.1], direction = [0, 0, 5]': (
            FluxDensityAt((0.0, 0.0, 0.1), (0.0, 0.0, 1.0)), MagneticScalarPotential, "T"),
        'quantity = "energy", part = "magnet"': (StoredEnergy("magnet"), Magnetostatics, "J"),
    }  # fmt: skip
    for keys, (goal, kind, unit) in goals.items():
        (folder / "case.toml").write_text(plain_with(f"goal = {{{keys}}}"))
        case = read_case(folder / "case.toml")
        assert case.problem.goal == goal and isinstance(case.base_problem, kind) and case.problem.goal_unit == unit
        assert isinstance(case.problem, MagneticScalarPotential)


def test_keys_of_space_and_of_the_plane_are_told_apart(folder, refused):
    """What could be a case of the plane is one of tetrahedra if the mesh is; what is of the plane alone is refused."""
    refused(plain_with("depth = 2.0"), "depth: for meshes of triangles only")
    refused(plain_with("order = 7"), "order of the elements must be a whole number from 1 to 6, or 'auto'; got 7.")
    (folder / "case.toml").write_text(plain_with(""))
    case = read_case(folder / "case.toml")
    assert isinstance(case.base_problem, Magnetostatics) and isinstance(case.problem, MagneticScalarPotential)


@pytest.mark.parametrize(
    ("key", "order", "estimator"),
    [("", 2, "residual"), ("order = 1", 1, "residual"), ("order = 2", 2, "residual"),
     ('estimator = "bracket"', 1, "bracket")],
)  # fmt: skip
def test_order_and_estimator_of_tetrahedra_without_other_keys_of_space(key, order, estimator, folder):
    plain = plain_with(key)
    (folder / "case.toml").write_text(plain)
    problem = read_case(folder / "case.toml").problem
    assert isinstance(problem, MagneticScalarPotential) and (problem.order, problem.estimator) == (order, estimator)


def test_components_of_triangles_are_x_and_y(refused):
    text = (EXAMPLES / "magnet.toml").read_text().replace('"c_core.msh"', repr(str(EXAMPLES / "c_core.msh")))
    text += '\n[outputs.pull]\nquantity = "flux_density"\nat = [0.05, 0.04]\ncomponent = "z"\n'
    refused(text, "component must be one that the field has")


def test_a_dry_run_with_a_tolerance_of_one_output_solves_nothing(folder, caplog):
    """The problem that is only checked has no problem for the output, whose passes would run."""
    text = CASE[: CASE.index("[outputs.through]")].replace("passes = 1", "output_rtol = 1e-3")
    (folder / "case.toml").write_text(text.replace("scale = 1e-3", "scale = 1e-3\norder = 1"))
    with caplog.at_level("INFO"):
        assert run_command("run", folder / "case.toml", "--dry-run") == 0
    assert "is the goal of the passes" not in caplog.text


def test_a_case_asks_for_bounds_by_both_potentials(folder, out, capsys, monkeypatch):
    without_matplotlib(monkeypatch)
    text = CASE.replace("scale = 1e-3", "scale = 1e-3\nbracket = true\norder = 1").replace("passes = 1", "passes = 0")
    (folder / "case.toml").write_text(text)
    assert run_command("run", folder / "case.toml", "--out", out) == 0
    case = read_case(folder / "case.toml")
    found = bracket(fitting_mesh(case), case.problem.materials, case.problem.potential, symmetry={"z-": "normal"})
    assert found.guaranteed
    sentence = f"Bounds by both potentials on the last mesh: {found.summary}."
    assert sentence in capsys.readouterr().out
    page = report_in(out)
    assert sentence in page


def test_bounds_that_a_potential_prevents_are_refused_before_the_run(tmp_path, refused):
    names = {"outer": lambda x: x[0] > -1.0, "middle": lambda x: x[0] == 0.5}
    mesh = MeshTet().refined(2).with_boundaries(names, boundaries_only=False)
    outer = {"outer": mesh.boundary_facets()}
    ka.write_mesh(tmp_path / "box.msh", mesh.with_boundaries(outer).with_subdomains({"air": lambda x: x[0] > -1.0}))
    text = 'mesh = "box.msh"\nbracket = true\n[materials.air]\n[potential]\nouter = 0.0\nmiddle = 1.0\n'
    refused(text, "bracket: the potential of 'middle' is inside the mesh")


def test_bounds_by_both_potentials_are_for_tetrahedra(tmp_path, refused):
    mesh = MeshTri().refined(2).with_defaults().with_subdomains({"air": lambda x: x[0] > -1.0})
    ka.write_mesh(tmp_path / "flat.msh", mesh)
    text = 'mesh = "flat.msh"\nbracket = true\n[materials.air]\n[potential]\nleft = 0.0\n'
    refused(text, "bracket: for meshes of tetrahedra only")
