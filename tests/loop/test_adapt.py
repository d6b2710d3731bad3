"""The loop: what it gives back, how it ends, and what every ending says."""

import importlib
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from helpers.stand_ins import trained
from skfem import MeshTri

from kohonen_adapt.loop.adapt import adapt as adapt_and_polish
from kohonen_adapt.loop.result import AdaptResult, Status
from kohonen_adapt.outline.rules import Limits

MESH = MeshTri().refined(2)
NODES = MESH.p.shape[1]
ELEMENTS = MESH.t.shape[1]

IMPROVEMENT = importlib.import_module("kohonen_adapt.loop.step")


def adapt(*arguments, **options):
    """The loop without its polish, which these problems cannot have."""
    return adapt_and_polish(*arguments, polish=False, **options)


@dataclass
class Script:
    """A problem whose k-th mesh has the k-th estimate, spread evenly; an exception in its place is raised."""

    estimates: list
    energy: float = 10.0
    calls: list = field(default_factory=list)

    def solve(self, mesh):
        number = len(self.calls)
        self.calls.append(mesh)
        if isinstance(self.estimates[number], BaseException):
            raise self.estimates[number]
        return number

    def indicators(self, mesh, solution):
        return np.full(mesh.t.shape[1], self.estimates[solution] / np.sqrt(mesh.t.shape[1]))

    def energy_norm(self, mesh, solution):
        return self.energy


class Mover:
    """In place of the map: moves one node a little, or says why it does not."""

    def __init__(self, moved=1, message=""):
        self.moved, self.message = moved, message
        self.calls = []

    def __call__(self, mesh, density, **settings):
        self.calls.append((mesh, density, settings))
        p = mesh.p.copy()
        if self.moved:
            p[:, 12] += 1e-3
        return trained(MeshTri(p, mesh.t), (0.2, 0.1), 1e-3 * bool(self.moved), self.moved, self.message)


@pytest.fixture
def mover(monkeypatch):
    fake = Mover()
    monkeypatch.setattr(IMPROVEMENT, "trained_map", fake)
    return fake


def estimates(result):
    return [step.estimate for step in result.history]


# ---- what comes back ----


def test_passes_count_relocations_and_the_last_mesh_is_solved_too(mover):
    problem = Script([4.0, 3.0, 2.0, 1.0])
    result = adapt(MESH, problem, passes=3)
    assert isinstance(result, AdaptResult)
    assert (len(mover.calls), len(problem.calls), len(result.history)) == (3, 4, 4)
    assert [step.number for step in result.history] == [0, 1, 2, 3]
    np.testing.assert_allclose(estimates(result), [4.0, 3.0, 2.0, 1.0])
    assert result.history[0].mesh is MESH
    assert result.mesh is result.history[3].mesh is problem.calls[3]
    assert result.solution == 3
    assert result.indicators.shape == (ELEMENTS,)
    assert result.estimate == pytest.approx(1.0)
    assert result.error is None
    assert result.status is Status.MAX_PASSES
    assert result.message == (
        "All passes asked for (3) are done; the result is pass 3 (estimate 1), ask for more to go on."
    )


def test_nodes_are_those_of_the_input(mover):
    np.testing.assert_array_equal(adapt(MESH, Script([2.0, 1.0]), passes=1).nodes, np.arange(NODES))


def test_the_best_pass_comes_back_not_the_last(mover):
    result = adapt(MESH, Script([4.0, 3.0, 1.0, 2.0]), passes=3)
    assert result.mesh is result.history[2].mesh
    assert result.solution == 2
    assert result.estimate == pytest.approx(1.0)
    assert result.indicators == pytest.approx(np.full(ELEMENTS, 1.0 / np.sqrt(ELEMENTS)))
    assert "the result is pass 2 (estimate 1)" in result.message


def test_never_worse_than_the_input(mover):
    result = adapt(MESH, Script([1.0, 2.0]), passes=1)
    assert result.mesh is MESH
    assert result.solution == 0
    assert result.message == (
        "All passes asked for (1) are done; the result is the input (estimate 1), ask for more to go on."
    )


