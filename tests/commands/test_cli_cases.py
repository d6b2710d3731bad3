"""What a case can say, by the real command, gives the figures of Python; and no argument is forgotten."""

import inspect
import re
import shutil
import tomllib
from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, get_args, get_origin

import numpy as np
import pytest
from helpers.cases import report_in, run_command, table_of
from helpers.meshes import centres, inset, square
from helpers.places import EXAMPLES
from helpers.worlds import without_matplotlib
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import magnetostatics
from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.cases.reading import ADAPT, PROBLEM
from kohonen_adapt.cases.tables import GOALS, LAWS, MOTIONS, PATTERNS, QUANTITIES, SHAPES
from kohonen_adapt.magnetostatics import (
    FluxDensityAt,
    FluxLinkage,
    Force,
    Goal,
    Magnetostatics,
    Material,
    StoredEnergy,
    Torque,
    halbach,
    radial,
)


def drawn():
    """A square magnet in a square of air, all sides named; 81 nodes."""
    mesh = inset(8)
    x, y = mesh.p[:, mesh.facets].mean(axis=1)
    sides = {"left": x < 1e-9, "right": x > 1 - 1e-9, "bottom": y < 1e-9, "top": y > 1 - 1e-9}
    return mesh.with_boundaries({name: np.flatnonzero(there) for name, there in sides.items()})


class Said(NamedTuple):
    """The same in TOML and in Python, beside what is in every case below."""

    toml: str
    problem: Mapping[str, Any] = MappingProxyType({})
    remanence: Any = (0.0, 1.2)
    adapt: Mapping[str, Any] = MappingProxyType({})


PLAIN = {"potential.left": "0.0", "potential.right": "0.0", "materials.core.remanence": "[0.0, 1.2]"}


def potential(x):
    return 0.3 * x[0] - 0.1 * x[1] + 2e-3


def tabulated(x):
    return np.interp(x[1], [0.0, 0.25, 1.0], [0.0, 0.5, -0.5])


CASES = {
    "goal force": Said(
        'goal = {quantity = "force", body = "core", direction = [3.0, 4.0]}', {"goal": Force("core", (3.0, 4.0))}
    ),
    "goal torque": Said(
        'goal = {quantity = "torque", body = ["core"], centre = [0.5, 0.4]}', {"goal": Torque(["core"], (0.5, 0.4))}
    ),
    "goal flux linkage": Said(
        'goal = {quantity = "flux_linkage", circuit = {core = 10}}', {"goal": FluxLinkage({"core": 10})}
    ),
    "goal flux density": Said(
        'goal = {quantity = "flux_density", x = [0.4, 0.5], direction = [0, 2], radius = 0.01}',
        {"goal": FluxDensityAt((0.4, 0.5), (0.0, 1.0), 0.01)},
    ),
    "goal energy": Said('goal = {quantity = "energy", part = "core"}', {"goal": StoredEnergy("core")}),
    "radial": Said(
        'materials.core.remanence = {pattern = "radial", magnitude = 1.2, centre = [0.4, 0.5]}',
        remanence=radial(1.2, centre=(0.4, 0.5)),
    ),
    "halbach": Said(
        'materials.core.remanence = {pattern = "halbach", magnitude = 1.2, pole_pairs = -2, centre = [0.5, 0.5]}',
        remanence=halbach(1.2, -2, centre=(0.5, 0.5)),
    ),
    "parallel": Said(
        'materials.core.remanence = {pattern = "parallel", magnitude = 1.2, degrees = 30.0}',
        remanence=(1.2 * np.cos(np.pi / 6), 1.2 * np.sin(np.pi / 6)),
    ),
    "expression": Said(
        'potential.left = "0.3*x - 0.1*y + 2e-3"\npotential.right = "x/2"',
        {"potential": {"left": potential, "right": 0.5}},
    ),
    "table": Said(
        'potential.left = {over = "y", points = [[0.0, 0.0], [0.25, 0.5], [1.0, -0.5]]}',
        {"potential": {"left": tabulated, "right": 0.0}},
    ),
    "straight sides": Said("order = 2\ncurved = false", {"order": 2, "curved": False}),
    "schedule": Said(
        "adapt.schedule = {stages = [{radius = 2, epochs = 2, learning_rate = [0.4, 0.1]}], sweeps = 3}",
        adapt={"schedule": ka.Schedule((ka.Stage(2, 2, (0.4, 0.1)),), sweeps=3)},
    ),
}


