"""GetDP on both sides of `relocate` has a smaller error at the same nodes, and all groups by their numbers."""

import runpy
import shutil
import subprocess

import numpy as np
import pytest
import skfem
from helpers.mesh_files import drawn_by_gmsh, needs_gmsh
from helpers.places import EXAMPLES
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve

import kohonen_adapt as ka
from kohonen_adapt.io import Groups
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

pytestmark = pytest.mark.slow

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
        subprocess.run([*run, *form, "-solve", "Field", "-pos", "Indicator"], check=True)
        fields.append(ka.read_field(folder / "eta.pos", mesh, "eta"))
    assert fields[0].shape == (mesh.nelements,) and np.all(fields[0] > 0.0)
    assert_allclose(fields[1], fields[0], rtol=1e-6)


MODEL = """
Group {{
  Iron = Region[1]; Magnet = Region[2]; Air = Region[3]; Rim = Region[4]; All_of_it = Region[{{Iron, Magnet, Air}}];
}}
Function {{
  nu[Iron] = 1 / (1000 * 4e-7 * Pi); nu[Magnet] = 1 / (1.05 * 4e-7 * Pi); nu[Air] = 1 / (4e-7 * Pi);
  hc[Magnet] = nu[] * Vector[0, 1.2, 0]; hc[Iron] = Vector[0, 0, 0]; hc[Air] = Vector[0, 0, 0];
}}
Constraint {{ {{ Name C; Case {{ {{ Region Rim; Value 0; }} }} }} }}
Jacobian {{ {{ Name J; Case {{ {{ Region All; Jacobian Vol; }} }} }} }}
Integration {{ {{ Name I; Case {{ {{ Type Gauss; Case {{ {{ GeoElement Triangle; NumberOfPoints 3; }} }} }} }} }} }}
FunctionSpace {{ {{ Name Hcurl_a; Type Form1P;
  BasisFunction {{ {{ Name s; NameOfCoef c; Function BF_PerpendicularEdge; Support All_of_it; Entity NodesOf[All]; }} }}
  Constraint {{ {{ NameOfCoef c; EntityType NodesOf; NameOfConstraint C; }} }} }} }}
Formulation {{ {{ Name F; Type FemEquation; Quantity {{ {{ Name a; Type Local; NameOfSpace Hcurl_a; }} }}
  Equation {{
    Integral {{ [ nu[] * Dof{{d a}}, {{d a}} ]; In All_of_it; Jacobian J; Integration I; }}
    Integral {{ [ -hc[], {{d a}} ]; In Magnet; Jacobian J; Integration I; }}
  }} }} }}
Indicator_Space = "Hcurl_a";
Indicator_Media = 3;
Group {{ Indicator_Medium_1 = Region[Iron]; Indicator_Medium_2 = Region[Magnet]; Indicator_Medium_3 = Region[Air]; }}
Function {{ indicator_h[] = nu[] * $1 - hc[]; indicator_mu[] = 1 / nu[]; }}
Include "{include}";
Resolution {{ {{ Name R;
  System {{ {{ Name A; NameOfFormulation F; }} {{ Name Indicator; NameOfFormulation Indicator; }} }}
  Operation {{ Generate[A]; Solve[A]; SaveSolution[A];
              Generate[Indicator]; Solve[Indicator]; SaveSolution[Indicator]; }} }} }}
"""


def recovered(mesh, problem):
    """The indicator by scikit-fem: h projected to continuous fields on each medium, means over corners of its error."""
    field = problem.solve(mesh).field_strength
    eta = np.zeros(mesh.nelements)
    for name in ("iron", "magnet", "air"):
        rows = mesh.subdomains[name]
        basis = skfem.CellBasis(mesh, skfem.ElementTriP1(), elements=rows)
        mass = skfem.BilinearForm(lambda u, v, _: u * v).assemble(basis)
        nodes = np.unique(mesh.t[:, rows])
        off = 0.0
        for component in field[:, rows]:
            load = skfem.LinearForm(lambda v, w: w["h"] * v).assemble(basis, h=component[:, None] + 0.0 * basis.dx)
            nodal = np.zeros(mesh.nvertices)
            nodal[nodes] = spsolve(mass[nodes][:, nodes].tocsc(), load[nodes])
            off = off + (nodal[mesh.t[:, rows]] - component) ** 2
        mu = 4e-7 * np.pi * problem.materials[name].permeability
        eta[rows] = np.sqrt(mu * area(mesh)[rows]) * np.sqrt(off).mean(axis=0)
    return eta


@needs_getdp
def test_any_model_may_include_the_indicator(tmp_path):
    """One with other names, a magnet, and three media: the same numbers as by scikit-fem."""
    mesh = ka.read_mesh(EXAMPLES / "c_core.msh", scale=1e-3)
    names = {(2, 1): "iron", (2, 2): "magnet", (2, 3): "air", (1, 4): "outer"}
    ka.write_mesh(tmp_path / "m.msh2", mesh, groups=Groups(names))
    (tmp_path / "m.pro").write_text(MODEL.format(include=EXAMPLES / "indicator.pro"))
    run = ["getdp", tmp_path / "m.pro", "-msh", tmp_path / "m.msh2", "-name", tmp_path / "m", "-v", "1"]
    subprocess.run([*run, "-solve", "R", "-pos", "Indicator"], check=True, cwd=tmp_path)
    materials = {
        "iron": Material(permeability=1000.0),
        "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)),
        "air": Material(),
    }
    wanted = recovered(mesh, Magnetostatics(materials, potential={"outer": 0.0}, order=1))
    eta = ka.read_field(tmp_path / "eta.pos", mesh, "eta")
    assert_allclose(eta, wanted, rtol=1e-4, atol=1e-4 * wanted.max())


@needs_gmsh
def test_the_drawing_gives_the_groups(tmp_path):
    drawn = drawn_by_gmsh(tmp_path / "getdp.msh", (EXAMPLES / "getdp.geo").read_text(encoding="utf-8"), "2.2")
    assert set(ka.read_groups(drawn).names) == GROUPS == set(ka.read_groups(EXAMPLES / "getdp.msh").names)
