"""The command `relocate`: a round trip through files with a solver that knows nothing of this package."""

import re

import meshio
import numpy as np
import pytest
import skfem
from helpers.cases import run_command, whole
from helpers.mesh_files import of_meshio
from helpers.meshes import l_shape, square
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli


@pytest.fixture
def source(tmp_path):
    ka.write_mesh(tmp_path / "before.msh", whole(l_shape(8)))
    return tmp_path / "before.msh"


def move(source, field, *options):
    out = source.with_name("after.msh")
    return run_command("relocate", source, "--density", f"{field}:rho", "--out", out, *options), out


@pytest.mark.parametrize("moved", ["some nodes", "as many elements"])
def test_a_field_of_another_mesh_names_its_own(moved, source, capsys):
    mesh = ka.read_mesh(source)
    other = mesh.refined([0]) if moved == "some nodes" else ka.relocate(mesh, lambda x: 1.0 / (0.1 + np.hypot(*x)))
    field, own = source.with_name("adapted.vtu"), source.with_name("adapted.msh")
    of_meshio(other, cell_data={"rho": [np.ones(other.nelements)]}).write(field)
    for belongs in ("", f" The field belongs to '{own}'."):
        assert move(source, field)[0] == 2
        said = capsys.readouterr().err
        assert "read_field expected a field on the mesh" in said and f"'{field}'" in said
        assert said.count("The field belongs to") == bool(belongs) and belongs in said
        ka.write_mesh(own, other)


@pytest.mark.parametrize(("topology", "more"), [("flip", ["--layers", "gap", "2", "--quiet"]), ("recycle", [])])
@pytest.mark.parametrize("kind", ["cell_data", "point_data"])
def test_it_is_what_the_library_does(topology, more, kind, tmp_path, capfd):
    mesh = square(8)
    mesh = mesh.with_subdomains({"gap": lambda x: (x[1] > 0.25) & (x[1] < 0.5), "rest": lambda x: x[1] < 0.25})
    sides = {"left": lambda x: x[0] == 0, "right": lambda x: x[0] == 1, "floor": lambda x: x[1] == 0}
    ka.write_mesh(tmp_path / "before.msh", mesh.with_boundaries(sides))
    mesh = ka.read_mesh(tmp_path / "before.msh")
    nodal = 1.0 + 9.0 * mesh.p[1]
    rho = nodal[mesh.t].mean(axis=0)
    of_meshio(mesh, **{kind: {"rho": [rho] if kind == "cell_data" else nodal}}).write(tmp_path / "f.vtu")
    words = f"--topology {topology} --min-quality 0.4 --pinned floor 3 --seed 5 --periodic left right"
    code, out = move(tmp_path / "before.msh", tmp_path / "f.vtu", *words.split(), *more)
    options = {"min_quality": 0.4, "pinned": ["floor", 3], "seed": 5, "periodic": [("left", "right")]}
    options |= {"topology": topology, "layers": {"gap": 2} if more else None}
    wanted, after, said = ka.relocate(mesh, rho, **options), ka.read_mesh(out), capfd.readouterr().out
    assert code == 0 and (said == "") == bool(more)
    assert_allclose(after.p, wanted.p, atol=0 if kind == "cell_data" else 1e-9)
    assert set(after.subdomains) == set(mesh.subdomains) and set(after.boundaries) == set(mesh.boundaries)
    wrote = rf"Wrote .*after\.msh: {mesh.nvertices} nodes, worst quality 0\.\d\d; before \d\.\d\d\.\n"
    assert len(re.findall(wrote, said)) == (not more)


def test_points_without_triangles_and_other_cells_have_no_say(source, tmp_path):
    mesh = ka.read_mesh(source)
    rho = np.arange(1.0, mesh.nelements + 1)
    points = np.vstack([[[9.0, 9.0, 0.0]], np.column_stack([mesh.p.T, np.zeros(mesh.nvertices)])])
    cells = [("line", [[1, 2]]), ("triangle", mesh.t.T + 1)]
    meshio.Mesh(points, cells, cell_data={"rho": [[7.0], rho]}).write(tmp_path / "f.vtu")
    assert_array_equal(ka.read_field(tmp_path / "f.vtu", mesh, "rho"), rho)


def overlapping(mesh):
    t = mesh.t.copy()
    t[:, 0] = t[:, 1]
    return skfem.MeshTri(mesh.p, t, validate=False)


def constant(mesh, value=1.0, **more):
    return of_meshio(mesh, cell_data={"rho": [np.full(mesh.nelements, value)]}, **more)


SPOILT = {  # what is said: a field file that does not fit
    "times the size of the mesh. Do both files have the same unit and step?": lambda mesh: constant(
        mesh.translated((0.1, 0.0))
    ),
    "at a scale of 1; its scale is 1000, so the units differ. Use --scale 1000 (metres per unit": lambda mesh: constant(
        mesh.scaled(1e3)
    ),
    "a triangle is ": lambda mesh: constant(overlapping(mesh)),
    "read_field expected finite coordinates;": lambda mesh: constant(
        skfem.MeshTri(np.where(mesh.p == 1.0, np.nan, mesh.p), mesh.t, validate=False)
    ),
    "has 'rho' at points and in cells; rename one of them.": lambda mesh: constant(
        mesh, point_data={"rho": np.ones(mesh.nvertices)}
    ),
    "density must be finite and >= 0; element 0 has -1.0.": lambda mesh: constant(mesh, -1.0),
    "density must be finite and >= 0; element 0 has nan.": lambda mesh: constant(mesh, np.nan),
}


@pytest.mark.parametrize("said", SPOILT)
def test_fields_that_do_not_fit(said, source, tmp_path, capsys):
    SPOILT[said](ka.read_mesh(source)).write(tmp_path / "f.vtu")
    code, out = move(source, tmp_path / "f.vtu", "--quiet")
    assert code == 2 and not out.exists()
    error = capsys.readouterr().err
    assert error.startswith("kohonen-adapt: ") and error.count("\n") == 1 and said in error


EXPECTED = (
    "--density expected FIELD.vtu:name, a file (.vtu, .vtk, .xdmf, .med, .msh, .msh2, .pos, .sol) and the name of a "
    "field;"
)


@pytest.mark.parametrize(
    ("density", "out", "said"),
    [
        ("f.stl:rho", "a.msh", f"{EXPECTED} got 'f.stl:rho'."),
        ("f.vtu:", "a.msh", f"{EXPECTED} got 'f.vtu:'."),
        ("none.vtu:rho", "a.msh", "read_field expected a file with a field; there is none at 'none.vtu'."),
        ("none.vtu", "a.msh", "read_field expected a file with a field; there is none at 'none.vtu'."),
        ("f.vtu:rho", "a.stl", "--out expected a file that ends in .msh, .msh2, .vtu; got 'a.stl'."),
    ],
)
def test_wrong_arguments(density, out, said, source, tmp_path, capsys):
    arguments = ["relocate", str(source), "--density", density, "--out", str(tmp_path / out), "--quiet"]
    assert cli.main(arguments) == 2
    assert capsys.readouterr().err == f"kohonen-adapt: {said}\n"
