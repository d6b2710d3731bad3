"""What a result says of its goal, of the pass that it is, and of a mesh that is not resolved."""

import re

import numpy as np
import pytest
from helpers.layer import Layer
from helpers.scalar_problems import Load
from helpers.stand_ins import MESH, Script, adapt, script_of
from skfem import Basis, ElementTriP1, MeshTri
from skfem.models.poisson import unit_load

import kohonen_adapt as ka
from kohonen_adapt.loop.figures import energy_error, pass_figures
from kohonen_adapt.loop.result import table_columns


class Pull(Script):
    """A script with a goal in newtons; where `trouble` is set its error cannot be estimated."""

    goal_unit = "N"
    trouble = None
    asked = 0

    def goal(self, solution):
        return (-133.4, -132.99999, -132.9)[solution]

    def goal_error(self, solution):
        self.asked += 1
        if self.trouble is not None:
            raise self.trouble
        return 0.0125


def pulled(**options):
    return adapt(MESH, Pull([4.0, 1.0, 2.0], calibrated=False), passes=2, topology="flip", **options)


def test_a_goal_its_error_and_their_sum_are_in_the_table_with_units():
    lines = [line[: line.index("  elements")] if "elements" in line else line for line in str(pulled()).splitlines()]
    head = lines[0].split("  ")
    assert [word.strip() for word in head if word][:7] == [
        "pass",
        "nodes",
        "estimate (N)",
        "change %",
        "Delta Energy %",
        "goal (N)",
        "error (N)",
    ]
    assert "goal + error (N)" in lines[0]
    assert "0.013" in lines[2] and "-132.987" in lines[2]
    assert "-133.400" in lines[1] and "-133.000" in lines[2] and "0.013" not in lines[1] + lines[3]


def test_an_output_of_unknown_error_beside_a_goal_is_named():
    outputs = {"b": script_of(1.0, 2.0), "c": script_of(1.0, 2.0)}
    result = adapt(MESH, Pull([4.0, 1.0], calibrated=False), passes=1, outputs=outputs)
    assert "The mesh is not adapted for 'b', 'c', and the error there is unknown." in result.message
    assert "not adapted" not in adapt(MESH, Script([4.0, 1.0]), passes=1, outputs=outputs).message


def test_the_estimate_of_a_goal_is_in_its_unit():
    """The sum of squared indicators is in the unit of the goal; its root means nothing to anybody."""
    result = pulled()
    assert dict(table_columns(result.history)[1])["estimate (N)"] == ["16.00", "1.000", "4.000"]
    assert "Best: pass 1, estimate 1 N." in result.message
    assert repr(result.history[0]).startswith("<Pass 0: estimate 16 N, ")


def test_the_tolerance_of_a_goal_is_said_in_its_unit():
    result = adapt(MESH, Pull([4.0, 1.0], calibrated=False), passes=2, atol=1.5)
    assert "after 1 pass: estimate 1 N within the tolerance 2.25 N (atol squared)." in result.message


@pytest.mark.parametrize("trouble", [np.linalg.LinAlgError("singular"), KeyboardInterrupt()])
def test_a_goal_whose_error_cannot_be_estimated_costs_no_result(trouble):
    problem = Pull([4.0, 1.0], calibrated=False)
    problem.trouble = trouble
    result = adapt(MESH, problem, passes=1)
    assert result.best.goal == -132.99999 and result.best.goal_error is None
    if isinstance(trouble, KeyboardInterrupt):
        assert result.status is ka.Status.STOPPED and result.message.startswith("Stopped by Ctrl-C after 1 pass.")
    else:
        assert result.message.endswith(" The error of the goal could not be estimated: LinAlgError: singular.")


@pytest.mark.parametrize(
    ("last", "norms"), [(0.05, ["40.00", "0.50"]), (0.002, ["40.00", "0.02"]), (0.00012345, ["40.0000", "0.0012"])]
)
def test_the_error_of_the_energy_is_the_square_of_that_of_the_norm(last, norms):
    """Small errors have two digits."""
    history = adapt(MESH, Script([4.0, last]), passes=1).history
    assert [energy_error(step) for step in history] == pytest.approx([16.0, last**2])
    columns = dict(table_columns(history)[1])
    assert columns["Energy-norm error %"] == norms
    assert last < 0.05 or columns["Energy error %"] == ["16.0000", "0.0025"]


# ---- which pass is the result, and whether its mesh is resolved ----


