"""The loop: what it gives back, how it ends, and what every ending says."""

from dataclasses import dataclass, field
from itertools import pairwise
from time import perf_counter

import numba
import numpy as np
import pytest
from helpers.meshes import square
from helpers.stand_ins import ELEMENTS, MESH, Script, adapt, script_of
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import AdaptResult, Status
from kohonen_adapt.mesh.measures import area

NODES = MESH.nvertices
CORNERS = [0, 1, 2, 3]


class Left:
    """A problem whose error is at the left side, and falls with every mesh."""

    solves = 0

    def solve(self, mesh):
        self.solves += 1
        return mesh.p[0]

    def indicators(self, mesh, solution):
        errors = 1.0 / (0.05 + solution[mesh.t].mean(axis=0))
        return errors / np.linalg.norm(errors) / self.solves


@dataclass(frozen=True)
class Raising(ka.Stage):
    """A stage of training that raises as soon as the map comes to it."""

    error: BaseException = field(default=None, kw_only=True)

    def rates(self):
        raise self.error


def raising(error):
    """A schedule with which the map raises."""
    return ka.Schedule((Raising(1, 1, 0.3, error=error),))


def ways(before, after):
    """How far every node went, by number."""
    return np.hypot(*(after.mesh.p - before.mesh.p))


def estimates(result):
    return [step.estimate for step in result.history]


# ---- what comes back ----


def test_every_pass_has_indicators_and_nodes_of_its_own_mesh():
    problem = Script([4.0, 3.0, 2.0])
    history = adapt(MESH, problem, passes=2, target_nodes=40).history
    assert_array_equal(history[0].nodes, np.arange(NODES))
    for step in history:
        assert step.indicators.shape == (step.mesh.nelements,) and step.nodes.shape == (step.mesh.nvertices,)
        assert np.linalg.norm(step.indicators) == pytest.approx(step.estimate)
        old = step.nodes[step.nodes >= 0]
        assert len(np.unique(old)) == len(old)
        at = [int(np.flatnonzero(step.nodes == corner)[0]) for corner in CORNERS]
        assert_array_equal(step.mesh.p[:, at], MESH.p[:, CORNERS])


def test_a_pass_describes_its_mesh_and_the_relocation_that_made_it():
    history = adapt(MESH, Script([2.0, 1.0, 0.5, 3.0]), passes=3, topology="fixed").history
    first, *others = history
    assert (first.quantization_errors, first.max_displacement, first.moved) == ((), 0.0, 0)
    assert first.seconds["relocate"] == 0.0 < min(first.seconds["solve"], first.seconds["estimate"])
    for before, after in pairwise(history):
        way = ways(before, after)
        assert after.max_displacement == pytest.approx(way.max(), rel=1e-12) and after.moved == np.count_nonzero(way)
    for step in others:
        assert len(step.quantization_errors) and all(0.0 < distance < 1.0 for distance in step.quantization_errors)
        assert min(step.seconds["relocate"], step.seconds["solve"]) > 0.0
    for step in history:
        qualities = ka.quality(step.mesh)
        assert (step.min_quality, step.mean_quality) == (qualities.min(), qualities.mean())
        assert step.energy_norm == 10.0 and set(step.seconds) == {"solve", "estimate", "relocate", "polish"}


def test_the_time_of_compiling_is_no_time_of_a_step():
    class Slow(Left):
        def solve(self, mesh):
            start = perf_counter()
            if self.solves == 1:
                numba.njit(lambda x: x + 1)(1)
            self.wall = perf_counter() - start
            return super().solve(mesh)

    problem = Slow()
    step = ka.adapt(MESH, problem, passes=1, polish=False).history[1]
    assert step.seconds["solve"] + step.compile_seconds >= problem.wall > step.seconds["solve"]


def test_indicators_are_kept_even_if_the_problem_reuses_its_array():
    class Reusing(Script):
        buffer = np.empty(ELEMENTS)

        def indicators(self, mesh, solution):
            self.buffer[:] = super().indicators(mesh, solution)
            return self.buffer

    result = adapt(MESH, Reusing([1.0, 2.0]), passes=1)
    assert np.linalg.norm(result.indicators) == pytest.approx(1.0)


def test_tiny_and_huge_indicators_are_not_lost():
    assert adapt(MESH, Script([1e-200]), passes=0).estimate == pytest.approx(1e-200)
    assert adapt(MESH, Script([1e200]), passes=0).estimate == pytest.approx(1e200)


# ---- what the map is asked ----


