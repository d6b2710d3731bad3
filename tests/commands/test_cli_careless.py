"""Careless mistakes of engineers, and what `check` and `run` say about them."""

import os
import subprocess
import sys

import numpy as np
import pytest
from helpers.mesh_files import drawn_by_gmsh, needs_gmsh
from helpers.meshes import centres, square
from helpers.places import ROOT
from helpers.worlds import without_matplotlib
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli

CASE = """
mesh = "it.msh"
[materials.air]
[materials.iron]
permeability = 1000.0
[potential]
outer = 0.0
[adapt]
passes = 1
"""


def said_by(capsys, *arguments):
    """The exit status, and everything that was said."""
    status = cli.main([str(each) for each in arguments])
    said = capsys.readouterr()
    return status, said.out + said.err


@pytest.fixture
def said_of_case(tmp_path, capsys):
    """Write a mesh and a case, run the command, and return its exit status and what it says."""

    def run(mesh, toml=CASE, *options):
        if mesh is not None:
            ka.write_mesh(tmp_path / "it.msh", mesh)
        (tmp_path / "it.toml").write_text(toml)
        capsys.readouterr()
        return said_by(capsys, "run", tmp_path / "it.toml", *(options or ("--dry-run",)))

    return run


def bar_in_air(size=0.1):
    """A bar of iron in a square of air, drawn as it should be."""
    mesh = square(10)
    mesh = MeshTri(size * mesh.p, mesh.t)
    bar = np.abs(centres(mesh) / size - 0.5).max(axis=0) < 0.2
    mesh = mesh.with_subdomains({"iron": np.flatnonzero(bar), "air": np.flatnonzero(~bar)})
    return mesh.with_boundaries({"outer": mesh.boundary_facets()})


@needs_gmsh
def test_iron_over_air_is_refused_with_the_remedy(tmp_path, capsys, said_of_case):
    text = """SetFactory("OpenCASCADE"); Mesh.MeshSizeMax = 0.01;
Rectangle(1) = {0, 0, 0, 0.1, 0.1}; Rectangle(2) = {0.03, 0.03, 0, 0.02, 0.04};
Physical Surface("air") = {1}; Physical Surface("iron") = {2}; Physical Curve("outer") = {1:4};"""
    drawn_by_gmsh(tmp_path / "it.msh", text)
    for status, said in (said_of_case(None), said_by(capsys, "check", tmp_path / "it.msh")):
        assert status == 2
        assert "the mesh lies on itself: at (" in said and "(subdomain 'iron') is on element" in said
        assert "(Gmsh: BooleanFragments, where both are the same Coherence)" in said
        assert "fixed nowhere" not in said and "othing is wrong" not in said


MAGNET = CASE.replace("[materials.air]", "[materials.air]\nremanence = [0.0, 1200.0]")
UNITS = {
    "permeability in H/m": (
        0.1,
        CASE.replace("1000.0", "1.2566e-6"),
        "permeability of 'iron' is relative, 1 for air; 1.2566e-06 looks like H/m. If so, write 1 (divide by 4 pi",
    ),
    "of iron in H/m": (0.1, CASE.replace("1000.0", "1.2566e-3"), "0.0012566 looks like H/m. If so, write 1000 ("),
    "below that of vacuum": (0.1, CASE.replace("1000.0", "0.5"), "1 for air; 0.5 is below 1, as in supercond"),
    "remanence in mT": (
        0.1,
        MAGNET,
        "remanence of 'air' is 1200 T, more than any magnet has: that looks like mT. If so, write 1.2.",
    ),
    "remanence in gauss": (0.1, MAGNET.replace("1200.0", "12e3"), "looks like gauss. If so, write 1.2."),
    "remanence by a pattern": (
        0.1,
        MAGNET.replace("[0.0, 1200.0]", '{pattern = "parallel", magnitude = 1100, degrees = 30}'),
        "remanence of 'air' is 1100 T, more than any magnet has",
    ),
    "turning remanence": (
        0.1,
        MAGNET.replace("[0.0, 1200.0]", '{pattern = "halbach", magnitude = 1100, pole_pairs = 2}'),
        "T, more than any magnet has: that looks like mT.",
    ),
    "current density in A/mm^2": (
        0.1,
        CASE.replace("1000.0", "1.0\ncurrent_density = 5"),
        "current_density of 'iron' is 5 A/m^2: that looks like A/mm^2. If so, write 5e6.",
    ),
    "depth in mm": (0.1, "depth = 50\n" + CASE, "depth is 50 m: that looks like millimetres. If so, write 0.05."),
    "drawn in mm": (100.0, CASE, "the mesh is 100 x 100 m: that looks like millimetres. If so, --scale 1e-3 (scale"),
    "scale too large": (
        100.0,
        "scale = 10.0\n" + CASE,
        "the mesh is 1000 x 1000 m: a scale of 10 looks too large. The scale is metres per unit of the file: 1 fo",
    ),
    "scale too small": (
        0.01,
        "scale = 1e-3\n" + CASE,
        "the mesh is 1e-05 x 1e-05 m: a scale of 0.001 looks too small. The scale is metres per unit of the file: 1 fo",
    ),
}


