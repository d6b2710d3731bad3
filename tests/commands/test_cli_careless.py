"""Careless mistakes of engineers, and what `check` and `run` say about them."""

import numpy as np
import pytest
from helpers.meshes import square
from helpers.mesh_files import gmsh_session, needs_gmsh
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