STRIP = MeshTri.init_tensor(np.linspace(0.0, 2.0, 9), np.linspace(0.0, 0.2, 3)).with_subdomains(
    {"strip": np.arange(32)}
)
SIDES = square(6).with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})
PAIRS = {"pairs": (("left", "right"),)}
PERIODIC, LAYERS, PINNED = {"periodic": [("left", "right")]}, {"layers": {"strip": 2}}, {"pinned": "left"}
ASKED = [  # mesh, attributes of the problem, options of the loop, and of `relocate`
    *(
        (MESH, {"order": order, "norm": norm}, {"topology": topology}, {})
        for topology in ("fixed", "flip", "recycle")
        for order, norm in [(1, "energy"), (2, "L2"), (2, "energy")]
    ),
    (STRIP, {}, LAYERS, LAYERS),
    (SIDES, {}, PERIODIC, PERIODIC),
    (SIDES, PAIRS, {}, PERIODIC),
    (SIDES, PAIRS, {"periodic": ()}, {}),
    (SIDES, {}, PINNED, PINNED),
]
SEED = int(np.random.SeedSequence((0, 1)).generate_state(1)[0])


@pytest.mark.parametrize(("mesh", "attributes", "options", "more"), ASKED)
def test_the_first_relocation_is_as_asked(mesh, attributes, options, more):
    problem = Left()
    vars(problem).update(attributes)
    given = {"topology": "flip", **options}
    first, second = adapt(mesh, problem, passes=1, **given).history
    assert first.energy_norm is None

    def moved(order, **more):
        asked = {"order": order, "norm": attributes.get("norm", "energy")}
        if given["topology"] == "fixed":  # elements whose edges stay have no directions
            density = ka.density_from_indicators(mesh, first.indicators, **asked)
        else:
            density = ka.metric_from_hessian(mesh, problem.solve(mesh), first.indicators, **asked)
        return ka.relocate(mesh, density, topology=given["topology"], seed=SEED, **more).p

    order = attributes.get("order", 1)
    assert_allclose(second.mesh.p, moved(order, **more), rtol=0, atol=1e-12)
    assert not np.array_equal(second.mesh.p, moved(order) if more else moved(4))


@pytest.mark.parametrize(
    ("mesh", "attributes", "options", "said"),
    [
        (MESH, PAIRS, {}, "'left', which is no boundary of the mesh"),
        (STRIP, {}, {"layers": {"strip": 3}, "topology": "flip"}, "subdomain 'strip'"),  # with "recycle" it is made
    ],
)
def test_what_the_mesh_cannot_have_is_refused_before_anything_is_solved(mesh, attributes, options, said):
    problem = Left()
    vars(problem).update(attributes)
    with pytest.raises(ValueError, match=said):
        adapt(mesh, problem, **options)
    assert problem.solves == 0


def test_a_warm_start_from_the_second_solve_on():
    class Warm(Script):
        def solve_from(self, mesh, old_mesh, old_solution):
            starts.append((mesh, old_mesh, old_solution))
            return self.solve(mesh)

    starts = []
    result = adapt(MESH, Warm([3.0, 1.0, 2.0]), passes=2)
    meshes = [step.mesh for step in result.history]
    assert starts == [(meshes[1], meshes[0], 0), (meshes[2], meshes[1], 1)]


# ---- the norm of the error ----


def test_with_the_l2_norm_the_best_has_the_least_area_weighted_sum():
    """32 small elements of 0.6 are more than 4 large ones of 1, but not by area, however they have moved."""
    left, right = np.linspace(0.0, 0.5, 2), np.linspace(0.5, 1.0, 9)[1:]
    mesh = MeshTri.init_tensor(np.concatenate([left, right]), np.linspace(0.0, 1.0, 3))
    wide = np.mean(mesh.p[0][mesh.t], axis=0) < 0.5

    class Moving(Script):
        norm = "L2"

        def indicators(self, mesh, solution):
            return np.where(wide, *((1.0, 0.45) if solution == 0 else (0.1, 0.6)))

    result = adapt(mesh, Moving([0, 0]), passes=1, topology="fixed")
    assert result.best is result.history[1] and estimates(result)[1] > estimates(result)[0]
    for step in result.history:
        assert step.worth == pytest.approx(np.sqrt(np.sum(area(step.mesh) * step.indicators**2)), rel=1e-12)


# ---- how it ends ----


def force(*values, **more):
    """An output with these values, and options."""
    return {"outputs": {"force": script_of(*values)}, "output_rtol": 0.01, **more}


def interrupt(*_):
    raise KeyboardInterrupt


def at(number, step, error):
    """A function of progress that raises when a step begins."""

    def progress(*begun):
        if begun == (number, step):
            raise error

    return progress


