"""Cases whose mesh Gmsh draws: parameters, reproducible meshes, sweeps over them, and drawings that fail."""

import csv
import gc
import sys

import pytest
from helpers.cases import run_command
from helpers.mesh_files import needs_gmsh
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri

from kohonen_adapt.cases import case_of, fitting_mesh, read_case
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.measures import area

WIDTH = 10.0

DRAWING = """
DefineConstant[ gap = 2.0, lc = {1.0, Min 0.1, Name "Sizes/of elements"} ];
width = 10;
Point(1) = {0, 0, 0, lc}; Point(2) = {width, 0, 0, lc}; Point(3) = {width, gap, 0, lc}; Point(4) = {0, gap, 0, lc};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
"""
PLANE = 'Physical Surface("air") = {1}; Physical Curve("outer") = {1:4};\n'
SOLID = """
out[] = Extrude {0, 0, 1} { Surface{1}; };
Physical Volume("air") = {out[1]}; Physical Surface("outer") = {1, out[0], out[2], out[3], out[4], out[5]};
"""

# With A = x / 100 on the rim in metres, B is 0.01 T everywhere.
CASE = """
mesh = {drawing = "plate.geo", gap = 3.0}
scale = 1e-3
[materials.air]
[potential]
outer = "0.01*x"
[adapt]
passes = 0
[outputs.stored]
quantity = "energy"
"""


@pytest.fixture
def case(tmp_path):
    (tmp_path / "plate.geo").write_text(DRAWING + PLANE)
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


def drawn(folder, text=DRAWING + PLANE, **parameters):
    (folder / "plate.geo").write_text(text)
    given = {"mesh": {"drawing": "plate.geo", **parameters}, "materials": {"air": {}}, "potential": {"outer": 0.0}}
    return case_of(given, folder)


def energy(gap):
    """In J/m, of the plate in a field of 0.01 T."""
    return 1e-4 / (2.0 * VACUUM_PERMEABILITY) * WIDTH * gap * 1e-6


@needs_gmsh
@pytest.mark.parametrize("gap", [0.5, 2, 3.0])
def test_the_mesh_has_the_parameter_of_the_case(tmp_path, gap):
    mesh = fitting_mesh(drawn(tmp_path, gap=gap))
    assert isinstance(mesh, MeshTri) and area(mesh).sum() == pytest.approx(WIDTH * gap, rel=1e-12)
    assert set(mesh.subdomains) == {"air"} and set(mesh.boundaries) == {"outer"}


@needs_gmsh
def test_sizes_of_elements_are_a_parameter_like_any_other(tmp_path):
    coarse, fine = (fitting_mesh(drawn(tmp_path, lc=size)).nelements for size in (1.0, 0.5))
    assert fine > 3 * coarse


@needs_gmsh
def test_a_drawing_with_a_volume_is_meshed_by_tetrahedra(tmp_path):
    mesh = fitting_mesh(drawn(tmp_path, DRAWING + SOLID, gap=3.0))
    assert isinstance(mesh, MeshTet) and area(mesh).sum() == pytest.approx(3.0 * WIDTH, rel=1e-12)


@needs_gmsh
def test_a_drawing_gives_the_same_mesh_every_time(tmp_path):
    one, other = (fitting_mesh(drawn(tmp_path, gap=3.0)) for _ in range(2))
    assert_array_equal(one.p, other.p)
    assert_array_equal(one.t, other.t)


@needs_gmsh
def test_the_drawn_file_goes_with_its_case(tmp_path):
    case = drawn(tmp_path)
    file = case.mesh_file
    assert file.is_file() and case.mesh_file is file
    del case
    gc.collect()
    assert not file.parent.exists()


@needs_gmsh
def test_a_constant_may_be_scaled_in_place(tmp_path):
    """Its value at the end is not the given one, nor another than without it."""
    mesh = fitting_mesh(drawn(tmp_path, DRAWING + PLANE + "gap *= 1e-3;", gap=2.0))
    assert area(mesh).sum() == pytest.approx(2.0 * WIDTH, rel=1e-12)


