"""A loop that was cut short goes on from its last finished pass, and ends as if nothing had happened."""

import json
import os
import re
import shutil
from contextlib import nullcontext
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import inset, ring
from helpers.places import names_in
from helpers.poisson_solids import Minimised, Poisson
from helpers.processes import leave_drafts
from helpers.results import assert_same, assert_same_mesh
from helpers.solids import two_regions
from helpers.stand_ins import killed_at
from helpers.worlds import full_disk
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import FluxDensityAt, Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

PROBLEM = Magnetostatics(
    {"core": Material(permeability=100.0, remanence=(0.0, 1.0)), "air": Material()}, potential={"outer": 0.0}
)


def start():
    """A mesh with every kind of name: overlapping, empty, oriented."""
    mesh, none = inset(8), np.array([], dtype=np.int64)
    named = {"outer": mesh.boundary_facets(), "seam": mesh.facets_around("core"), "no/where": none.astype(np.int32)}
    return mesh.with_boundaries(named).with_subdomains({"all": np.arange(mesh.nelements), "nothing": none})


MESH = start()

OPTIONS = {"passes": 3, "outputs": {"energy": lambda field: field.energy}, "seed": 5}


@cache
def uninterrupted():
    return ka.adapt(MESH, PROBLEM, **OPTIONS)