SINGULAR, FULL = ZeroDivisionError("singular."), RuntimeError("disc full")
FALLING = [4.0, 3.0, 2.0, 1.0]
BEST = " Best: {best}, estimated error {error:.3g} %."
ENDS = {
    Status.MAX_PASSES: BEST + " Increase `passes` to continue.",
    Status.STOPPED: BEST + " Adapt the result to continue.",
    Status.FAILED: BEST + " See `error`.",
    Status.STALLED: BEST + " Use more nodes (`target_nodes`) for a smaller error.",
    Status.CONVERGED: BEST,
}
BEGINNINGS = {
    "Stopped after": Status.MAX_PASSES,
    "Stopped by": Status.STOPPED,
    "Failed": Status.FAILED,
    "Stalled": Status.STALLED,
    "Converged": Status.CONVERGED,
}
STALLED = "Stalled: the last 2 passes improved the result by less than 0.1 %."
# estimates, options, passes, the best of them, and what is said before the best
ENDINGS = [
    (FALLING, {"passes": 3}, 3, 3, "Stopped after 3 passes."),
    ([4.0, 3.0, 1.0, 2.0], {"passes": 3}, 3, 2, "Stopped after 3 passes."),
    ([1.0, 2.0], {"passes": 1}, 1, 0, "Stopped after 1 pass."),
    ([1.0, 1.0], {"passes": 1}, 1, 0, "Stopped after 1 pass."),
    *(
        (
            FALLING,
            {"passes": 3, **given},
            n,
            n,
            f"Converged after {said} within the tolerance {told}.",
        )
        for given, n, said, told in [
            ({"atol": 2.0}, 2, "2 passes: estimate 2", 2),
            ({"rtol": 0.3}, 1, "1 pass: estimate 3", 3),
            ({"rtol": 0.1, "atol": 1.0}, 2, "2 passes: estimate 2", 2),
            ({"atol": 5}, 0, "0 passes: estimate 4", 5),
            ({"atol": 4.0, "callback": lambda step: True}, 0, "0 passes: estimate 4", 4),
        ]
    ),
    (
        [4.0, 3.0],
        {"passes": 1, "rtol": 1e-3},
        1,
        1,
        "Stopped after 1 pass without reaching the tolerance 0.01 (estimate 3).",
    ),
    ([4.0, 4.0, 4.0, 1.0], {}, 2, 0, STALLED),
    ([4.0, 5.0, 4.5, 1.0], {}, 2, 0, STALLED),
    ([4.0, 3.0, 3.1, 3.2, 1.0], {}, 3, 1, STALLED),
    ([4.0, 3.9985, 3.9980, 1.0], {}, 2, 2, STALLED),
    ([4.0, 5.0, 3.0, 3.5, 2.9], {"passes": 4}, 4, 4, "Stopped after 4 passes."),
    ([4.0, 3.0, 3.0, 2.9, 2.9], {"passes": 4}, 4, 3, "Stopped after 4 passes."),
    ([4.0, 3.997, 3.994, 3.991, 3.988], {"passes": 4}, 4, 4, "Stopped after 4 passes."),
    (FALLING, {"callback": np.bool_}, 0, 0, "Stopped by the callback after 0 passes."),
    (
        FALLING,
        {"callback": lambda step: np.bool_(step.number == 1)},
        1,
        1,
        "Stopped by the callback after 1 pass.",
    ),
    ([3.0, 2.0], {"passes": 1, "callback": lambda step: "a.png"}, 1, 1, "Stopped after 1 pass."),
    ([3.0, 1.0, 2.0, KeyboardInterrupt()], {}, 2, 1, "Stopped by Ctrl-C after 2 passes."),
    *(
        ([3.0], options, 0, 0, "Stopped by Ctrl-C after 0 passes.")
        for options in (
            {"callback": interrupt},
            {"interim": interrupt},
            {"progress": at(1, "relocate", KeyboardInterrupt())},
            {"schedule": raising(KeyboardInterrupt())},
        )
    ),
    ([3.0, 2.0, SINGULAR], {}, 1, 1, "Failed in pass 2, solve: ZeroDivisionError: singular."),
    ([3.0, OSError("no licence.\nCall us.")], {}, 0, 0, "Failed in pass 1, solve: OSError: no licence."),
    ([3.0, OSError()], {}, 0, 0, "Failed in pass 1, solve: OSError."),
    ([3.0], {"schedule": raising(FULL)}, 0, 0, "Failed in pass 1, relocate: RuntimeError: disc full."),
    (
        [3.0, 2.0, 1.0],
        force(1.0, 2.0, SINGULAR),
        1,
        1,
        "Failed in pass 2, output 'force': ZeroDivisionError: singular.",
    ),
    *(
        (FALLING, force(*values, passes=3, output_rtol=asked), n, n, f"Converged after {said}).")
        for values, asked, n, said in [
            ((1.0, 1.1, 1.1054), 0.005, 2, "2 passes: force 1.1054, estimated error 0.4885 % (asked 0.5 %"),
            ((-2.0, -2.0), 0.001, 1, "1 pass: force -2, estimated error 0 % (asked 0.1 %"),
            ((1.0, 2.0, 1.6), 0.25, 2, "2 passes: force 1.60, estimated error 25 % (asked 25 %"),
            ((0.0, 0.0), 0.01, 1, "1 pass: force 0, estimated error 0 (asked 1 %"),
        ]
    ),
    *(
        (
            [3.0, 2.0, 1.0],
            force(*values, passes=2),
            2,
            2,
            f"Stopped after 2 passes without reaching the tolerance of force {told} (asked 1 %).",
        )
        for values, told in [
            ((1.0, 1.02, 1.04), "1.040, estimated error 1.923 %"),
            ((0.0, 1e-9, 2e-9), "2.0e-09, estimated error 50 %"),
            ((1.0, -1.0, 1.0), "1.0, estimated error 200 %"),
        ]
    ),
    *(
        (
            [*estimates, 0.5],
            force(*values, atol=1.0),
            2,
            2,
            f"Converged after 2 passes: estimate {estimates[2]:g} within the tolerance 1 and force {values[2]:g}, "
            "estimated error 0 % (asked 1 %).",
        )
        for estimates, values in [([4.0, 1.0, 0.9], (1.0, 2.0, 2.0)), ([4.0, 3.0, 1.0], (1.0, 1.0, 1.0))]
    ),
    (
        FALLING,
        {**force(1.0, 1.0, 1.0), "outputs": {"calm": script_of(1.0, 1.0, 1.0), "wild": script_of(1.0, 2.0, 2.0)}},
        2,
        2,
        "Converged after 2 passes: calm 1, estimated error 0 % (asked 1 %) and wild 2, estimated error 0 % (asked "
        "1 %).",
    ),
    (
        [3.0, 2.0],
        force(1.0, 2.0, atol=1e-3, passes=1),
        1,
        1,
        "Stopped after 1 pass without reaching the tolerance 0.001 (estimate 2) and the tolerance of force 2.0, "
        "estimated error 50 % (asked 1 %).",
    ),
]


