"""A fixed at a named point: in a problem of natural conditions alone, kept by adapt, from Gmsh files and in cases."""

import numpy as np
import pytest
from helpers.meshes import square

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.cases import fitting_mesh, read_case
from kohonen_adapt.io import Groups
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY

MU0 = VACUUM_PERMEABILITY
DENSITY = 1e6  # A/m^2, out of the page left of the middle of the square and into it right of it
MATERIALS = {"go": Material(current_density=DENSITY), "back": Material(current_density=-DENSITY)}
POINT = {"middle": (0.5, 0.5)}


def conductors(n=8):
    halves = {"go": lambda x: x[0] < 0.5, "back": lambda x: x[0] > 0.5}
    return square(n).with_boundaries({"rim": lambda x: x[0] > -1}).with_subdomains(halves)


def exact(x):
    """A of two conductors that fill the square, H along y between natural sides; 0 in the middle."""
    off = np.abs(x[0] - 0.5)
    return np.sign(0.5 - x[0]) * MU0 * DENSITY * 0.5 * (off - off**2)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("value", [0.0, 0.3, lambda x: x[0] - 0.2])
def test_a_value_at_a_point_takes_the_constant_away(order, value):
    mesh = conductors(16)
    field = Magnetostatics(MATERIALS, {"middle": value}, points=POINT, order=order).solve(mesh)
    given = 0.3 if callable(value) else value
    off = field.potential - given - exact(mesh.p)
    assert np.abs(off).max() < (0.02 if order == 1 else 2e-4) * np.ptp(exact(mesh.p))
    assert field.potential_at([[0.5], [0.5]])[0] == pytest.approx(given, abs=1e-15)


@pytest.mark.parametrize("topology", ["recycle", "flip", "fixed"])
def test_adapt_and_polish_keep_the_node(topology):
    mesh, problem = conductors(), Magnetostatics(MATERIALS, {"middle": 0.0}, points=POINT, order=1)
    result = ka.adapt(mesh, problem, topology=topology, passes=3)
    assert result.best.functional < result.history[0].functional
    assert all(step.comparable and step.polish_gain > 0.0 for step in result.history[1:])
    for adapted in (result.mesh, ka.polish(mesh, problem, topology="fixed" if topology == "fixed" else "flip")):
        middle = np.flatnonzero((adapted.p == 0.5).all(axis=0))
        assert len(middle) == 1 and problem.solve(adapted).potential[middle[0]] == 0.0
        assert not np.array_equal(adapted.p, mesh.p)


CASE = """
mesh = "m.msh"
scale = 1e-3
[materials]
go = {current_density = 1e6}
back = {current_density = -1e6}
[adapt]
passes = 1
"""


def written(folder, extra):
    middle = np.array([[500.0], [500.0]])
    ka.write_mesh(folder / "m.msh", conductors().scaled(1e3), groups=Groups({(0, 7): "gauge"}, {7: middle}))
    (folder / "case.toml").write_text(CASE + extra)
    return str(folder / "case.toml")


@pytest.mark.parametrize(
    "extra",
    ["[potential]\ngauge = 0.0\n", "[potential]\nmine = 0.0\n[points]\nmine = [0.5, 0.5]\n"],
    ids=["of the file", "of the case"],
)
def test_cases_have_points(tmp_path, extra, capsys):
    case = written(tmp_path, extra)
    assert cli.main(["run", case, "--dry-run"]) == 0
    said = read_case(tmp_path / "case.toml")
    adapted = ka.adapt(fitting_mesh(said), said.problem, **said.adapt).mesh
    assert np.sum((np.abs(adapted.p - 0.5) < 1e-12).all(axis=0)) == 1
    assert cli.main(["check", str(tmp_path / "m.msh"), "--scale", "1e-3"]) == 0
    assert "point 'gauge': (0.5, 0.5) m" in capsys.readouterr().out


def test_points_that_are_not_there_are_named(tmp_path, capsys):
    mesh = conductors()
    for points, message in (
        ({"gauge": (0.51, 0.5)}, r"no node at the point 'gauge', \(0\.51, 0\.5\); the nearest one is at \(0\.5.*, 0"),
        ({"rim": (0.5, 0.5)}, "'rim' is a boundary of the mesh and one of the points; rename one of them"),
        ({}, r"boundary 'gauge' is not in the mesh; it has 'rim'\. If it is a point, give its position in points"),
    ):
        problem = Magnetostatics(MATERIALS, {"gauge": 0.0}, points=points)
        with pytest.raises(ValueError, match=message):
            problem.solve(mesh)
    with pytest.raises(ValueError, match="no node at the point 'gauge'"):
        ka.adapt(mesh, Magnetostatics(MATERIALS, {"gauge": 0.0}, points={"gauge": (0.51, 0.5)}))
    assert cli.main(["run", written(tmp_path, "[potential]\nmine = 0.0\n"), "--dry-run"]) == 2
    assert "boundary 'mine' is not in the mesh" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(0.0, 0.0)], r"points must map names to positions \(x, y\) in metres; got \[\(0\.0, 0\.0\)\]\."),
        ({"a": (0.0, 0.0, 0.0)}, r"points\['a'\] must be a position \(x, y\) in metres, or several \(2, n\); got \["),
        ({"a": "origin"}, r"points\['a'\] must be a position .*; got 'origin'\."),
    ],
)
def test_wrong_points_are_named(points, message):
    with pytest.raises(ValueError, match=message):
        Magnetostatics(MATERIALS, {"a": 0.0}, points=points)
