"""GetDP on both sides of `relocate` has a smaller error at the same nodes, and all groups by their numbers."""

import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from helpers.mesh_files import gmsh, gmsh_session, needs_gmsh
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples"
GROUPS = {(1, 200), (2, 100), (2, 101), (2, 102), (2, 103)}

needs_getdp = pytest.mark.skipif(shutil.which("getdp") is None, reason="getdp is not installed (Debian: getdp)")


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("getdp")
    return folder, *runpy.run_path(str(EXAMPLES / "getdp.py"))["main"](folder)


@needs_getdp
def test_the_error_is_lower_at_equal_nodes(example):
    _, meshes, errors = example
    assert len({ka.read_mesh(mesh).p.shape for mesh in meshes}) == 1
    assert np.all(np.diff(errors) < 0.0)
    assert errors[-1] < 0.5 * errors[0]


@needs_getdp
def test_the_groups_are_those_that_the_model_refers_to(example):
    _, meshes, _ = example
    before = ka.read_mesh(meshes[0])
    for file in meshes:
        assert set(ka.read_groups(file).names) == GROUPS
        mesh = ka.read_mesh(file)
        for name, rows in before.subdomains.items():
            assert area(mesh)[mesh.subdomains[name]].sum() == pytest.approx(area(before)[rows].sum(), rel=1e-12)


@needs_getdp
def test_the_picture_is_there(example):
    assert (example[0] / "getdp.png").stat().st_size > 10_000


@needs_getdp
@pytest.mark.parametrize("options", [[], ["-v2"], ["-v2", "-bin"]], ids=["list", "mesh", "binary mesh"])
def test_every_form_in_which_getdp_writes_a_field(options, tmp_path):
    mesh = ka.read_mesh(EXAMPLES / "getdp.msh")
    fields = []
    for number, form in enumerate([[], options]):
        folder = tmp_path / str(number)
        folder.mkdir()
        run = ["getdp", EXAMPLES / "getdp.pro", "-msh", EXAMPLES / "getdp.msh", "-name", folder / "getdp", "-v", "1"]
        subprocess.run([*run, *form, "-solve", "Field", "-pos", "Indicators"], check=True)
        fields.append(ka.read_field(folder / "eta.pos", mesh, "eta"))
    assert fields[0].shape == (mesh.t.shape[1],) and np.all(fields[0] > 0.0)
    assert_allclose(fields[1], fields[0], rtol=1e-6)


@needs_gmsh
def test_the_drawing_gives_the_groups(tmp_path):
    with gmsh_session() as model:
        gmsh.open(str(EXAMPLES / "getdp.geo"))
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        model.mesh.generate(2)
        gmsh.write(str(tmp_path / "getdp.msh"))
    assert (
        set(ka.read_groups(tmp_path / "getdp.msh").names) == GROUPS == set(ka.read_groups(EXAMPLES / "getdp.msh").names)
    )