@pytest.mark.parametrize(("script", "options", "passes", "best", "said"), ENDINGS)
def test_how_it_ends(script, options, passes, best, said):
    (status,) = [each for begins, each in BEGINNINGS.items() if said.startswith(begins)]
    problem = Script(script)
    result = adapt(MESH, problem, **options)
    assert isinstance(result, AdaptResult) and result.history[0].mesh is MESH
    assert [step.number for step in result.history] == list(range(passes + 1))
    assert (result.status, len(result.history), result.best.number, result.solution) == (status, passes + 1, best, best)
    assert result.mesh is result.history[best].mesh and result.indicators is result.history[best].indicators
    assert (result.estimate, result.nodes) == (estimates(result)[best], result.best.nodes)
    assert all(step.mesh is solved for step, solved in zip(result.history, problem.calls, strict=False))
    assert estimates(result) == pytest.approx(script[: passes + 1])
    assert (result.error is not None) == (status is Status.FAILED)
    assert all(each == each.name.lower() for each in Status)
    assert result.error in [*script, SINGULAR, FULL, None]
    name = f"pass {best}" if best else "the input"
    assert result.message == said + ENDS[status].format(best=name, error=10.0 * script[best])


@pytest.mark.parametrize(
    ("script", "options", "error"),
    [
        ([KeyboardInterrupt()], {}, KeyboardInterrupt),
        ([SINGULAR], {}, ZeroDivisionError),
        ([1.0], force(SINGULAR), ZeroDivisionError),
        ([3.0, 2.0], {"progress": at(1, "solve", FULL)}, RuntimeError),
        ([3.0, 2.0], {"callback": lambda step: step.number == 1 and at(1, "", FULL)(1, "")}, RuntimeError),
    ],
)
def test_what_is_raised_at_the_input_and_in_hooks_propagates(script, options, error):
    with pytest.raises(error):
        adapt(MESH, Script(script), passes=1, **options)


def test_no_passes():
    result = adapt(MESH, Script([1.0]), passes=0)
    assert result.mesh is MESH and len(result.history) == 1 and result.history[0].outputs == {}
    assert result.status is Status.MAX_PASSES
    assert result.message == (
        "Stopped after 0 passes: the input was only solved and estimated. Increase `passes` to adapt it."
    )


