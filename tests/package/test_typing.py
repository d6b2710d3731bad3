"""A type checker finds nothing in a user's program where it is right, and the place where it is not."""

import re

import pytest
from helpers.places import ROOT
from helpers.processes import python

PROGRAM = """
import numpy as np
from numpy.typing import NDArray

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Brauer, Field, Force, Magnetostatics, Material, lorentz_force, read_bh

mesh = ka.read_mesh("c_core.msh", scale=1e-3)
steel = Material(bh=Brauer(k1=50.0, k2=10.0, k3=1.5))
problem = Magnetostatics(
    {"iron": steel, "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)), "air": Material()},
    potential={"outer": 0.0},
    goal=Force("iron", (0.0, 1.0)),
)


def pull(field: Field) -> float:
    return float(field.force("iron")[1])


def after(step: ka.Pass) -> bool:
    return step.estimate < 1e-3


schedule = ka.Schedule((ka.Stage(2, 3, (0.3, 0.02)),), sweeps=4)
result: ka.AdaptResult = ka.adapt(
    mesh, problem, passes=2, schedule=schedule, outputs={"pull": pull}, callback=after, pinned=["iron", 3]
)
finished: bool = result.status is ka.Status.CONVERGED
indicators: NDArray[np.float64] = result.indicators
density: NDArray[np.float64] = ka.density_from_indicators(mesh, indicators)
coarser: NDArray[np.float64] = ka.density_from_sizes(mesh, np.full(10, 1e-3))
mesh = ka.relocate(mesh, density, topology="recycle", curves={"outer": ka.Arc((0.0, 0.0), 0.1)}, layers={"air": 2})
mesh = ka.relocate(mesh, lambda x: 1.0 + x[0], schedule=ka.Schedule.paper())
som = ka.KohonenMap(mesh, topology="fixed")
errors: list[float] = list(som.train(np.zeros((2, 5))))
worst: float = ka.quality(som.mesh).min()
smoother = ka.polish(mesh, problem, sweeps=4)
field = problem.solve(mesh)
ritz = ka.Ritz(values=field.potential, fixed=np.zeros(9, dtype=bool), coefficient=1.0)
carried: NDArray[np.float64] = ka.interpolate(mesh, field.potential, np.zeros((2, 3)))
found: NDArray[np.integer] = ka.find_elements(mesh, np.zeros((2, 3)))
eta: NDArray[np.float64] = ka.estimators.residual(mesh, field.potential, field.reluctivity)
bound: NDArray[np.float64] = ka.estimators.recovery(mesh, field.potential, field.reluctivity)
push: NDArray[np.float64] = lorentz_force(field, "coil")
curve = read_bh("steel.csv")
ka.write_mesh("out.vtu", mesh, point_data={"A": field.potential}, cell_data={"B": field.flux_density})


class Own:
    def solve(self, mesh: object) -> NDArray[np.float64]:
        return np.zeros(3)

    def indicators(self, mesh: object, solution: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.zeros(3)


ka.adapt(mesh, Own(), passes=1)
"""


WRONG = {
    "ka.relocate(mesh, density, min_quality='good')": """expected "float | Literal['auto']\"""",
    "ka.adapt(mesh, problem, passes=1.5)": '"float"; expected "int | None"',
    "ka.adapt(mesh, object())": 'expected "Problem"',
    "Material(permeability='iron')": '"str"; expected "float"',
    "ka.Stage('wide', 3, 0.3)": '"str"; expected "int"',
    "som.train([[0.5], [0.5]], seed='one')": '"str"; expected "int"',
    "result.estimat": 'has no attribute "estimat"',
    "ka.adapt(mesh, problem, passe=2)": 'Unexpected keyword argument "passe"',
}


FIRST_WRONG = PROGRAM.count("\n") + 2  # its line; mypy counts from 1


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What mypy says of a program that uses the package, by line; the package's own files are judged elsewhere.

    Run it once and without its cache. From a cache it takes modules of the same name in another copy of the package,
    such as an editable install of another checkout, for modules of this one, and they hide functions of their name.
    """
    pytest.importorskip("mypy")
    folder = tmp_path_factory.mktemp("typed")
    (folder / "program.py").write_text("\n".join([PROGRAM, *WRONG]), encoding="utf-8")
    strict = ["--strict", "--follow-imports=silent", "--config-file=", "--no-error-summary", "--no-incremental"]
    done = python("-m", "mypy", *strict, "program.py", cwd=folder, status=1, MYPYPATH=str(ROOT))
    assert not done.stderr, done.stdout + done.stderr
    complaints = re.findall(r"^program\.py:(\d+): error: (.*)$", done.stdout, re.MULTILINE)
    return [(int(line), text) for line, text in complaints]


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "kohonen_adapt" / "py.typed").is_file()


@pytest.mark.slow
def test_a_program_passes_the_strict_check(said):
    assert [complaint for complaint in said if complaint[0] < FIRST_WRONG] == []


@pytest.mark.slow
@pytest.mark.parametrize(("number", "call"), list(enumerate(WRONG, FIRST_WRONG)))
def test_wrong_arguments_are_refused_each_in_its_line(said, number, call):
    assert any(line == number and WRONG[call] in text for line, text in said), said
