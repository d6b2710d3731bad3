"""Coils in cases of the command line."""

import numpy as np
import pytest
from helpers.cases import dry_run, run_command
from helpers.magnet_solids import blocks
from helpers.worlds import without_matplotlib
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.cases import read_case
from kohonen_adapt.magnetostatics import Coil, MagneticScalarPotential

CASE = """
mesh = "box.msh"
coils.winding = COIL
[materials.limb]
permeability = 1000.0
[materials.air]
[potential]
outer = 0
[adapt]
passes = 1
"""
PLACE = "centre = [0.0, 0.0, 0.0], axis = [0.0, 0.0, 1.0], "
SECTION = "section = [0.02, 0.08], ampere_turns = 1e3"
SHAPES = {
    f'{{shape = "circular", {PLACE}radius = 0.1, {SECTION}}}': Coil.circular(
        (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1, (0.02, 0.08), 1e3
    ),
    f'{{shape = "racetrack", {PLACE}length = 0.2, width = 0.16, radius = 0.04, along = [0, 1, 0], {SECTION}}}': (
        Coil.racetrack((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.2, 0.16, 0.04, (0.02, 0.08), 1e3, along=(0.0, 1.0, 0.0))
    ),
    f'{{shape = "straight_limb", {PLACE}bore = [0.12, 0.14], radius = 0.005, {SECTION}}}': Coil.straight_limb(
        (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.12, 0.14), (0.02, 0.08), 1e3, radius=0.005
    ),
    '{shape = "path", path = [[-0.1, -0.1, 0], [0.1, -0.1, 0], [0, 0.15, 0]], width = 0.02, height = 0.04, '
    "ampere_turns = -5.0}": Coil([[-0.1, 0.1, 0.0], [-0.1, -0.1, 0.15], [0.0, 0.0, 0.0]], 0.02, 0.04, -5.0),
}


@pytest.fixture
def folder(tmp_path):
    t = 0.1 * np.array([-2.0, -1.2, -0.5, 0.0, 0.5, 1.2, 2.0])
    mesh = blocks([t, t, t], {"limb": ((-0.05, -0.05, -0.05), (0.05, 0.05, 0.05))})
    ka.write_mesh(tmp_path / "box.msh", mesh.with_boundaries({"outer": lambda x: np.full(x.shape[1], True)}))
    return tmp_path


@pytest.mark.parametrize("text", SHAPES, ids=["circular", "racetrack", "straight_limb", "path"])
def test_coils_by_their_shapes(text, folder):
    (folder / "case.toml").write_text(CASE.replace("COIL", text))
    problem, x = read_case(folder / "case.toml").problem, np.random.default_rng(0).uniform(-0.1, 0.1, (3, 20))
    assert isinstance(problem, MagneticScalarPotential) and list(problem.coils) == ["winding"]
    assert_array_equal(problem.coils["winding"].field_strength(x), SHAPES[text].field_strength(x))


def test_check_lists_coils(folder, capsys):
    (folder / "case.toml").write_text(CASE.replace("COIL", next(iter(SHAPES))))
    assert run_command("check", folder / "case.toml") == 0
    said = capsys.readouterr()
    assert (
        "Coil 'winding': 1000 A around (0, 0, 1), from (-0.11, -0.11, -0.04) to (0.11, 0.11, 0.04) m, section "
        "0.02 x 0.08 m, 6.25e+05 A/m^2."
    ) in said.out + said.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{shape = "spiral"}', "coils.winding.shape must be one of 'path', 'circular', 'racetrack', 'straight_limb'"),
        (f'{{shape = "circular", {PLACE}{SECTION}}}', "coils.winding.radius is missing"),
        (f'{{shape = "circular", {PLACE}radius = 0.005, {SECTION}}}', "coils.winding: the radius, 0.005 m, must be"),
        (f'{{shape = "circular", {PLACE}radius = 0.04, {SECTION}}}', "the coil 'winding' meets 'limb', which is iron"),
        (f'{{shape = "circular", {PLACE}radius = 0.2, {SECTION}}}', "the coil 'winding' leaves the mesh at"),
        (
            '{shape = "circular", centre = [0, 0], axis = [0, 0, 1], radius = 1, section = [1, 1], ampere_turns = 1}',
            "coils.winding.centre must be [a finite number, a",
        ),
    ],
)
def test_bad_coils_are_refused_before_anything_is_solved(text, said, folder, refused):
    refused(CASE.replace("COIL", text), said)


def test_coils_are_for_tetrahedra(folder, refused):
    text = CASE.replace("COIL", next(iter(SHAPES))).replace("[materials.limb]", "depth = 2.0\n[materials.limb]")
    refused(text, "depth is for meshes of triangles only, but the case has coils, for tetrahedra")


@pytest.mark.parametrize(("current", "count"), [("1e3", 0), ("1e9", 1)])
def test_a_current_that_no_winding_has(current, count, folder, capsys):
    text = CASE.replace("COIL", next(iter(SHAPES))).replace("ampere_turns = 1e3", f"ampere_turns = {current}")
    assert dry_run(folder / "case.toml", text) == 0
    said = capsys.readouterr()
    assert (said.out + said.err).count("coil 'winding' has 6.25e+11 A/m^2, and windings have about 10^6") == count


def test_a_reversed_current_is_another_problem(folder, capsys, monkeypatch):
    """Its indicators are the same, the signs of its outputs are not."""
    without_matplotlib(monkeypatch)
    case, out = folder / "case.toml", str(folder / "out")
    output = '[outputs.b]\nquantity = "flux_density"\nat = [0.0, 0.0, 0.07]\ncomponent = "z"\n'
    case.write_text(
        CASE.replace("COIL", next(iter(SHAPES))).replace("passes = 1", "passes = 0\npolish = false") + output
    )
    assert run_command("run", case, "--out", out) == 0
    changed = case.read_text().replace("ampere_turns = 1e3", "ampere_turns = -1e3").replace("passes = 0", "passes = 1")
    case.write_text(changed)
    capsys.readouterr()
    assert run_command("run", case, "--resume", out) == 2
    assert "the problem differs from the problem of the checkpoint: output 'b (T)' was " in capsys.readouterr().err
