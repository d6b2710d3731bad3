"""A run that has stalled says where an output became worse, as better values show."""

import re

import numpy as np
import pytest
from helpers.devices import turned_magnet, two_magnets
from helpers.stand_ins import MESH, Script, adapt

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Torque


class Improved(Script):
    """A script that has better values of its outputs, those of a better solution."""

    better = 2.25

    def improved(self, mesh, solution, outputs):
        if isinstance(self.better, BaseException):
            raise self.better
        return {name: output(self.better) for name, output in outputs.items()}


def stalled(better, outputs):
    problem = Improved([4.0, 2.0, 3.0, 3.0])
    problem.better = better
    result = adapt(MESH, problem, passes=9, outputs=outputs)
    assert (result.status, result.best.number) == (ka.Status.STALLED, 1)
    return result.message


def pull(solution):
    """2 on the first mesh, 1 on the second; of the better solution what that is."""
    return solution if isinstance(solution, float) else 2.0 - solution


def test_what_became_worse_is_named_with_how_far_it_is_off():
    assert stalled(2.25, {"pull": pull, "push": lambda solution: 1.0}).endswith(
        " The mesh is better for the energy, but worse for outputs: error of 'pull' about 1.2 (input 0.25). To reduce "
        "the error of an output, use it as the goal of the problem."
    )


@pytest.mark.parametrize(
    ("better", "outputs"),
    [
        (1.25, {"pull": pull}),  # nearer than the input's
        (1.52, {"pull": pull}),  # farther, but by less than the better solution may itself be off
        (2.25, {"pull": lambda solution: pull(solution) - 2.2}),  # 0.05 but for errors
        (2.25, None),
        (ka.NotOffered("it has none"), {"pull": pull}),
        (np.linalg.LinAlgError("singular"), {"pull": pull}),
        (KeyboardInterrupt(), {"pull": pull}),
    ],
)
def test_nothing_is_said_where_nothing_shows_it(better, outputs):
    assert stalled(better, outputs).endswith("Use more nodes (`target_nodes`) for a smaller error.")


@pytest.mark.parametrize("degrees", [65.0, 90.0])
def test_a_torque_that_is_worse_than_the_inputs_is_told(degrees):
    """In a uniform field it is sin(angle): 0.17 % off on the input, 0.24 to 0.28 % on the mesh for the energy."""
    mesh, problem = turned_magnet(16, degrees)
    result = ka.adapt(mesh, problem, passes=12, outputs={"torque": Torque("magnet")})
    exact = 50.0 * np.sin(np.deg2rad(degrees))
    before, now = (abs(step.outputs["torque"] - exact) for step in (result.history[0], result.best))
    assert result.status is ka.Status.STALLED
    assert now > 1.25 * before
    said = re.search(r"error of 'torque' about (\S+) \(input (\S+)\)\. .* the goal", result.message)
    assert [float(each) for each in said.groups()] == pytest.approx([now, before], rel=0.1)


def test_a_force_that_is_better_is_not():
    mesh, problem = two_magnets(1)
    result = ka.adapt(mesh, problem, passes=12, outputs={"force": lambda field: field.force("b")[0]})
    assert result.status is ka.Status.STALLED
    assert "goal" not in result.message