def test_an_estimate_that_is_not_calibrated_is_called_so():
    result = adapt(MESH, Script([4.0, 1.0], calibrated=False), passes=2, atol=2.0)
    assert "after 1 pass: estimate 1 (not calibrated) within the tolerance 2." in result.message


def test_a_tolerance_of_zero_is_never_met():
    assert adapt(MESH, Script([4.0, 3.0]), passes=1, atol=0.0, target_nodes=25).status is Status.MAX_PASSES


@pytest.mark.parametrize("number", [0, 1])
def test_indicators_that_are_all_zero_have_converged(number):
    result = adapt(MESH, Script([1.0, 0.0][1 - number :]), passes=3)
    assert (result.status, len(result.history), result.estimate) == (Status.CONVERGED, number + 1, 0.0)
    assert result.message == f"Converged after {number} pass{'' if number else 'es'}: all indicators are zero."


@pytest.mark.parametrize(("values", "converges"), [((1.0, 1.2, 1.21), True), ((1.0, 2.0, 3.0), False)])
def test_indicators_that_are_all_zero_do_not_meet_the_tolerance_of_an_output(values, converges):
    result = adapt(MESH, Script([0.0] * 3), passes=2, outputs={"force": script_of(*values)}, output_rtol=0.01)
    assert [step.number for step in result.history] == [0, 1, 2]
    assert result.status is (Status.CONVERGED if converges else Status.MAX_PASSES)
    assert result.best.number == 2 and result.best.unknowns > result.history[0].unknowns
    said = "Converged after 2 passes: all indicators are zero and force 1.210, estimated error 0.8264 % (asked 1 %)."
    assert (result.message == said) == converges


@pytest.mark.parametrize(
    ("mesh", "options", "why"),
    [
        (MESH, {"pinned": np.arange(NODES)}, "every node is a corner or pinned"),
        (MeshTri(), {}, "every node is a corner or pinned"),
        (
            MESH,
            {"schedule": ka.Schedule(()), "topology": "fixed"},
            "the schedule has no rounds, no epochs and no sweeps",
        ),
        (
            MESH,
            {"min_quality": 0.99, "topology": "fixed"},
            "every move would have broken the quality rule: the worst element has a quality of 0.87, min_quality is "
            "0.99, and nothing below that may get worse. Give min_quality=0.43",
        ),
    ],
)
def test_nothing_could_move(mesh, options, why):
    problem = Script([1.0])
    result = adapt(mesh, problem, **options)
    assert result.status is Status.NOT_MOVED
    assert len(result.history) == len(problem.calls) == 1 and result.mesh is mesh
    assert result.message == f"No node moved: {why}. Best: the input, estimated error 10 %."


def test_a_mesh_that_only_flipped_is_solved_before_the_loop_ends():
    slanted = MeshTri(np.array([[0.0, 1.0, 1.4, 0.4], [0.0, 0.0, 1.0, 1.0]]), np.array([[0, 0], [1, 2], [2, 3]]))
    problem = Script([2.0, 1.0, 0.5])
    result = adapt(slanted, problem, passes=5, topology="flip")
    assert result.mesh is problem.calls[-1] is result.history[1].mesh and result.best.moved == 0
    assert_array_equal(result.mesh.p, slanted.p)
    assert np.all(np.any(result.mesh.t == 1, axis=0) & np.any(result.mesh.t == 3, axis=0))  # the other diagonal
    assert (result.status, result.message) == (
        Status.NOT_MOVED,
        "No node moved: every node is a corner or pinned. Best: pass 1, estimated error 10 %.",
    )


def test_what_the_problem_raises_when_its_order_is_asked_for_later_ends_the_loop():
    class Forgetful(Script):
        @property
        def order(self):
            if self.calls:
                raise OSError("no licence")
            return 1

    result = adapt(MESH, Forgetful([3.0]))
    assert result.status is Status.FAILED
    assert result.message.startswith("Failed in pass 1, relocate: OSError: no licence. Best: the input, ")


# ---- outputs ----


def test_every_pass_carries_the_outputs():
    outputs = {"force": script_of(1.0, 2, np.float32(2.5)), "twice": lambda solution: 2 * solution}
    result = adapt(MESH, Script([3.0, 2.0, 1.0]), passes=2, outputs=outputs)
    assert [step.outputs for step in result.history] == [
        {"force": 1.0, "twice": 0.0},
        {"force": 2.0, "twice": 2.0},
        {"force": 2.5, "twice": 4.0},
    ]
    assert all(type(value) is float for step in result.history for value in step.outputs.values())