def case_text(said: str) -> str:
    keys = {key: value for key, value in PLAIN.items() if f"{key} =" not in said}
    lines = [
        'mesh = "m.msh"',
        said,
        *(f"{key} = {value}" for key, value in keys.items()),
        "materials.core.permeability = 1.05",
        "materials.air = {}",
        "adapt.passes = 2",
        'outputs.stored = {quantity = "energy"}',
        'outputs.pull = {quantity = "force", body = "core", component = "x"}',
        'outputs.field = {quantity = "flux_density", at = [0.1, 0.3], component = "y", recovered = true}',
        'outputs.a = {quantity = "potential", at = [0.1, 0.3]}',
    ]
    return "\n".join(lines) + "\n"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a case on that mesh by the command; the rows of its history, as numbers, and the folder."""
    without_matplotlib(monkeypatch)
    ka.write_mesh(tmp_path / "m.msh", drawn())

    def rows(text):
        (tmp_path / "case.toml").write_text(text)
        assert run_command("run", tmp_path / "case.toml", "-o", tmp_path / "out") == 0
        return table_of(tmp_path / "out" / "history.csv")

    return rows


POINT = np.array([[0.1], [0.3]])
OUTPUTS = {
    "stored (J/m)": lambda field: field.energy,
    "pull (N/m)": lambda field: field.force("core")[0],
    "field (T)": lambda field: field.flux_density_at(POINT, recovered=True)[1, 0],
    "a (Wb/m)": lambda field: field.potential_at(POINT)[0],
}


def said_in_python(said):
    materials = {"core": Material(permeability=1.05, remanence=said.remanence), "air": Material()}
    return Magnetostatics(materials, **({"potential": {"left": 0.0, "right": 0.0}} | dict(said.problem)))


UNITS = {
    "goal force": "N/m",
    "goal torque": "N m/m",
    "goal flux linkage": "Wb/m",
    "goal energy": "J/m",
    "goal flux density": "T",
}


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_the_problem_of_python(name):
    said, mesh = CASES[name], drawn()
    case = case_of(tomllib.loads(case_text(said.toml)), Path())
    problem = said_in_python(said)
    field, wanted = case.problem.solve(mesh), problem.solve(mesh)
    size = np.abs(wanted.potential).max()
    assert_allclose(field.potential, wanted.potential, atol=1e-12 * size)
    for label, output in case.labelled_outputs.items():
        assert output(field) == pytest.approx(OUTPUTS[label](wanted), rel=1e-9, abs=1e-9 * wanted.energy)
    assert (case.problem.goal, case.problem.curved) == (problem.goal, problem.curved)
    assert case.adapt == {"passes": 2, **said.adapt}
    assert case.labelled_outputs.keys() == OUTPUTS.keys()
    if name in UNITS:
        assert case.problem.goal_unit == UNITS[name]


def test_the_command_gives_what_python_gives(run, tmp_path, capsys):
    said = CASES["goal force"]
    rows, problem = run(case_text(said.toml)), said_in_python(said)
    result = ka.adapt(ka.read_mesh(tmp_path / "m.msh"), problem, passes=2, outputs=OUTPUTS)
    for row, step in zip(rows, result.history, strict=True):
        assert float(row["estimate"]) == pytest.approx(step.estimate, rel=1e-9)
        for output, value in step.outputs.items():
            assert float(row[f"output {output}"]) == pytest.approx(value, rel=1e-9, abs=1e-9 * result.solution.energy)
    told = re.search(
        r"The goal is (\S+) N/m, with an estimated error of (\S+) .*: the exact value is near (\S+)",
        capsys.readouterr().out,
    )
    value, error = problem.goal(result.solution), problem.goal_error(result.solution)
    digit = 0.06 * abs(error)  # the error is printed with two
    assert (float(told[1]), float(told[3])) == pytest.approx((value, value + error), abs=digit)
    best = next(row for row in rows if row["goal error (N/m)"])
    assert float(best["goal + error (N/m)"]) == pytest.approx(value + error, rel=1e-9)


def test_the_report_says_what_the_mesh_was_adapted_for(out, tmp_path, monkeypatch):
    without_matplotlib(monkeypatch)
    ka.write_mesh(tmp_path / "m.msh", drawn())
    text = f"{CASES['goal energy'].toml}\ndepth = 0.1\n{case_text('')}".replace("passes = 2", "passes = 0")
    (tmp_path / "case.toml").write_text(text)
    assert run_command("run", tmp_path / "case.toml", "-o", out, "--quiet") == 0
    report = report_in(out)
    assert "<dt>goal</dt>" in report
    assert "error indicator of an element (\\u221a(J))" in report


def test_the_whole_rim_of_a_mesh_without_named_lines(run, out, tmp_path):
    """It has a hole, whose rim is a part of the whole."""
    mesh = square(12)
    mesh = mesh.remove_elements(np.flatnonzero(np.abs(centres(mesh) - 0.125).max(axis=0) < 0.04))
    inside = np.abs(centres(mesh) - 0.5).max(axis=0) < 0.25
    mesh = mesh.with_subdomains({"core": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})
    ka.write_mesh(tmp_path / "m.msh", mesh)
    text = re.sub(r"(?m)^potential.*\n", "", case_text('rim = "edge"')) + "potential.edge = 0.0\n"
    stored = [float(row["output stored (J/m)"]) for row in run(text)]
    adapted = ka.read_mesh(out / "adapted.msh")
    assert_array_equal(np.sort(adapted.boundaries["edge"]), adapted.boundary_facets())
    problem = said_in_python(Said("", {"potential": {"edge": 0.0}}))
    assert pytest.approx(problem.solve(adapted).energy, rel=1e-9) in stored
    (tmp_path / "again.toml").write_text(text.replace("m.msh", "out/adapted.msh"))
    assert run_command("run", tmp_path / "again.toml", "--dry-run") == 0


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        *(
            (
                f'rim = "{name}"',
                f"mesh: rim must be a new name for the whole rim of the mesh, which already has another '{name}'",
            )
            for name in ("left", "core")
        ),
        ('goal = {quantity = "force", body = "cor", direction = [0, 1]}', "goal: subdomain 'cor' is not in the mesh"),
        ('goal = {quantity = "energy", part = ["core", "air"]}', "goal: StoredEnergy needs a part of the mesh"),
        (
            'outputs.more = {quantity = "torque", body = "air"}',
            "outputs.more: subdomain 'air' touches 'core', which is",
        ),
        (
            'outputs.more = {quantity = "potential", at = [1.1, 0.5]}',
            "outputs.more: at must be a point [x, y] of the mesh, in metres; [1.1, 0.5] is outside.",
        ),
        (
            'potential.left = {over = "y", points = [[0.0, 0.0], [1000.0, 1.0]]}',
            "potential.left: the table is 1000 m wide, and the mesh reaches from y = 0 to 1 m. Give its points in ",
        ),
        (
            'goal = {quantity = "energy", part = "core"}\nadapt.rtol = 0.1',
            "adapt.rtol is relative to the energy norm, which does not measure a goal",
        ),
        (
            'potential.left = {over = "y", points = [[0.0, 0.0], [0.5, 1.0]]}',
            "potential.left: the table reaches from y = 0 to 0.5 m, and the boundary has a node at 1 m.",
        ),
    ],
)
def test_what_does_not_fit_the_mesh_is_refused_before_the_run(toml, said, run, refused):
    refused(case_text(toml), f"case.toml: {said}")


def test_a_mesh_without_named_lines_is_told_how_to_name_its_rim(tmp_path, refused):
    ka.write_mesh(tmp_path / "m.msh", inset(8))
    said = "potential must name a boundary, but no boundary of the mesh file has a name:"
    refused(case_text(""), f'case.toml: {said} write rim = "outer"')


# What `init` writes.


def uncommented(text):
    """The text with each of its examples in turn, in place of what is there of that key; and which one it is."""
    blocks = text.split("\n\n")
    material = next(k for k, block in enumerate(blocks) if block.startswith("[materials."))
    for k, block in enumerate(blocks):
        if block.startswith("# ["):
            yield block, [*blocks[:k], re.sub(r"^# (?=[\[\w])", "", block, flags=re.MULTILINE), *blocks[k + 1 :]]
            continue
        home = material if block.startswith("# Every element") else k
        for example in re.findall(r"^# +(\S+ = .*)$", block, re.MULTILINE):
            key = example.partition(" = ")[0]
            kept = [line for line in blocks[home].splitlines() if not line.startswith(f"{key} = ")]
            more = ['open_boundary = "rim"'] if key == "applied_field" else []
            yield example, [*blocks[:home], "\n".join([*kept, example, *more]), *blocks[home + 1 :]]


@pytest.mark.parametrize("name", ["c_core", "motor", "actuator_1"])
def test_every_example_that_init_writes_is_a_case(name, tmp_path):
    assert run_command("init", EXAMPLES / f"{name}.msh", "--scale", "1e-3", "-o", tmp_path / "m.toml") == 0
    text = (tmp_path / "m.toml").read_text().replace("# outer = 0.0", "outer = 0.0")
    found = list(uncommented(text))
    assert len(found) >= 50
    for example, blocks in found:
        given = tomllib.loads("\n\n".join(blocks))
        assert case_of(given, tmp_path).base_problem is not None, example


# A square has no thin part and no circle, and nothing in it turns; it is not drawn; an output is another key.
ELSEWHERE = (
    "mesh = {drawing",
    *("open_boundary", "applied_field", "periodic", "curves", "layers", "# [turn]", "output_rtol"),
    *("goal_rtol", "max_nodes"),  # with a goal, or with a tolerance
)


def test_examples_are_about_the_names_and_places_of_the_mesh(tmp_path):
    ka.write_mesh(tmp_path / "m.msh", drawn())
    assert run_command("init", tmp_path / "m.msh") == 0
    refused = []
    text = (tmp_path / "m.toml").read_text().replace("# left = 0.0", "left = 0.0")
    for example, blocks in uncommented(text.replace("\nrtol = ", "\n# rtol = ")):  # a goal has goal_rtol
        try:
            fitting_mesh(case_of(tomllib.loads("\n\n".join(blocks)), tmp_path))
        except ValueError:
            refused.append(example)
    assert [example for example in refused if not example.startswith(ELSEWHERE)] == []


MAKERS = (LAWS, PATTERNS, QUANTITIES, GOALS, SHAPES, MOTIONS)


def test_the_template_has_every_key(tmp_path):
    shutil.copy(EXAMPLES / "c_core.msh", tmp_path)
    assert run_command("init", tmp_path / "c_core.msh", "--scale", "1e-3") == 0
    in_space = resources.files("kohonen_adapt.cases").joinpath("template_in_space.toml").read_text(encoding="utf-8")
    said = set(re.findall(r"\w+", (tmp_path / "c_core.toml").read_text() + in_space))
    named = {name for table in MAKERS for name in table}
    assert {"mesh", "scale", "rim", "turn", "outputs", *PROBLEM, *ADAPT, *named} <= said


# No argument is forgotten.

LISTED = re.findall(
    r"^\| `(\w+)\(([\w=, ]+)\)` \| (all)?", (EXAMPLES / "README.md").read_text(encoding="utf-8"), re.MULTILINE
)
MATERIAL = {"permeability", "remanence", "current_density", "bh", "coercivity"}
CALLS = {
    "adapt": (ka.adapt, {"mesh", *ADAPT, "outputs"}),
    "Magnetostatics": (Magnetostatics, {"materials", *PROBLEM}),
    "Material": (Material, MATERIAL),
}


def listed(call, wholly):
    """Arguments of a call that the README lists as Python's, all of each or not."""
    rows = [names for made, names, all_of in LISTED if made == call and bool(all_of) == wholly]
    return set(re.findall(r"\w+", " ".join(rows)))


def open_ended(annotation):
    """Whether an argument of that type may be a function, or an object that people make classes of."""
    parts = get_args(annotation)
    if annotation is Callable or get_origin(annotation) is Callable or getattr(annotation, "_is_protocol", False):
        return True
    return any(map(open_ended, parts))


@pytest.mark.parametrize("call", CALLS)
def test_every_argument_is_a_key_or_is_listed_as_one_of_python(call):
    make, keys = CALLS[call]
    arguments = {name: each.annotation for name, each in inspect.signature(make).parameters.items()}
    assert keys <= set(arguments)
    assert listed(call, wholly=True) == set(arguments) - keys
    assert {name for name in keys if open_ended(arguments[name])} <= listed(call, wholly=False) <= keys


def test_every_goal_is_one_of_cases():
    public = {getattr(magnetostatics, name) for name in magnetostatics.__all__}
    goals = {kind for kind in public if inspect.isclass(kind) and kind is not Goal and hasattr(kind, "derivative")}
    assert goals == set(GOALS.values())
    assert [goal.unit for goal in GOALS.values()] == ["N", "N m", "Wb", "J", "T"]