def test_of_equal_passes_the_first_comes_back(mover):
    assert adapt(MESH, Script([1.0, 1.0]), passes=1).mesh is MESH


def test_a_pass_describes_its_mesh_and_the_relocation_that_made_it(mover):
    first, second = adapt(MESH, Script([2.0, 1.0]), passes=1).history
    assert (first.quantization_errors, first.max_displacement) == ((), 0.0)
    assert (second.quantization_errors, second.max_displacement) == ((0.2, 0.1), 1e-3)
    assert first.energy_norm == second.energy_norm == 10.0
    assert 0.0 < first.min_quality <= first.mean_quality <= 1.0
    assert set(first.seconds) == set(second.seconds) == {"solve", "estimate", "relocate", "polish"}
    assert first.seconds["relocate"] == 0.0 < second.seconds["relocate"]
    assert min(first.seconds["solve"], first.seconds["estimate"], second.seconds["solve"]) > 0.0


def test_no_energy_norm_is_none(mover):
    class Bare:
        solve = Script([1.0]).solve

        def indicators(self, mesh, solution):
            return np.ones(ELEMENTS)

    assert adapt(MESH, Bare(), passes=0).history[0].energy_norm is None


def test_indicators_are_kept_even_if_the_problem_reuses_its_array(mover):
    class Reusing(Script):
        buffer = np.empty(ELEMENTS)

        def indicators(self, mesh, solution):
            self.buffer[:] = super().indicators(mesh, solution)
            return self.buffer

    result = adapt(MESH, Reusing([1.0, 2.0]), passes=1)
    assert np.linalg.norm(result.indicators) == pytest.approx(1.0)


def test_tiny_and_huge_indicators_are_not_lost(mover):
    assert adapt(MESH, Script([1e-200]), passes=0).estimate == pytest.approx(1e-200)
    assert adapt(MESH, Script([1e200]), passes=0).estimate == pytest.approx(1e200)


def test_the_input_is_not_modified(mover):
    mesh = MeshTri().refined(2)
    adapt(mesh, Script([2.0, 1.0]), passes=1)
    np.testing.assert_array_equal(mesh.p, MESH.p)
    np.testing.assert_array_equal(mesh.t, MESH.t)


# ---- what the map is asked ----


def test_the_settings_reach_the_map(mover):
    adapt(MESH, Script([2.0, 1.0]), passes=1, topology="fixed", min_quality=0.2, pinned=(7, 3))
    mesh, density, settings = mover.calls[0]
    assert mesh is MESH
    assert density.shape == (ELEMENTS,)
    del settings["seed"]
    assert settings == {"schedule": None, "limits": Limits("fixed", 0.2, (7, 3)), "target": NODES}


def test_an_iterator_of_pinned_nodes_lasts_for_every_pass(mover):
    adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, pinned=iter([7, 3]))
    assert [call[2]["limits"].pinned for call in mover.calls] == [(7, 3)] * 2


def test_the_default_topology_recycles(mover):
    adapt(MESH, Script([2.0, 1.0]), passes=1)
    assert mover.calls[0][2]["limits"].topology == "recycle"


def test_every_pass_starts_from_the_mesh_before_it(mover):
    result = adapt(MESH, Script([1.0, 2.0, 3.0]), passes=2)
    assert [call[0] for call in mover.calls] == [step.mesh for step in result.history[:2]]


def test_every_pass_has_a_seed_of_its_own_and_the_same_one_next_time(mover):
    for seed in (0, 0, 1):
        adapt(MESH, Script([4.0, 3.0, 2.0]), passes=2, seed=seed)
    seeds = [call[2]["seed"] for call in mover.calls]
    assert seeds[:2] == seeds[2:4]
    assert len({*seeds}) == 4
    assert all(type(seed) is int for seed in seeds)