@needs_gmsh
@pytest.mark.parametrize(
    ("text", "parameters", "said"),
    [
        (PLANE, {"gpa": 2.0}, "plate.geo (gpa = 2)': the drawing has no parameter 'gpa'. Did you mean 'gap'?"),
        (PLANE, {"zeta": 2.0}, "no parameter 'zeta'. Define it there: DefineConstant[ NAME = VALUE ];"),
        (PLANE, {"width": 9.0}, "width has no effect, because the drawing sets width. Write DefineConstant[ width ="),
        (PLANE + "Point(9) = {0,;\n", {}, "line 8: syntax error (;)"),
        (PLANE + 'Error("the gap is too wide");\n', {"gap": 9.0}, "Gmsh reports: the gap is too wide"),
        (PLANE + 'Merge "none.step";\n', {}, "'plate.geo', line 8: \"none.step\" is not there."),
        (PLANE + "Exit;\n", {}, "Gmsh wrote no mesh (exit code 0)."),
        ("Delete { Surface{1}; }\n", {}, "the drawing has no surface to mesh."),
    ],
)
def test_drawings_that_fail_are_refused_in_one_line(tmp_path, text, parameters, said):
    with pytest.raises(ValueError) as refused:
        fitting_mesh(drawn(tmp_path, DRAWING + text, **parameters))
    assert str(refused.value).startswith("mesh.drawing '") and said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        ({"drawing": "plate.geo", "gap": "2"}, "mesh.gap must be a finite number; got '2'. Write it without quotes."),
        ({"drawing": "plate.geo", "gap": float("nan")}, "mesh.gap must be a finite number; got nan."),
        ({"drawing": "plate.geo", "gap": True}, "mesh.gap must be a finite number; got True."),
        ({"drawing": "plate.step"}, "mesh.drawing must be a drawing of Gmsh (.geo); got 'plate.step'."),
        ({"drawing": 3}, "mesh.drawing must be text in quotes; got 3."),
        ({"gap": 3.0}, "mesh.drawing is missing; it is required."),
        ("plate.geo", 'mesh is a drawing, which needs a table: mesh = {drawing = "plate.geo"}.'),
    ],
)
def test_tables_that_are_no_drawing_are_refused_before_anything_is_drawn(tmp_path, mesh, said):
    with pytest.raises(ValueError) as refused:
        case_of({"mesh": mesh, "materials": {"air": {}}, "potential": {"outer": 0.0}}, tmp_path)
    assert said in str(refused.value)


def test_a_missing_drawing_is_named_with_the_nearest(case):
    case.write_text(CASE.replace("plate.geo", "plat.geo"))
    with pytest.raises(ValueError, match=r"there is no file '.*plat.geo'. Did you mean 'plate.geo'\?"):
        fitting_mesh(read_case(case))


def test_without_gmsh_its_package_is_named(case, monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(ValueError, match=r'needs Gmsh, which is not installed: pip install "kohonen-adapt\[draw\]"'):
        fitting_mesh(read_case(case))


@pytest.mark.slow
@needs_gmsh
def test_a_sweep_goes_over_a_parameter(case, tmp_path, capsys):
    """The energy of a uniform field, which every mesh has exactly, is proportional to the gap."""
    command = ["sweep", str(case), "--over", "mesh.gap=1:5:3", "--jobs", "1", "--quiet"]
    assert run_command(*command, "--out", tmp_path / "out") == 0
    with (tmp_path / "out" / "sweep.csv").open(newline="") as stream:
        found = {float(row["mesh.gap"]): float(row["stored (J/m)"]) for row in csv.DictReader(stream)}
    assert found == pytest.approx({gap: energy(gap) for gap in (1.0, 3.0, 5.0)}, rel=1e-9)
    assert run_command(*command, "--resume", tmp_path / "out") == 0
    (tmp_path / "plate.geo").write_text(DRAWING + PLANE + "// another drawing\n")
    assert run_command(*command, "--resume", tmp_path / "out") == 2
    assert "is of another sweep" in capsys.readouterr().err


@needs_gmsh
def test_a_sweep_stops_at_once_at_a_parameter_that_the_drawing_lacks(case, tmp_path, capsys):
    over = ["--over", "mesh.gpa=1:5:3", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert run_command("sweep", case, *over) == 2
    assert "the drawing has no parameter 'gpa'. Did you mean 'gap'?" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@needs_gmsh
def test_a_run_is_resumed_on_the_same_mesh_only(case, tmp_path, capsys):
    assert run_command("run", case, "--dry-run") == 0
    assert f"'{tmp_path / 'plate.geo'} (gap = 3)' has" in capsys.readouterr().out
    assert run_command("run", case, "--out", tmp_path / "out", "--quiet") == 0
    passes = sorted((tmp_path / "out" / "passes").iterdir())
    before = [file.read_bytes() for file in passes]
    assert run_command("run", case, "--resume", tmp_path / "out", "--quiet") == 0
    assert [file.read_bytes() for file in passes] == before
    case.write_text(CASE.replace("gap = 3.0", "gap = 3.5"))
    assert run_command("run", case, "--resume", tmp_path / "out", "--quiet") == 2
    assert "mesh" in capsys.readouterr().err