def gap():
    """Layers between sides that are antiperiodic; what keeps both is found in the input alone."""
    mesh = MeshTri.init_tensor(np.linspace(0.0, 2.0, 9), np.array([0.0, 0.25, 0.5, 0.55, 0.6, 0.8, 1.0]))
    mesh = mesh.with_subdomains(
        {"air": lambda x: np.abs(x[1] - 0.55) > 0.05, "gap": lambda x: np.abs(x[1] - 0.55) < 0.05}
    )
    sides = {"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 2.0, "ends": lambda x: np.abs(x[1] - 0.5) == 0.5}
    materials = {"air": Material(), "gap": Material(remanence=(0.0, 1.0))}
    pairs = [("left", "right")]
    return mesh.with_boundaries(sides), Magnetostatics(materials, potential={"ends": 0.0}, antiperiodic=pairs)


def round_rim():
    mesh = ring(24, 4)
    mesh = mesh.with_subdomains({"all": np.arange(mesh.nelements)})
    return mesh, Magnetostatics({"all": Material(current_density=1e6)}, potential={"outer": 0.0})


SOLID = two_regions(3)
PLANE, GAP, ROUND = (MESH, PROBLEM), gap(), round_rim()
AIMED = MESH, replace(PROBLEM, goal=FluxDensityAt((0.3, 0.4), (1.0, 0.0), 0.04))
SPACE, POLISHED = (SOLID, Poisson()), (SOLID, Minimised(given="left"))
TRAINED = ka.Schedule((ka.Stage(1, 1, 0.3),), sweeps=1)
MIDDLE = [(2, "polish")]
INTERRUPTED = {  # name: mesh and problem, moments of the kills, and options beside two passes
    "input": (PLANE, [(0, "solve")], {}),
    "first checkpoint": (PLANE, [(0, "checkpoint")], {}),
    "relocate": (PLANE, [(1, "relocate")], {}),
    "last estimate": (PLANE, [(2, "estimate")], {}),
    "again and again": (PLANE, [(1, "polish"), (2, "polish"), (3, "polish")], {"passes": 3}),
    # with directions the run has stalled before
    "recycling by energy alone": (PLANE, [(4, "polish")], {"passes": 4, "anisotropic": False}),
    "growing": (PLANE, MIDDLE, {"target_nodes": 200}),
    "by tolerance": (PLANE, MIDDLE, {"rtol": 0.02}),
    "goal": (AIMED, MIDDLE, {}),
    "flip": (PLANE, MIDDLE, {"topology": "flip"}),
    "fixed": (PLANE, [(2, "solve")], {"topology": "fixed", "polish": False}),
    "pinned": (PLANE, MIDDLE, {"pinned": ["core"]}),
    "curves": (ROUND, MIDDLE, {"curves": {"inner": ka.Arc((0.0, 0.0), 0.5)}}),
    "layers and pairs": (GAP, MIDDLE, {"layers": {"gap": 2}}),
    "pairs, growing": (GAP, MIDDLE, {"target_nodes": 90}),
    "pairs, flip": (GAP, MIDDLE, {"topology": "flip"}),
    "space": (SPACE, [(1, "solve"), (2, "solve")], {"outputs": None}),
    "space, growing": (POLISHED, MIDDLE, {"outputs": None, "target_nodes": 90}),
    "space, flip": (POLISHED, MIDDLE, {"outputs": None, "topology": "flip"}),
    "space, pinned": (SPACE, [(2, "solve")], {"outputs": None, "topology": "fixed", "pinned": ["wall"]}),
    "space, trained": (POLISHED, MIDDLE, {"outputs": None, "schedule": TRAINED}),
    "space, surfaces": (POLISHED, MIDDLE, {"outputs": None, "surfaces": {"left": ka.Plane((0, 0, 0), (1, 0, 0))}}),
}


@pytest.mark.parametrize("name", INTERRUPTED)
def test_killed_and_resumed_is_as_if_nothing_had_happened(name, tmp_path):
    (mesh, problem), moments, more = INTERRUPTED[name]
    options = {**OPTIONS, "passes": 2, **more}
    straight = ka.adapt(mesh, problem, **options)
    for moment in moments:
        killed_at(moment, mesh, problem, **options, checkpoint=tmp_path)
    resumed = ka.adapt(mesh, problem, **options, checkpoint=tmp_path)
    assert_same(resumed, straight)
    assert any(step.moved for step in straight.history[1:])


class Counting:
    """The problem, how often it was solved, and an error in place of that.

    Where the input is `best`, it alone has the error.
    """

    def __init__(self, error=None, best=False):
        self.solves, self.error, self.best = 0, error, best

    def solve(self, mesh):
        self.solves += 1
        if self.error and (not self.best or np.array_equal(mesh.p, MESH.p)):
            raise self.error
        return PROBLEM.solve(mesh)

    def indicators(self, mesh, solution):
        found = PROBLEM.indicators(mesh, solution)
        return worse_than_the_input(mesh, found) if self.best else found


def worse_than_the_input(mesh, indicators):
    """On other meshes the largest element has all the error, which no element of the input contradicts."""
    largest = np.arange(mesh.nelements) == np.argmax(area(mesh))
    return np.where(largest & (not np.array_equal(mesh.p, MESH.p)), 100.0 * indicators.max(), indicators)


@pytest.mark.parametrize("passes", [2, 4])
def test_only_the_last_pass_is_solved_again(passes, tmp_path):
    """A loop that has ended ends again with one solve."""
    first, problem = ka.adapt(MESH, Counting(), passes=2, checkpoint=tmp_path), Counting()
    again = ka.adapt(MESH, problem, passes=passes, checkpoint=tmp_path)
    assert problem.solves == passes - 1 and len(again.history) == passes + 1
    assert [step.seconds for step in again.history[:3]] == [step.seconds for step in first.history]
    assert passes > 2 or assert_same(again, first) is None


@pytest.fixture
def best_before(tmp_path):
    """Options of two passes after a checkpoint of one, before which the input was better."""
    ka.adapt(MESH, Counting(best=True), passes=1, checkpoint=tmp_path)
    return {"passes": 2, "checkpoint": tmp_path}


@pytest.mark.parametrize("hooks", [(), ("interim",)])
def test_the_best_pass_is_solved_again_once_where_it_is_not_the_last(hooks, best_before, tmp_path):
    problem, seen = Counting(best=True), []
    hooks = dict.fromkeys(hooks, lambda result: seen.append((result.best.number, len(list(tmp_path.iterdir())))))
    result = ka.adapt(MESH, problem, **best_before, **hooks)
    assert result.mesh is MESH and seen == [(0, 2)] * len(hooks)  # before the pass counts as finished
    assert_array_equal(result.solution.potential, PROBLEM.solve(MESH).potential)
    assert problem.solves == 3  # pass 1 again, pass 2, and the input again


@pytest.mark.parametrize("hooks", [{}, {"interim": lambda result: None}], ids=["at the end", "interim"])
@pytest.mark.parametrize("error", [RuntimeError("no licence"), KeyboardInterrupt()])
def test_a_best_pass_that_cannot_be_solved_again_ends_the_loop(hooks, error, best_before):
    problem = Counting(error, best=True)
    result = ka.adapt(MESH, problem, **best_before, **hooks)
    assert result.best.number == 2 and len(result.history) == problem.solves == 3
    assert_array_equal(result.solution.potential, PROBLEM.solve(result.mesh).potential)
    if isinstance(error, KeyboardInterrupt):
        assert result.status is ka.Status.STOPPED
    else:
        assert (result.status, result.error) == (ka.Status.FAILED, error)
        assert result.message.startswith("Failed in pass 0, solve again: RuntimeError: no licence. Best: pass 2, ")


@pytest.mark.parametrize("best", [True, False])
def test_what_a_finished_run_raises_when_it_is_solved_again_is_raised(best, tmp_path):
    ka.adapt(MESH, Counting(best=best), passes=1, checkpoint=tmp_path)
    with pytest.raises(RuntimeError, match=r"^no licence$"):
        ka.adapt(MESH, Counting(RuntimeError("no licence"), best), passes=2 - best, checkpoint=tmp_path)


def test_the_callback_hears_of_the_passes_from_before_and_may_end_there(tmp_path):
    ka.adapt(MESH, PROBLEM, **OPTIONS, checkpoint=tmp_path)
    heard = []
    result = ka.adapt(
        MESH, PROBLEM, **OPTIONS, checkpoint=tmp_path, callback=lambda step: heard.append(step.number) or len(heard) > 1
    )
    assert heard == [0, 1]
    assert result.status is ka.Status.STOPPED and len(result.history) == 2


# ---- hooks ----


def test_progress_hears_of_every_step_when_it_begins(tmp_path):
    steps = []
    ka.adapt(MESH, PROBLEM, passes=1, progress=lambda *now: steps.append(now), checkpoint=tmp_path)
    ends = [(1, "relocate"), (1, "polish"), (1, "solve"), (1, "estimate"), (1, "checkpoint")]
    assert steps == [(0, "solve"), (0, "estimate"), (0, "checkpoint"), *ends]


def test_interim_is_the_result_so_far():
    seen = []
    result = ka.adapt(MESH, PROBLEM, **OPTIONS, interim=seen.append)
    assert [len(each.history) for each in seen] == [1, 2, 3, 4]
    assert all(each.status is ka.Status.STOPPED for each in seen)
    assert seen[0].mesh is MESH and seen[0].message.startswith("Interim result after 0 passes. Best: the input, ")
    for each in seen:
        assert each.mesh is each.best.mesh and each.best is each.history[each.best.number]
        assert each.nodes is each.best.nodes and each.indicators is each.best.indicators
        assert_array_equal(PROBLEM.solve(each.mesh).potential, each.solution.potential)
    assert seen[-1].mesh is result.mesh


# ---- what is refused ----


@pytest.fixture(scope="module")
def two_passes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two passes")
    killed_at((2, "polish"), MESH, PROBLEM, **OPTIONS, checkpoint=folder)
    return folder


@pytest.fixture
def folder(two_passes, tmp_path):
    """A copy of the checkpoint of two passes."""
    return shutil.copytree(two_passes, tmp_path / "copy")


PERMEABLE = {"core": Material(permeability=101.0, remanence=(0.0, 1.0)), "air": Material()}
WITHOUT_SIDES = {**MESH.boundaries, "seam": np.asarray(MESH.boundaries["seam"])}
OTHERS = {  # what is said: mesh, problem and options of another run
    "belongs to another run: seed was 5, now 6": (MESH, PROBLEM, {"seed": 6}),
    "min_quality was auto, now 0.2": (MESH, PROBLEM, {"min_quality": 0.2}),
    "topology was recycle, now flip": (MESH, PROBLEM, {"topology": "flip"}),
    "polish was True, now False": (MESH, PROBLEM, {"polish": False}),
    "pinned was [], now ['core']": (MESH, PROBLEM, {"pinned": ["core"]}),
    "target_nodes was none, now 100 in 3 passes": (MESH, PROBLEM, {"target_nodes": 100}),
    "schedule was none, now Schedule(stages": (MESH, PROBLEM, {"schedule": ka.Schedule(())}),
    "outputs was ['energy'], now []": (MESH, PROBLEM, {"outputs": {}}),
    "belongs to another run: mesh differs": (replace(MESH, doflocs=np.nextafter(MESH.p, 2.0)), PROBLEM, {}),
    "run: mesh differs.": (replace(MESH, _boundaries=WITHOUT_SIDES), PROBLEM, {}),
    "mesh differs. Use": (MESH.with_subdomains({"more": np.array([0])}), PROBLEM, {}),
    "the problem differs from the problem of the checkpoint: indicators on the": (
        MESH,
        Magnetostatics(PERMEABLE, potential={"outer": 0.0}),
        {},
    ),
}


@pytest.mark.parametrize("said", OTHERS)
def test_another_run_is_refused(said, folder):
    mesh, problem, options = OTHERS[said]
    with pytest.raises(ValueError, match=re.escape(said)):
        ka.adapt(mesh, problem, **{**OPTIONS, **options}, checkpoint=folder)


def test_another_curve_is_refused(tmp_path):
    for radius, refusal in ((0.5, nullcontext()), (0.5001, pytest.raises(ValueError, match=r"run: curves differs\."))):
        with refusal:
            ka.adapt(*ROUND, passes=0, curves={"inner": ka.Arc((0.0, 0.0), radius)}, checkpoint=tmp_path)


def test_what_says_when_to_end_may_differ(folder):
    result = ka.adapt(MESH, PROBLEM, **{**OPTIONS, "passes": 2, "atol": 1e6}, checkpoint=folder)
    assert result.status is ka.Status.CONVERGED and len(result.history) == 1


def rewritten(file, change):
    """The file with other contents."""
    with np.load(file) as content:
        arrays = {name: content[name] for name in content.files}
    change(arrays)
    np.savez(file, **arrays)


def changed(change):
    """The second pass with other arrays."""
    return lambda folder: rewritten(folder / "pass-0001.npz", change)


def without(name):
    return changed(lambda arrays: arrays.pop(name))


def shorter(name):
    return changed(lambda arrays: arrays.update({name: arrays[name][:-1]}))


class Trap:
    def __reduce__(self):
        return (os.mkdir, ("sprung",))


DAMAGED = {  # what is said: the damage
    r"has 'pass-0001.npz' but no 'pass-0000.npz'\. Delete the later": lambda at: (at / "pass-0000.npz").unlink(),
    r"pass-0001.npz' is damaged .*found format 3 and pass 0": lambda at: shutil.copy(
        at / "pass-0000.npz", at / "pass-0001.npz"
    ),
    r"\(KeyError: 'nodes'": without("nodes"),
    r"\(KeyError: 'indicators'": without("indicators"),
    r"\(KeyError: 'about'": without("about"),
    r"\(ValueError: there is no array position": without("state position"),
    r"\(ValueError: there is no array elements.node": without("state elements.node"),
    r"\(ValueError: indicators has shape": shorter("indicators"),
    r"\(ValueError: nodes has shape": shorter("nodes"),
    r"is damaged .*allow_pickle": changed(lambda arrays: arrays.update(about=np.array([Trap()], dtype=object))),
}


@pytest.mark.parametrize("said", DAMAGED)
def test_a_damaged_pass_names_its_file(said, folder, monkeypatch):
    DAMAGED[said](folder)
    monkeypatch.chdir(folder)
    before = {file.name for file in folder.iterdir()}
    with pytest.raises(ValueError, match=rf"^the checkpoint .*{said}|pass-0001.npz' {said}"):
        ka.adapt(MESH, PROBLEM, **OPTIONS, checkpoint=folder)
    assert {file.name for file in folder.iterdir()} == before


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    ka.adapt(MESH, PROBLEM, passes=0, checkpoint=folder)
    return folder / "pass-0000.npz", (folder / "pass-0000.npz").read_bytes()


@given(place=st.floats(0.0, 1.0, exclude_max=True), cut=st.booleans(), bit=st.integers(0, 7))
@examples(60)
def test_a_damaged_file_is_refused_or_not_damaged_where_it_counts(whole, place, cut, bit):
    file, content = whole
    at = int(place * len(content))
    file.write_bytes(content[:at] if cut else turned_over(content, at, bit))
    refused = is_refused(file)
    assert refused or not cut


def turned_over(content, at, bit):
    """The bytes with one bit of them the other way round."""
    return content[:at] + bytes([content[at] ^ (1 << bit)]) + content[at + 1 :]


def is_refused(file):
    """Whether it is refused, as damage must be; if not, it must give what it should."""
    try:
        result = ka.adapt(MESH, PROBLEM, passes=0, checkpoint=file.parent)
    except ValueError as error:
        assert "is damaged (" in str(error) or "another run" in str(error)
        return True
    assert_array_equal(result.indicators, PROBLEM.indicators(MESH, PROBLEM.solve(MESH)))
    return False


def test_a_damaged_directory_at_the_end_of_a_file_is_no_fault_of_the_disk(whole):
    """It may name a place before the beginning of the file, which the system refuses by an OSError."""
    file, content = whole
    for at in range(len(content) - 22, len(content)):
        file.write_bytes(turned_over(content, at, at % 8))
        is_refused(file)


def test_a_disk_that_is_full_ends_the_loop_with_what_there_is(tmp_path):
    with full_disk(lambda target: "0001" in target):
        result = ka.adapt(MESH, PROBLEM, **OPTIONS, checkpoint=tmp_path)
    assert result.status is ka.Status.FAILED and len(result.history) == 2
    assert "checkpoint of pass 1: OSError: [Errno 28] No space left on device" in result.message
    assert names_in(tmp_path) == ["pass-0000.npz"]  # no draft
    assert_same(ka.adapt(MESH, PROBLEM, **OPTIONS, checkpoint=tmp_path), uninterrupted())


def test_a_draft_of_a_killed_loop_goes_with_the_next(tmp_path):
    leave_drafts(tmp_path / "pass-0000.npz")
    ka.adapt(MESH, PROBLEM, passes=0, checkpoint=tmp_path)
    assert names_in(tmp_path) == ["pass-0000.npz"]


def test_files_of_before_the_refusals_were_counted_are_read(folder):
    added = ("unmoved", "refused_by_quality", "refused_by_reach", "held_in_polish")

    def older(arrays):
        about = json.loads(arrays["about"].tobytes())
        for name in added:
            del about[name]
        arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)

    files = sorted(folder.iterdir())
    for file in files:
        rewritten(file, older)
    result = ka.adapt(MESH, PROBLEM, **OPTIONS, checkpoint=folder)
    assert_same_mesh(result.mesh, uninterrupted().mesh)
    assert {getattr(step, name) for step in result.history[: len(files)] for name in added} == {0}


def test_damaged_passes_of_tetrahedra(tmp_path):
    ka.adapt(SOLID, Poisson(), passes=1, checkpoint=tmp_path)
    changed(lambda arrays: arrays.update({"state tetrahedra.node": np.ones((3, 4))}))(tmp_path)
    with pytest.raises(ValueError, match=r"pass-0001.npz' is damaged \(ValueError: tetrahedra.node is an array"):
        ka.adapt(SOLID, Poisson(), passes=2, checkpoint=tmp_path)
