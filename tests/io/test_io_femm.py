"""Solutions of FEMM: the mesh with its names and in metres, and the recipe from a model to a case."""

import lzma
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers.places import EXAMPLES
from helpers.small_files import BLOCK, HEAD, disc
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case
from kohonen_adapt.magnetostatics import halbach
from kohonen_adapt.mesh.measures import area

RECIPE = runpy.run_path(str(EXAMPLES / "femm.py"))["main"]


@pytest.fixture(scope="module")
def dipole(tmp_path_factory):
    """A real file of FEMM 4.2; where it is from is in data/README.md."""
    path = tmp_path_factory.mktemp("femm") / "dipole.ans"
    path.write_bytes(lzma.decompress((Path(__file__).parent / "data" / "dipole.ans.xz").read_bytes()))
    return path


def case_from(text, folder):
    """Return the case that the recipe makes of a file with this text."""
    (folder / "m.ans").write_text(text)
    RECIPE(folder / "m.ans", folder / "case.toml")
    return read_case(folder / "case.toml")


def solution(path):
    """Nodes with potentials, and elements with the boundary condition of each side, as FEMM's lists have them."""
    lines = path.read_text().partition("[Solution]\n")[2].split("\n")
    count = int(lines[0])
    nodes = np.array([line.split() for line in lines[1 : 1 + count]], float)
    elements = lines[2 + count : 2 + count + int(lines[1 + count])]
    return nodes, np.array([line.split()[:7] for line in elements], int)


def test_a_file_of_femm(dipole):
    mesh = ka.read_mesh(dipole)
    nodes, elements = solution(dipole)
    assert_array_equal(mesh.p, nodes[:, :2].T)
    assert_array_equal(mesh.t, np.sort(elements[:, :3], axis=1).T)
    assert_array_equal(mesh.subdomains["NdFeB"], np.flatnonzero(elements[:, 3] == 0))
    assert_array_equal(mesh.subdomains["air"], np.flatnonzero(elements[:, 3] == 1))
    side, corner = np.nonzero(elements[:, 4:7].T == 0)[::-1]
    marked = {frozenset(elements[e, [k, (k + 1) % 3]].tolist()) for e, k in zip(side, corner, strict=True)}
    assert {frozenset(ends) for ends in mesh.facets[:, mesh.boundaries["A=0"]].T.tolist()} == marked
    assert area(mesh)[mesh.subdomains["NdFeB"]].sum() == pytest.approx(0.04 * 0.01, rel=1e-12)


def test_the_recipe_gives_the_solution_of_femm(dipole):
    """To all its digits: the elements, the magnet and the conditions are the same."""
    RECIPE(dipole, dipole.with_name("case.toml"))
    case = read_case(dipole.with_name("case.toml"))
    mesh = fitting_mesh(case)
    potential = case.problem.solve(mesh).potential
    wanted = solution(dipole)[0][:, 2]
    assert_allclose(potential, wanted, rtol=0.0, atol=1e-10 * np.abs(wanted).max())
    assert case.problem.depth == pytest.approx(0.04)


@pytest.mark.parametrize(("unit", "metres"), [("inches", 0.0254), ("millimeters", 1e-3), ("mils", 2.54e-5)])
def test_arcs_segments_labels_and_units(unit, metres, tmp_path):
    wanted, label, text = disc(unit)
    (tmp_path / "m.ans").write_text(text)
    mesh = ka.read_mesh(tmp_path / "m.ans")
    assert_array_equal(mesh.p, metres * wanted.p)
    assert_array_equal(mesh.boundaries["rim"], wanted.boundary_facets())
    assert_array_equal(mesh.boundaries["the diameter"], wanted.facets_satisfying(lambda x: np.abs(x[1]) < 1e-12))
    parts = {"air": [0, 1], "air 1": [0], "air 2": [1], "steel": [2]}
    assert mesh.subdomains.keys() == parts.keys()
    for name, labels in parts.items():
        assert_array_equal(mesh.subdomains[name], np.flatnonzero(np.isin(label, labels)))


def strip(kind):
    """A strip of two triangles, whose left and right side have one boundary property."""
    air = BLOCK.format("air", 1, 1, 0, "")
    head = HEAD.replace("<BdryType> = 0", f"<BdryType> = {kind}", 1).partition("[NumPoints]")[0]
    head = head.format(unit="meters", air=air, steel=air.replace("air", "other"))
    points = "[NumPoints] = 4\n0 0 0 0\n2 0 0 0\n2 1 0 0\n0 1 0 0\n"
    sides = "[NumSegments] = 4\n0 1 -1 2 0 0\n1 2 -1 1 0 0\n2 3 -1 2 0 0\n3 0 -1 1 0 0\n[NumArcSegments] = 0\n"
    label = "[NumBlockLabels] = 1\n1 0.5 1 -1 0 0 0 1 0\n"
    return f"{head}{points}{sides}{label}[Solution]\n4\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n2\n0 1 2 0\n0 2 3 0\n"