def test_order_and_norm_reach_the_density(mover, monkeypatch):
    asked = []

    def density(mesh, indicators, *, order, norm):
        asked.append((order, norm))
        return indicators

    monkeypatch.setattr(IMPROVEMENT, "density_from_indicators", density)
    problem = Script([2.0, 1.0])
    adapt(MESH, problem, passes=1)
    problem = Script([2.0, 1.0])
    problem.order, problem.norm = 2, "L2"
    adapt(MESH, problem, passes=1)
    assert asked == [(1, "energy"), (2, "L2")]


def test_a_warm_start_from_the_second_solve_on(mover):
    class Warm(Script):
        def solve_from(self, mesh, old_mesh, old_solution):
            starts.append((mesh, old_mesh, old_solution))
            return self.solve(mesh)

    starts = []
    result = adapt(MESH, Warm([3.0, 1.0, 2.0]), passes=2)
    meshes = [step.mesh for step in result.history]
    assert starts == [(meshes[1], meshes[0], 0), (meshes[2], meshes[1], 1)]


# ---- the norm of the error ----


def test_with_the_l2_norm_the_best_has_the_least_area_weighted_sum(monkeypatch):
    left, right = np.linspace(0.0, 0.5, 2), np.linspace(0.5, 1.0, 9)[1:]
    mesh = MeshTri.init_tensor(np.concatenate([left, right]), np.linspace(0.0, 1.0, 3))
    wide = np.mean(mesh.p[0][mesh.t], axis=0) < 0.5

    class Moving(Script):
        def indicators(self, mesh, solution):
            return np.where(wide, *((1.0, 0.0) if solution == 0 else (0.0, 0.9)))

    monkeypatch.setattr(IMPROVEMENT, "trained_map", Mover())
    problem = Moving([0, 0])
    by_energy = adapt(mesh, problem, passes=1)
    assert by_energy.mesh is mesh
    problem = Moving([0, 0])
    problem.norm = "L2"
    by_l2 = adapt(mesh, problem, passes=1)
    assert by_l2.mesh is by_l2.history[1].mesh
    assert by_l2.estimate == by_l2.history[1].estimate > by_l2.history[0].estimate


# ---- how it ends ----


def test_no_passes(mover):
    result = adapt(MESH, Script([1.0]), passes=0)
    assert result.mesh is MESH
    assert len(result.history) == 1
    assert not mover.calls
    assert result.status is Status.MAX_PASSES
    assert result.message == "The input was solved and estimated and nothing moved; ask for passes >= 1 to adapt it."


@pytest.mark.parametrize(
    ("tolerances", "number", "tolerance"),
    [({"atol": 2.0}, 2, "2"), ({"rtol": 0.3}, 1, "3"), ({"rtol": 0.1, "atol": 1.0}, 2, "2"), ({"atol": 5}, 0, "5")],
)
def test_converged_within_the_tolerance(mover, tolerances, number, tolerance):
    result = adapt(MESH, Script([4.0, 3.0, 2.0, 1.0]), passes=3, **tolerances)
    assert result.status is Status.CONVERGED
    assert len(result.history) == number + 1
    best = f"pass {number}" if number else "the input"
    assert result.message == (
        f"Converged: the estimate {4 - number} of pass {number} is within the tolerance {tolerance}; "
        f"the result is {best} (estimate {4 - number}), use it as it is."
    )


def test_a_tolerance_that_is_missed(mover):
    result = adapt(MESH, Script([4.0, 3.0]), passes=1, rtol=1e-3)
    assert result.status is Status.MAX_PASSES
    assert result.message == (
        "All passes asked for (1) are done without reaching the tolerance 0.01; "
        "the result is pass 1 (estimate 3), ask for more to go on."
    )


def test_a_tolerance_of_zero_is_a_tolerance(mover):
    assert adapt(MESH, Script([4.0, 3.0]), passes=1, atol=0.0).status is Status.MAX_PASSES


