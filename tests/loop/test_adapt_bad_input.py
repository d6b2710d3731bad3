"""What the loop refuses, and what it then says."""

import re

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt import Status, adapt

MESH = MeshTri().refined(2)
ELEMENTS = MESH.nelements


class Constant:
    """A problem whose indicators are given, on every mesh or from a pass on."""

    def __init__(self, values=None, from_pass=0):
        self.values, self.from_pass = values, from_pass
        self.solves = 0

    def solve(self, mesh):
        self.solves += 1
        return self.solves - 1

    def indicators(self, mesh, solution):
        if self.values is None or solution < self.from_pass:
            return np.ones(mesh.nelements)
        return self.values


def refused(message, mesh=MESH, problem=None, **arguments):
    problem = problem or Constant()
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        adapt(mesh, problem, **arguments)
    return problem


def with_(**attributes):
    problem = Constant()
    vars(problem).update(attributes)
    return problem


METHODS = "problem must have the methods solve(mesh) and indicators(mesh, solution);"
OF_PROBLEMS = [  # what is said, and the problem
    (f"{METHODS} object has no solve and no indicators.", object()),
    (f"{METHODS} Constant has no indicators.", with_(indicators=None)),
    ("problem must be an object, Constant(...); got the class Constant.", Constant),
    ("norm of the problem must be 'energy' or 'L2'; got 'H1'.", with_(norm="H1")),
    ("calibrated of the problem must be True or False; got 3.6.", with_(calibrated=3.6)),
    *(
        (
            "order of the problem must be the degree of its elements, from 1 to 4 or within its orders; "
            f"got {order!r}.",
            with_(order=order),
        )
        for order in (0, 1.5, 5, "1", True)
    ),
    ("curved of the problem must be True, False or None; got 1.", with_(curved=1)),
    *(
        (
            "orders of the problem must be the lowest and the highest degree of its elements, (1, 4) for instance, or "
            f"None; got {orders}.",
            with_(orders=orders),
        )
        for orders in ((4, 1), (0, 2), 4, (1, 2.5))
    ),
    *(
        (
            f"energy_norm of the problem must be a finite number >= 0; got {value}.",
            with_(energy_norm=lambda mesh, solution, value=value: value),
        )
        for value in (-1.0, np.nan, np.inf)
    ),
]


@pytest.mark.parametrize(("message", "problem"), OF_PROBLEMS)
def test_problems(message, problem):
    refused(message, problem=problem)


NOT_TOLERANCES = [-1e-3, float("nan"), float("inf"), "1e-3"]
OF_OPTIONS = [  # what is said before anything is solved, and the options
    *((f"passes must be an integer >= 0; got {each!r}.", {"passes": each}) for each in (-1, 1.5, 4.0, "4", True)),
    *((f"seed must be an integer >= 0; got {each!r}.", {"seed": each}) for each in (-1, 0.5, None, "a")),
    *(
        (f"{name} must be a finite number >= 0, or None; got {each!r}.", {name: each, "outputs": {"force": abs}})
        for name in ("rtol", "atol", "output_rtol")
        for each in NOT_TOLERANCES
    ),
    *(
        (f"{hook} must be a function of {what}, or None; got 3.", {hook: 3})
        for hook, what in (
            ("callback", "the pass"),
            ("interim", "the result so far"),
            ("progress", "number and step"),
        )
    ),
    *(
        (f"checkpoint must be the path of a folder, or None; got {each!r}.", {"checkpoint": each})
        for each in (3, True, ["folder"], b"folder")
    ),
    *(
        (f"polish must be True or False; got {each!r}. kohonen_adapt.polish polishes without a map.", {"polish": each})
        for each in (None, 8, "yes")
    ),
    *(
        (f"anisotropic must be 'auto', True or False; got {each!r}.", {"anisotropic": each})
        for each in (0.5, "yes", None)
    ),
    *(
        (f"target_nodes must be an integer >= 0, or None; got {each!r}.", {"target_nodes": each})
        for each in (100.0, True, "many", -1)
    ),
    *(
        (
            "target_nodes must be at least the number of nodes of the mesh, 25; "
            f"got {each}. Start from a coarser mesh.",
            {"target_nodes": each},
        )
        for each in (0, 24)
    ),
    *(
        (f"max_nodes must be at least the nodes of the mesh, 25; got {each}.", {"max_nodes": each, "atol": 0.1})
        for each in (3, 1e6)
    ),
    *(
        (
            "max_nodes needs a tolerance (rtol or atol) and no target_nodes, which fixes the number.",
            {"max_nodes": 500, **more},
        )
        for more in ({}, {"atol": 0.1, "target_nodes": 400})
    ),
    (
        "goal_rtol requires a problem with a goal and its goal_error; use rtol or output_rtol instead.",
        {"goal_rtol": 0.1},
    ),
    ("a tolerance of 0 is never met; give one above 0, for instance rtol=1e-3, or target_nodes.", {"atol": 0.0}),
    ("output_rtol has 'b', which is no output; outputs are 'a'.", {"outputs": {"a": abs}, "output_rtol": {"b": 0.1}}),
    (
        "output_rtol['a'] must be a finite number >= 0, or None; got -0.1.",
        {"outputs": {"a": abs}, "output_rtol": {"a": -0.1}},
    ),
    (
        "rtol requires the energy norm of the problem, but Constant has no method energy_norm(mesh, solution). "
        "Use atol instead.",
        {"rtol": 0.01},
    ),
    ("outputs must map names to functions of the solution, or be None; got 'force'.", {"outputs": "force"}),
    ("the names of outputs must be strings; got 3.", {"outputs": {3: abs}}),
    ("outputs['force'] must be a function of the solution; got 1.0.", {"outputs": {"force": 1.0}}),
    *(
        ("output_rtol requires outputs; add outputs={name: function}.", {"outputs": each, "output_rtol": 0.01})
        for each in (None, {})
    ),
]