@pytest.mark.parametrize(("kind", "key"), [(4, "periodic"), (5, "antiperiodic")])
def test_sides_of_a_pair_have_one_name_and_one_each(kind, key, tmp_path):
    (tmp_path / "m.ans").write_text(strip(kind))
    mesh = ka.read_mesh(tmp_path / "m.ans")
    x = {name: np.unique(mesh.p[0, mesh.facets[:, rows]]).tolist() for name, rows in mesh.boundaries.items()}
    assert x == {"rim": [0.0, 2.0], "rim 1": [2.0], "rim 2": [0.0], "the diameter": [0.0, 2.0]}
    case = case_from(strip(kind), tmp_path)
    assert getattr(case.problem, key) == (("rim 1", "rim 2"),) and case.problem.potential == {"the diameter": 0.0}
    fitting_mesh(case)


def test_an_air_gap_element_is_a_hole_with_a_remedy(tmp_path, caplog):
    (tmp_path / "m.ans").write_text(strip(6))
    assert ka.read_mesh(tmp_path / "m.ans").nelements == 2
    (said,) = [record.getMessage() for record in caplog.records]
    assert "the air gap element 'rim' has no triangles" in said and "put a block label into the gap" in said


def test_laminations_in_the_plane_carry_flux_beside_the_air_between_them(tmp_path):
    """B = fill B(H) + (1 - fill) mu0 H, as FEMM has it."""
    text = disc()[2].replace("<LamFill> = 1", "<LamFill> = 0.75").replace("<Mu_x> = 1", "<Mu_x> = 9", 1)
    materials = case_from(text.replace("<Mu_y> = 1", "<Mu_y> = 9", 1), tmp_path).problem.materials
    assert materials["air 1"].permeability == pytest.approx(0.75 * 9 + 0.25)
    vacuum = 0.25 * 4e-7 * np.pi
    wanted = [(0.0, 0.0), *((0.75 * b + vacuum * h, h) for b, h in [(1, 300), (2, 5000), (2.2, 160000)])]
    assert_allclose(materials["steel"].bh.points, wanted, rtol=1e-12)


def test_a_noisy_curve_is_smoothed(tmp_path):
    case = case_from(disc()[2].replace("1\t300\n2\t5000", "1.5\t300\n1.4\t500"), tmp_path)
    assert_allclose(case.problem.materials["steel"].bh.points, [(0.0, 0.0), (1.45, 400.0), (2.2, 160000.0)])


def test_currents_curves_and_conditions_of_the_recipe(tmp_path):
    case = case_from(disc()[2], tmp_path)
    problem = case.problem
    assert problem.potential == {"rim": 0.5, "the diameter": 0.0} and problem.ampere_turns == {"air 1": 250.0}
    assert problem.materials.keys() == {"air 1", "air 2", "steel"} and problem.depth == pytest.approx(0.0508)
    assert problem.materials["steel"].bh is not None
    mesh = fitting_mesh(case)
    assert problem.solve(mesh).flux_linkage("air 1", turns=100) != 0.0


@pytest.mark.parametrize(("formula", "pole_pairs", "sign"), [("theta", 0, 1), ("theta+180", 0, -1), ("3*theta", 2, 1)])
def test_magnets_that_turn_and_a_potential_that_varies(formula, pole_pairs, sign, tmp_path):
    """By theta in degrees about the origin; and A = A_0 + A_1 x + A_2 y, with x and y in the unit of the drawing."""
    text = disc("millimeters")[2].replace("<H_c> = 0", "<H_c> = 9e5", 1).replace("<A_1> = 0", "<A_1> = 3", 1)
    text = text.replace("<A_2> = 0", "<A_2> = -0.25", 1).replace("100\t0\n", f'100\t0\t"{formula}"\n')
    case, x = case_from(text, tmp_path), np.array([[2e-3, 1e-3, -4e-4], [0.0, 3e-3, 1e-4]])
    problem = case.problem
    assert_allclose(problem.potential["rim"](x), 0.5 + 3e3 * x[0] - 250.0 * x[1], rtol=1e-12)
    assert_allclose(problem.materials["air 1"].coercivity(x), sign * halbach(9e5, pole_pairs)(x), rtol=1e-12)
    assert problem.materials["air 2"].coercivity == (9e5, 0.0)
    fitting_mesh(case)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[Frequency]   =  0", "[Frequency]   =  50", "a frequency is nothing that this recipe knows"),
        ("<BdryType> = 0", "<BdryType> = 2", "the boundary rim, on which A is not given, is nothing"),
        ("<BdryType> = 0", "<BdryType> = 6", "the boundary rim, on which A is not given, is nothing"),
        ("<LamFill> = 1", "<LamFill> = 0.9", "air: a laminated magnet, which is nothing"),
        (
            "<LamType> = 0\n    <LamFill> = 1",
            "<LamType> = 1\n    <LamFill> = 0.9",
            "air: laminated across the plane, so it is nothing",
        ),
        ("<A_0> = 0.5", "<A_0> = 0.5\n    <phi> = 90", "the boundary rim, whose A has a phase, is nothing"),
        ("<Mu_y> = 1", "<Mu_y> = 2", "air: different permeabilities in x and y is nothing"),
        ("<CircuitType> = 1", "<CircuitType> = 0", "coil: a circuit in parallel is nothing"),
        (
            "0\t1\t0\n[Solution]",
            '0\t1\t0\t"R*theta"\n[Solution]',
            "the direction of magnetisation 'R.theta' is nothing",
        ),
    ],
)
def test_what_the_recipe_does_not_know(old, new, said, tmp_path):
    text = disc()[2].replace("<H_c> = 0", "<H_c> = 1000")
    assert old in text
    with pytest.raises(SystemExit, match=said):
        case_from(text.replace(old, new, 1), tmp_path)