@pytest.mark.parametrize("number", [0, 1])
def test_indicators_that_are_all_zero_have_converged(mover, number):
    result = adapt(MESH, Script([1.0, 0.0][1 - number :]), passes=3)
    assert result.status is Status.CONVERGED
    assert len(result.history) == number + 1
    assert result.estimate == 0.0
    assert result.message == (f"Converged: every indicator of pass {number} is zero, so the mesh can be used as it is.")


@pytest.mark.parametrize(
    ("script", "length"),
    [
        ([4.0, 4.0, 4.0, 1.0], 3),
        ([4.0, 5.0, 4.5, 1.0], 3),
        ([4.0, 3.0, 3.1, 3.2, 1.0], 4),
        ([4.0, 3.9985, 3.9980, 1.0], 3),
    ],
)
def test_stalled_after_two_passes_without_gain(mover, script, length):
    result = adapt(MESH, Script(script), passes=9)
    assert result.status is Status.STALLED
    assert len(result.history) == length
    best = int(np.argmin(script[:length]))
    assert result.message == (
        "Stalled: the last 2 passes together gained no more than 0.1 %; "
        f"the result is {f'pass {best}' if best else 'the input'} (estimate {script[best]:.4g}), "
        "start from a mesh of more nodes for a smaller error."
    )


@pytest.mark.parametrize(
    "script", [[4.0, 5.0, 3.0, 3.5, 2.9], [4.0, 3.0, 3.0, 2.9, 2.9], [4.0, 3.997, 3.994, 3.991, 3.988]]
)
def test_one_pass_without_gain_is_no_stall(mover, script):
    assert adapt(MESH, Script(script), passes=4).status is Status.MAX_PASSES


def test_nothing_could_move(monkeypatch):
    fake = Mover(moved=0, message="every node is pinned.")
    monkeypatch.setattr(IMPROVEMENT, "trained_map", fake)
    problem = Script([1.0])
    result = adapt(MESH, problem)
    assert result.status is Status.NOT_MOVED
    assert (len(result.history), len(problem.calls)) == (1, 1)
    assert result.message == (
        "Nothing could move: every node is pinned; the result is the input (estimate 1), change that to go on."
    )


def test_a_mesh_that_only_flipped_is_solved_before_the_loop_ends(monkeypatch):
    flipped = MeshTri(np.array([[0.0, 1.0, 1.1, 0.0], [0.0, 0.0, 1.0, 1.0]]), np.array([[0, 0], [1, 1], [3, 2]]))
    square = MeshTri(flipped.p, np.array([[0, 0], [1, 2], [2, 3]]))
    monkeypatch.setattr(
        IMPROVEMENT,
        "trained_map",
        lambda *_, **__: trained(flipped, message="every node is on the outline"),
    )
    result = adapt(square, Script([2.0, 1.0, 0.5]), passes=5)
    assert result.status is Status.NOT_MOVED
    assert result.mesh is flipped
    assert result.message == (
        "Nothing could move: every node is on the outline; the result is pass 1 (estimate 1), change that to go on."
    )


def test_the_callback_hears_of_every_pass_in_order(mover):
    heard = []
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, callback=heard.append)
    assert tuple(heard) == result.history


def test_the_callback_hears_of_a_pass_before_the_next_begins(mover):
    problem = Script([3.0, 2.0, 1.0])
    seen = []
    adapt(MESH, problem, passes=2, callback=lambda step: seen.append((len(problem.calls), len(mover.calls))))
    assert seen == [(1, 0), (2, 1), (3, 2)]


@pytest.mark.parametrize("number", [0, 1])
def test_stopped_by_the_callback(mover, number):
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, callback=lambda step: np.bool_(step.number == number))
    assert result.status is Status.STOPPED
    assert len(result.history) == number + 1
    best = f"pass {number}" if number else "the input"
    assert result.message == (
        f"Stopped by the callback after pass {number}; the result is {best} (estimate {3 - number}), "
        "adapt it again to go on."
    )


def test_a_callback_that_returns_something_else_does_not_stop(mover):
    assert len(adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, callback=lambda step: "a.png").history) == 3


