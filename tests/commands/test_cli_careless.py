"""Careless mistakes of engineers, and what `check` and `run` say about them."""

import numpy as np
import pytest
from helpers.mesh_files import gmsh_session, needs_gmsh
from helpers.meshes import square
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.commands import main as cli

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
    bar = np.abs(mesh.p[:, mesh.t].mean(axis=1) / size - 0.5).max(axis=0) < 0.2
    mesh = mesh.with_subdomains({"iron": np.flatnonzero(bar), "air": np.flatnonzero(~bar)})
    return mesh.with_boundaries({"outer": mesh.boundary_facets()})


@needs_gmsh
def test_iron_over_air_is_refused_with_the_remedy(tmp_path, capsys, said_of_case):
    with gmsh_session() as model:
        air, iron = model.occ.addRectangle(0, 0, 0, 0.1, 0.1), model.occ.addRectangle(0.03, 0.03, 0, 0.02, 0.04)
        model.occ.synchronize()
        model.addPhysicalGroup(2, [air], name="air")
        model.addPhysicalGroup(2, [iron], name="iron")
        model.addPhysicalGroup(1, [1, 2, 3, 4], name="outer")
        model.mesh.setSize(model.getEntities(0), 0.01)
        model.mesh.generate(2)
        import gmsh

        gmsh.write(str(tmp_path / "it.msh"))
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
    "below that of vacuum": (0.1, CASE.replace("1000.0", "0.5"), "1 for air; 0.5 is below that, as of supercond"),
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
        "the mesh is 1000 x 1000 m: a scale of 10 looks too large. It is metres per unit of the file: 1 for m, 1e-3",
    ),
    "scale too small": (
        0.01,
        "scale = 1e-3\n" + CASE,
        "the mesh is 1e-05 x 1e-05 m: a scale of 0.001 looks too small. It is metres per unit of the file: 1 for m,",
    ),
}


@pytest.mark.parametrize("name", UNITS)
def test_numbers_in_another_unit_end_a_dry_run_with_a_count(name, said_of_case):
    size, toml, warning = UNITS[name]
    status, said = said_of_case(bar_in_air(size), toml)
    assert status == 0
    assert warning in said
    assert said.count("kohonen-adapt: warning: ") == 1
    assert ": 1 warning, see above; '" in said and "nothing is wrong" not in said


def test_plausible_numbers_are_not_doubted(said_of_case):
    toml = CASE.replace("1000.0", "0.99998\nremanence = [0.0, 1.45]\ncurrent_density = 2e6")
    for size in (1e-4, 0.1, 1.9):
        _, said = said_of_case(bar_in_air(size), toml)
        assert "nothing is wrong" in said and "warning" not in said


def test_a_run_repeats_its_warnings_at_the_end(said_of_case, tmp_path):
    toml = "order = 1\n" + MAGNET.replace("1000.0", "1.2566e-3").replace("passes = 1", "passes = 0")
    status, said = said_of_case(bar_in_air(), toml, "--out", tmp_path / "out")
    assert status == 0
    for warning in ("kohonen-adapt: warning: permeability of 'iron'", "kohonen-adapt: warning: remanence of 'air'"):
        assert said.count(warning) == 2


def test_check_counts_what_it_found(tmp_path, capsys):
    ka.write_mesh(tmp_path / "it.msh", bar_in_air(1e-5))
    status, said = said_by(capsys, "check", tmp_path / "it.msh")
    assert status == 1
    assert "- the mesh is 1e-05 x 1e-05 m: a scale of 1 looks too small." in said
    assert "\n1 warning.\n" in said
    assert "Nothing is wrong" not in said