@pytest.mark.parametrize("name", UNITS)
def test_numbers_in_another_unit_end_a_dry_run_with_a_count(name, said_of_case):
    size, toml, warning = UNITS[name]
    status, said = said_of_case(bar_in_air(size), toml)
    assert status == 0
    assert warning in said
    assert said.count("kohonen-adapt: warning: ") == 1
    assert ": 1 warning, see above; '" in said and "no faults found" not in said


def test_plausible_numbers_are_not_doubted(said_of_case):
    toml = CASE.replace("1000.0", "0.99998\nremanence = [0.0, 1.45]\ncurrent_density = 2e6")
    for size in (1e-4, 0.1, 1.9):
        _, said = said_of_case(bar_in_air(size), toml)
        assert "no faults found" in said and "warning" not in said


def test_a_run_repeats_its_warnings_at_the_end(said_of_case, out, monkeypatch):
    without_matplotlib(monkeypatch)  # pictures would take most of the time
    toml = "order = 1\n" + MAGNET.replace("1000.0", "1.2566e-3").replace("passes = 1", "passes = 0")
    status, said = said_of_case(bar_in_air(), toml, "--out", out)
    assert status == 0
    for warning in ("kohonen-adapt: warning: permeability of 'iron'", "kohonen-adapt: warning: remanence of 'air'"):
        assert said.count(warning) == 2


def test_check_counts_what_it_found(tmp_path, capsys):
    mesh = bar_in_air(1e-5)
    ka.write_mesh(tmp_path / "it.msh", MeshTri(mesh.p, mesh.t).with_subdomains({"iron": mesh.subdomains["iron"]}))
    status, said = said_by(capsys, "check", tmp_path / "it.msh")
    assert status == 1
    assert "\n1 fault found.\n" in said
    assert "No faults found" not in said


@pytest.mark.parametrize(
    ("toml", "hints"),
    [
        (CASE, ["no current, magnet, applied field or potential other than 0 is given, so that the field is zero."]),
        (CASE.replace("outer = 0.0", "outer = 1.0"), []),
        (CASE.replace("1000.0", "1.0\nremanence = [0.0, 1.2]"), []),
        (CASE.replace("1000.0", '1.0\nremanence = {pattern = "radial", magnitude = 1.2}'), []),
        (CASE.replace("1000.0", "1.0\ncurrent_density = 1e6"), []),
        (CASE + "[ampere_turns]\niron = 1.0", []),
        (
            CASE.replace("outer = 0.0", "outer = 1.0") + "[ampere_turns]\niron = 0.0",
            ["ampere_turns of 'iron' is 0, so that no current flows there."],
        ),
    ],
)
def test_a_case_without_current_gets_a_hint(toml, hints, said_of_case):
    status, said = said_of_case(bar_in_air(), toml)
    assert status == 0 and "no faults found" in said
    assert [line.removeprefix("hint: ") for line in said.splitlines() if line.startswith("hint: ")] == hints


@pytest.mark.slow
@pytest.mark.parametrize("command", ["--help", "check it.msh", "check it.toml", "run it.toml --out out", "run no.toml"])
def test_a_reader_that_ends_early_breaks_no_pipe(command, out, tmp_path):
    """As `head` does; the files are written all the same."""
    ka.write_mesh(tmp_path / "it.msh", bar_in_air())
    (tmp_path / "it.toml").write_text(CASE.replace("passes = 1", "passes = 0"))
    words = [sys.executable, "-m", "kohonen_adapt", *command.split()]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, env=os.environ | {"PYTHONPATH": paths}
    ) as process:
        process.stdout.close()
        process.stdout = None
        said = process.communicate()[1].decode()
    assert process.returncode == (2 if "no.toml" in command else 0)
    assert "Broken pipe" not in said and "BrokenPipe" not in said
    assert (out / "adapted.msh").exists() == ("--out" in command)