def test_convergence_goes_before_the_callback(mover):
    assert adapt(MESH, Script([3.0]), atol=3.0, callback=lambda step: True).status is Status.CONVERGED


def test_what_the_callback_raises_is_not_caught(mover):
    def callback(step):
        if step.number == 1:
            raise RuntimeError("disc full")

    with pytest.raises(RuntimeError, match="disc full"):
        adapt(MESH, Script([3.0, 2.0]), passes=1, callback=callback)


def test_ctrl_c_while_the_input_is_solved_propagates(mover):
    with pytest.raises(KeyboardInterrupt):
        adapt(MESH, Script([KeyboardInterrupt()]))


def test_ctrl_c_later_gives_the_best_so_far(mover):
    result = adapt(MESH, Script([3.0, 1.0, 2.0, KeyboardInterrupt()]), passes=5)
    assert result.status is Status.STOPPED
    assert len(result.history) == 3
    assert result.mesh is result.history[1].mesh
    assert result.solution == 1
    assert result.error is None
    assert result.message == (
        "Stopped by Ctrl-C after pass 2; the result is pass 1 (estimate 1), adapt it again to go on."
    )


def test_ctrl_c_in_the_map_or_in_the_callback_gives_the_best_so_far(monkeypatch, mover):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    assert adapt(MESH, Script([3.0]), callback=interrupt).status is Status.STOPPED
    monkeypatch.setattr(IMPROVEMENT, "trained_map", interrupt)
    assert adapt(MESH, Script([3.0])).status is Status.STOPPED


def test_an_exception_at_the_input_propagates(mover):
    with pytest.raises(ZeroDivisionError, match="singular"):
        adapt(MESH, Script([ZeroDivisionError("singular")]))


def test_a_later_exception_ends_the_loop_with_the_best_so_far(mover):
    error = ZeroDivisionError("singular.")
    error.__cause__ = OSError("underneath")
    result = adapt(MESH, Script([3.0, 2.0, error]), passes=5)
    assert result.status is Status.FAILED
    assert result.error is error
    assert isinstance(result.error.__cause__, OSError)
    assert result.error.__traceback__ is not None
    assert len(result.history) == 2
    assert result.solution == 1
    assert result.message == (
        "Failed in pass 2, solve: ZeroDivisionError: singular; the result is pass 1 (estimate 2), "
        "the exception is in error."
    )


@pytest.mark.parametrize(
    ("error", "said"), [(OSError("no licence.\nCall us."), "OSError: no licence"), (OSError(), "OSError")]
)
def test_a_failure_is_one_sentence_whatever_was_raised(mover, error, said):
    message = adapt(MESH, Script([3.0, error])).message
    assert message.startswith(f"Failed in pass 1, solve: {said}; the result is the input")


def test_an_exception_of_the_map_ends_the_loop_too(monkeypatch):
    def broken(*_, **__):
        raise MemoryError("no room")

    monkeypatch.setattr(IMPROVEMENT, "trained_map", broken)
    result = adapt(MESH, Script([3.0]))
    assert result.status is Status.FAILED
    assert result.message == (
        "Failed in pass 1, relocate: MemoryError: no room; the result is the input (estimate 3), "
        "the exception is in error."
    )


def test_status_is_a_word():
    assert [str(status) for status in Status] == [
        "converged",
        "max_passes",
        "stalled",
        "not_moved",
        "stopped",
        "failed",
    ]


# ---- outputs ----


def script_of(*values):
    """An output that has the k-th value on the k-th mesh; an exception in its place is raised."""

    def function(solution):
        if isinstance(values[solution], BaseException):
            raise values[solution]
        return values[solution]

    return function


def test_every_pass_carries_the_outputs(mover):
    outputs = {"force": script_of(1.0, 2, np.float32(2.5)), "twice": lambda solution: 2 * solution}
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, outputs=outputs)
    assert [step.outputs for step in result.history] == [
        {"force": 1.0, "twice": 0.0},
        {"force": 2.0, "twice": 2.0},
        {"force": 2.5, "twice": 4.0},
    ]
    assert all(type(value) is float for step in result.history for value in step.outputs.values())