class Poisson(Load):
    """-lap u = 1 on the unit square, with the estimate of pass k multiplied by the k-th factor."""

    def __init__(self, *factors):
        super().__init__(factors=factors, solved=0, calibrated=True)

    def solve(self, mesh):
        self.solved += 1
        return self.factors[self.solved - 1], super().solve(mesh)

    def indicators(self, mesh, solution):
        one = np.ones(mesh.nelements)
        return solution[0] * ka.estimators.recovery(mesh, solution[1], one, source=one)

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution[1] @ unit_load.assemble(Basis(mesh, ElementTriP1()))))

    def ritz(self, mesh, solution):
        return super().ritz(mesh, solution[1])


LARGER = " The functional is lowest in pass 1, although the input has the least estimate ({first:.4g})."
DISAGREE = (
    " Functional and estimate disagree: pass 1 has the lowest functional, but {ratio:.2g} times the estimate of the "
    "input ({first:.4g}). Compare both passes"
)
UNRESOLVED = (
    " The mesh does not resolve the solution: the error of the pass before was {error:.2g} times its estimate, and "
    "this error may exceed its estimate as much. Increase `passes` or `target_nodes`."
)


@pytest.mark.parametrize(
    ("factors", "calibrated", "said"),
    [
        ((1.0, 1.0), True, ()),
        ((1.0, 2.0), True, (LARGER, UNRESOLVED)),
        ((1.0, 8.0), True, (DISAGREE, UNRESOLVED)),
        ((0.5, 0.5), True, (UNRESOLVED,)),  # the functional fell by more than the estimate of the pass before allows
        ((0.5, 0.5), False, ()),
    ],
)
def test_functional_and_estimate_are_compared_in_words(factors, calibrated, said):
    problem = Poisson(*factors)
    problem.calibrated = calibrated
    result = ka.adapt(MeshTri().refined(3), problem, passes=1)
    first, best = result.history
    assert result.best is best
    error = np.sqrt(2.0 * (first.functional - best.functional) + best.estimate**2) / first.estimate
    for each in (LARGER, DISAGREE, UNRESOLVED):
        sentence = each.format(first=first.estimate, ratio=best.estimate / first.estimate, error=error)
        assert (sentence in result.message) == (each in said)
    assert said or not re.search("unctional|not resolve", result.message)


def test_a_tolerance_is_not_met_by_an_estimate_that_falls_less_than_the_functional():
    """Half of the error is told: the loop goes on until twice the estimate is within the tolerance."""
    mesh = MeshTri().refined(3)
    result = ka.adapt(mesh, Poisson(*[0.5] * 20), rtol=0.05)
    assert result.status is ka.Status.CONVERGED
    unresolved = [step.estimate < 0.05 * step.energy_norm for step in result.history[1:-1]]
    assert any(unresolved)


def test_nothing_is_said_of_a_polish_that_was_not_needed():
    class Met(Layer):
        ritz = None

    message = ka.adapt(MeshTri().refined(2), Met(20.0), atol=1e9).message
    assert message.startswith("Converged after 0 passes") and "polish" not in message.lower()


def test_axes_of_a_problem_around_an_axis_are_r_and_z():
    plotting = pytest.importorskip("kohonen_adapt.plotting")
    mesh = MeshTri().refined(2)
    drawn = plotting.plot_density(mesh, np.ones(32), axisymmetric=True, unit="mm")
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("r (mm)", "z (mm)")
    assert plotting.plot_outlines(mesh, axisymmetric=True).get_xlabel() == "r (m)"


def test_pictures_of_a_goal_have_its_unit():
    plotting = pytest.importorskip("kohonen_adapt.plotting")
    axes = plotting.plot_convergence({"passes": pulled().history}, slope=-1.0)
    assert axes.get_ylabel() == "estimate (N)" and axes.get_title() == "Estimate over nodes"
    assert axes.get_lines()[0].get_ydata() == pytest.approx([16.0, 1.0, 4.0])


def test_a_pass_knows_how_far_its_curves_are_from_their_facets():
    circle = MeshTri.init_circle(3).with_defaults()
    result = adapt(circle, Script([2.0, 1.0]), passes=1)
    turn = 2.0 * np.pi / len(circle.boundary_facets())
    assert result.history[0].sagitta == pytest.approx(1.0 - np.cos(turn / 2.0))
    assert pass_figures(result.best)["sagitta"] > 0.0