MAGNET_IN_SPACE = CASE.replace("1000.0", "1.05\nremanence = [0.0, 1.2, 0.0]")
PLACE = "centre = [0, 0, 0], axis = [0, 0, 1], radius = 1, section = [1, 1], ampere_turns = 1"
NAMES = {
    "remanence in space": (
        MAGNET_IN_SPACE,
        "materials.iron.remanence: expected [x, y], because the mesh is one of triangles; got three components.",
    ),
    "remanence in space beside a key of the plane": (
        "depth = 2.0\n" + MAGNET_IN_SPACE,
        "materials.iron.remanence: expected [x, y], because depth is for meshes of triangles only; got three compo",
    ),
    "direction in space": (
        'goal = {quantity = "force", body = "iron", direction = [0.0, 1.0, 0.0]}\n' + CASE,
        "goal.direction: expected [x, y], because the mesh is one of triangles; got three components.",
    ),
    "coil in space": (
        f"coils.w = {{shape = 'circular', {PLACE}}}\n" + CASE,
        "the mesh is one of triangles, but the case has coils, for tetrahedra. A coil in the plane is a subdomain",
    ),
    "symmetry": ('symmetry = {outer = "normal"}\n' + CASE, "the mesh is one of triangles, but the case has symmetry"),
    "material": (CASE.replace("materials.iron", "materials.irn"), "it has 'air', 'iron'. Did you mean 'iron'?"),
    "capitals": (CASE.replace("materials.iron", "materials.IRON"), "it has 'air', 'iron'. Did you mean 'iron'?"),
    "boundary": (CASE.replace("outer =", "outre ="), "it has 'outer'. Did you mean 'outer'?"),
    "subdomain for boundary": (
        CASE.replace("outer =", "iron ="),
        "boundary 'iron' is not in the mesh; it has 'outer'. It is a subdomain: name its boundary, too.",
    ),
    "coil": ("ampere_turns = {irn = 9.0}\n" + CASE, "is not among the materials: 'air', 'iron'. Did you mean 'iron'?"),
    "body": (
        CASE + '[outputs.f]\nquantity = "force"\nbody = "irn"\ncomponent = "x"\n',
        "outputs.f: subdomain 'irn' is not in the mesh; it has 'air', 'iron'. Did you mean 'iron'?",
    ),
    "pinned": (CASE + 'pinned = ["oter"]\n', "are: 'air', 'iron', 'outer'. Did you mean 'outer'?"),
    "layers": (CASE + "layers = {irno = 2}\n", "its subdomains are: 'air', 'iron'. Did you mean 'iron'?"),
    "periodic": ('periodic = [["outr", "outer"]]\n' + CASE, "its boundaries are: 'outer'. Did you mean 'outer'?"),
    "mesh file": (CASE.replace("it.msh", "itt.msh"), "itt.msh'. Did you mean 'it.msh'?"),
    "a point in millimetres": (
        CASE + '[outputs.b]\nquantity = "flux_density"\nat = [50.0, 50.0]\ncomponent = "x"\n',
        "[50.0, 50.0] is outside. The mesh is from (0, 0) to (0.1, 0.1) m.",
    ),
}


@pytest.mark.parametrize("name", NAMES)
def test_wrong_names_and_vectors_are_told_what_is_meant(name, said_of_case):
    toml, message = NAMES[name]
    status, said = said_of_case(bar_in_air(), toml)
    assert status == 2 and message in said


@needs_gmsh
@pytest.mark.parametrize(("axis", "plane", "turn"), [("1, 0, 0", "xz", "-Pi/2"), ("0, 1, 0", "yz", "Pi/2")])
def test_a_drawing_in_another_plane_is_to_be_rotated(axis, plane, turn, tmp_path, capsys):
    """And the command that is told rotates it, to a mesh without names."""
    text, back = 'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.1, 0.2};', turn.removeprefix("-")
    text += f"Rotate {{{{{axis}}}, {{0, 0, 0}}, {back if turn[0] == '-' else '-' + turn}}} {{ Surface{{1}}; }}"
    status, said = said_by(capsys, "check", drawn_by_gmsh(tmp_path / "it.msh", text))
    command = said.partition("Gmsh: ")[2].partition(").")[0]
    assert status == 2 and f"The drawing is in the {plane}-plane; rotate it (Gmsh: Rotate {{{{" in said
    assert command == f"Rotate {{{{{axis}}}, {{0, 0, 0}}, {turn}}} {{Surface{{:}};}}"
    status, said = said_by(capsys, "check", drawn_by_gmsh(tmp_path / "it.msh", text + command))
    assert said.startswith("size: 0.1 x 0.2 m") and status == 1