def test_without_outputs_a_pass_carries_none(mover):
    assert adapt(MESH, Script([1.0]), passes=0).history[0].outputs == {}


@pytest.mark.parametrize(
    ("values", "tolerance", "number", "percent"),
    [
        ([1.0, 1.1, 1.1054], 0.005, 2, "0.5 %"),
        ([-2.0, -2.0], 0.0, 1, "0 %"),
        ([1.0, 2.0, 1.6], 0.25, 2, "25 %"),
        ([0.0, 0.0], 0.01, 1, "1 %"),
    ],
)
def test_converged_when_no_output_changes_any_more(mover, values, tolerance, number, percent):
    problem = Script([4.0, 3.0, 2.0, 1.0])
    result = adapt(MESH, problem, passes=3, outputs={"force": script_of(*values)}, output_rtol=tolerance)
    assert result.status is Status.CONVERGED
    assert result.message == (
        f"Converged: no output changed by more than {percent} in pass {number}; "
        f"the result is pass {number} (estimate {4 - number}), use it as it is."
    )


@pytest.mark.parametrize("values", [(1.0, 1.02, 1.04), (0.0, 1e-9, 2e-9), (1.0, -1.0, 1.0)])
def test_outputs_that_do_not_settle(mover, values):
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, outputs={"force": script_of(*values)}, output_rtol=0.01)
    assert result.status is Status.MAX_PASSES
    assert result.message == (
        "All passes asked for (2) are done without all outputs settling within 1 %; "
        "the result is pass 2 (estimate 1), ask for more to go on."
    )


def test_all_outputs_must_settle(mover):
    outputs = {"calm": script_of(1.0, 1.0, 1.0), "wild": script_of(1.0, 2.0, 2.0)}
    result = adapt(MESH, Script([4.0, 3.0, 2.0, 1.0]), passes=3, outputs=outputs, output_rtol=0.01)
    assert result.status is Status.CONVERGED
    assert len(result.history) == 3


@pytest.mark.parametrize(
    ("estimates", "values", "number"), [([4.0, 1.0, 0.9], (1.0, 2.0, 2.0), 2), ([4.0, 3.0, 1.0], (1.0, 1.0, 1.0), 2)]
)
def test_the_estimate_and_the_outputs_must_both_be_met(mover, estimates, values, number):
    problem = Script([*estimates, 0.5])
    result = adapt(MESH, problem, passes=3, atol=1.0, outputs={"force": script_of(*values)}, output_rtol=0.01)
    assert result.status is Status.CONVERGED
    assert result.message == (
        f"Converged: the estimate {estimates[number]:.4g} of pass {number} is within the tolerance 1 and no output "
        f"changed by more than 1 % in pass {number}; the result is pass {number} "
        f"(estimate {estimates[number]:.4g}), use it as it is."
    )


def test_both_missed(mover):
    options = {"atol": 1e-3, "outputs": {"force": script_of(1.0, 2.0)}, "output_rtol": 0.01}
    assert adapt(MESH, Script([3.0, 2.0]), passes=1, **options).message.startswith(
        "All passes asked for (1) are done without reaching the tolerance 0.001 and all outputs settling within 1 %; "
    )


def test_what_an_output_raises_at_the_input_propagates(mover):
    with pytest.raises(ZeroDivisionError, match="no current"):
        adapt(MESH, Script([1.0]), outputs={"force": script_of(ZeroDivisionError("no current"))})


def test_what_an_output_raises_later_ends_the_loop_with_the_best_so_far(mover):
    error = ZeroDivisionError("no current.")
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=5, outputs={"force": script_of(1.0, 2.0, error)})
    assert result.status is Status.FAILED
    assert result.error is error
    assert len(result.history) == 2
    assert result.solution == 1
    assert result.message == (
        "Failed in pass 2, output 'force': ZeroDivisionError: no current; the result is pass 1 (estimate 2), "
        "the exception is in error."
    )


