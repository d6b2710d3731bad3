"""What a type checker says to a user's program: nothing where it is right, and the place where it is not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

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


def said_of(program, folder):
    """What mypy prints of a program that uses the package, whose own files are judged elsewhere."""
    (folder / "program.py").write_text(program, encoding="utf-8")
    strict = ["--strict", "--follow-imports=silent", "--config-file=", "--no-error-summary"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *strict, f"--cache-dir={folder / 'cache'}", "program.py"],
        cwd=folder,
        env={**os.environ, "MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    pytest.importorskip("mypy")
    return tmp_path_factory.mktemp("typed")


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "kohonen_adapt" / "py.typed").is_file()


def test_a_program_passes_the_strict_check(folder):
    assert said_of(PROGRAM, folder) == (0, "")


WRONG = {
    "ka.relocate(mesh, density, min_quality='good')": '"str"; expected "float"',
    "ka.adapt(mesh, problem, passes=1.5)": '"float"; expected "int"',
    "ka.adapt(mesh, object())": 'expected "Problem"',
    "Material(permeability='iron')": '"str"; expected "float"',
    "ka.Stage('wide', 3, 0.3)": '"str"; expected "int"',
    "som.train([[0.5], [0.5]], seed='one')": '"str"; expected "int"',
    "result.estimat": 'has no attribute "estimat"',
    "ka.adapt(mesh, problem, passe=2)": 'Unexpected keyword argument "passe"',
}


def test_wrong_arguments_are_refused_each_in_its_line(folder):
    code, said = said_of("\n".join([PROGRAM, *WRONG]), folder)
    assert code == 1
    first = PROGRAM.count("\n") + 2
    for number, (call, complaint) in enumerate(WRONG.items(), first):
        lines = [line for line in said.splitlines() if line.startswith(f"program.py:{number}: error")]
        assert any(complaint in line for line in lines), (call, said)