@pytest.mark.parametrize(("message", "options"), OF_OPTIONS)
def test_options(message, options):
    assert refused(message, **options).solves == 0


def test_numpy_numbers_are_numbers():
    result = adapt(MESH, Constant(), passes=np.int64(0), atol=np.float32(1e9), seed=np.uint8(3))
    assert result.status is Status.CONVERGED


BROKEN = [
    (np.ones(81), "indicators of the problem must have shape (nelements,) = (32,); got (81,)."),
    (np.ones((1, ELEMENTS)), "indicators of the problem must have shape (nelements,) = (32,); got (1, 32)."),
    (1.0, "indicators of the problem must have shape (nelements,) = (32,); got ()."),
    (
        np.r_[1.0, np.nan, np.inf, np.ones(ELEMENTS - 3)],
        "indicators of the problem must be finite; check the solution: got nan at element 1, 2 such elements.",
    ),
    (
        np.r_[np.ones(ELEMENTS - 1), -2.0],
        "indicators of the problem must be >= 0; take their absolute values: got -2.0 at element 31, 1 such elements.",
    ),
    (np.full(ELEMENTS, 1j), "indicators of the problem must be real numbers; got complex128."),
    (np.full(ELEMENTS, None), "indicators of the problem must be real numbers; got object."),
]


@pytest.mark.parametrize(("values", "message"), BROKEN)
def test_broken_indicators_of_the_input(values, message):
    refused(message, problem=Constant(values))


VALUES = [
    (np.nan, "outputs['force'] must return a finite number; got nan."),
    (-np.inf, "outputs['force'] must return a finite number; got -inf."),
    (None, "outputs['force'] must return a real number; got object."),
    ("3.0", "outputs['force'] must return a real number; got <U3."),
    (1j, "outputs['force'] must return a real number; got complex128."),
    (True, "outputs['force'] must return a real number; got bool."),
    (
        np.zeros(2),
        "outputs['force'] must return one number; got an array of shape (2,): "
        "return one component, or add an output for each component.",
    ),
]
LATER = [
    *((said, "estimate", Constant(values, from_pass=1), {}) for values, said in BROKEN),
    *(
        (said, "output 'force'", Constant(), {"force": lambda solution, value=value: value if solution else 1.0})
        for value, said in VALUES
    ),
]


@pytest.mark.parametrize(("said", "step", "problem", "outputs"), LATER)
def test_what_is_broken_later_ends_the_loop(said, step, problem, outputs):
    result = adapt(MESH, problem, polish=False, topology="flip", outputs=outputs)
    assert result.status is Status.FAILED and isinstance(result.error, ValueError)
    assert result.mesh is MESH and result.history[0].outputs == dict.fromkeys(outputs, 1.0)
    assert str(result.error) == said
    assert result.message == (
        f"Failed in pass 1, {step}: ValueError: {said.rstrip('.')}. "
        f"Best: the input, estimate {np.sqrt(ELEMENTS):.4g}. See `error`."
    )


@pytest.mark.parametrize("values", [[1] * ELEMENTS, np.ones(ELEMENTS, dtype=bool), np.ones(ELEMENTS, dtype=np.float32)])
def test_indicators_of_other_types_are_numbers_too(values):
    result = adapt(MESH, Constant(values), passes=0)
    assert result.indicators.dtype == np.float64
    assert result.estimate == pytest.approx(np.sqrt(ELEMENTS))


@pytest.mark.parametrize(("value", "message"), VALUES)
def test_an_output_of_the_input_that_is_no_number(value, message):
    refused(message, outputs={"force": lambda solution: value})