# ---- the table ----


def timeless(result):
    """The result with every pass of the same duration."""
    return replace(result, history=tuple(replace(step, seconds={"solve": 1.5}) for step in result.history))


def test_the_table(mover):
    assert str(timeless(adapt(MESH, Script([4.0, 2.0, 3.0]), passes=2))).splitlines() == [
        "pass  nodes  estimate  change %  Energy Error %  Delta Energy %  elements  min quality  mean quality  seconds",
        "   0     25         4         -           40.00               -        32         0.87          0.87     1.50",
        "   1     25         2     -50.0           20.00           +0.00        32         0.86          0.87     1.50"
        "  <- result",
        "   2     25         3     +50.0           30.00           +0.00        32         0.86          0.87     1.50",
        "All passes asked for (2) are done; the result is pass 1 (estimate 2), ask for more to go on.",
    ]


def test_the_table_with_outputs_has_their_changes(mover):
    outputs = {"force": script_of(-2.0, -2.5, -2.4), "flux": script_of(0.0, 1.0, 1.23456789)}
    assert str(timeless(adapt(MESH, Script([4.0, 2.0, 3.0]), passes=2, outputs=outputs))).splitlines() == [
        "pass  nodes  estimate  change %  Energy Error %  Delta Energy %  force  Delta %    flux  Delta %",
        "   0     25         4         -           40.00               -     -2        -       0        -",
        "   1     25         2     -50.0           20.00           +0.00   -2.5   -25.00       1        -  <- result",
        "   2     25         3     +50.0           30.00           +0.00   -2.4    +4.00  1.2346   +23.46",
        "pass  elements  min quality  mean quality  seconds",
        "   0        32         0.87          0.87     1.50",
        "   1        32         0.86          0.87     1.50  <- result",
        "   2        32         0.86          0.87     1.50",
        "All passes asked for (2) are done; the result is pass 1 (estimate 2), ask for more to go on.",
    ]


@pytest.mark.parametrize("number", [0, 1, 2, 3, 8])
def test_the_table_fits_into_120_columns_and_has_every_output(mover, number):
    outputs = {f"output {k}": script_of(-1.23456789, -1.23456e-7) for k in range(number)}
    *rows, _message = str(adapt(MESH, Script([4.0, 2.0]), passes=1, outputs=outputs)).splitlines()
    assert max(map(len, rows)) <= 120
    titles = "  ".join(rows[::3])
    assert titles.count("Delta %") == number and all(name in titles for name in outputs)
    assert all(row.startswith(("pass  ", "   0  ", "   1  ")) for row in rows)


def test_delta_energy_is_the_change_of_the_squared_energy_norm(mover):
    class Rising(Script):
        def energy_norm(self, mesh, solution):
            return (10.0, 20.0, 10.0)[solution]

    title, *rows = str(adapt(MESH, Rising([4.0, 3.0, 2.0]), passes=2)).splitlines()[:4]
    end = title.index("Delta Energy %") + len("Delta Energy %")
    assert [row[:end].split()[-1] for row in rows] == ["-", "+300.00", "-75.00"]


def test_without_an_energy_norm_delta_energy_is_that_of_the_functional(mover):
    history = adapt(MESH, Script([4.0, 3.0]), passes=1).history
    bare = [
        replace(step, energy_norm=None, functional=value) for step, value in zip(history, (-4.0, -5.0), strict=True)
    ]
    result = replace(adapt(MESH, Script([4.0]), passes=0), history=tuple(bare))
    assert "-25.00" in str(result).splitlines()[2]


def test_the_table_without_an_energy_norm(mover):
    result = adapt(MESH, Script([4.0]), passes=0)
    result = replace(result, history=tuple(replace(step, energy_norm=None) for step in result.history))
    assert "Energy" not in str(result)


def test_repr_is_short(mover):
    assert len(repr(adapt(MESH, Script([4.0, 2.0]), passes=1))) < 300
