"""The loop on tetrahedra of a problem that states its functional: passes go down it."""

from functools import cache

import numpy as np
import pytest
from helpers.poisson_solids import FICHERA, Minimised, fichera
from helpers.solids import ball, box

import kohonen_adapt as ka


@cache
def adapted(topology="recycle"):
    return ka.adapt(fichera(), Minimised(FICHERA), passes=4, topology=topology)


@pytest.mark.parametrize(("topology", "most"), [("recycle", 0.39), ("flip", 0.48), ("fixed", 0.6)])
def test_the_error_falls_to_less_than_without_a_polish(topology, most):
    result, problem = adapted(topology), Minimised(FICHERA)
    assert problem.error(result.best) < most * problem.error(result.history[0])
    assert {step.mesh.nvertices for step in result.history} == {316}
    floor = 0.2 if topology == "fixed" else 0.05
    assert all(step.min_quality >= floor * (1 - 1e-9) for step in result.history)
    assert "No polish" not in result.message


@pytest.mark.parametrize("topology", ["recycle", "flip", "fixed"])
def test_passes_compare_by_the_functional_and_those_by_energy_alone_never_raise_it(topology):
    """What the polish leaves is a function on the next mesh: the solution there lies no higher."""
    history = adapted(topology).history
    assert all(step.comparable for step in history)
    assert adapted(topology).best.functional == min(step.functional for step in history)
    for step in history:  # -1/2 |u_h|^2
        assert step.functional == pytest.approx(-0.5 * step.energy_norm**2, rel=1e-9)
    for before, after in ((history[2], history[3]), (history[3], history[4])):
        assert after.polish_gain > 0.0 and not after.quantization_errors
        assert after.functional <= before.functional - after.polish_gain * (1 - 1e-6)


def test_the_error_falls_at_the_rate_of_uniform_meshes_and_is_less_than_half():
    problem, cells = Minimised(), np.array([4, 5, 6, 8])
    runs = [ka.adapt(box(n), problem, passes=1) for n in cells]
    uniform = np.array([problem.error(run.history[0]) for run in runs])
    best = np.array([problem.error(run.best) for run in runs])
    for errors in (uniform, best):
        assert 0.28 < -np.polyfit(3.0 * np.log(cells + 1), np.log(errors), 1)[0] < 0.38
    assert np.all(best < 0.4 * uniform)


def test_the_table_and_nodes_count_what_is_recycled_by_energy():
    passes = adapted().history
    number = max(each.number for each in passes if each.collapses)  # the last pass may have nothing to recycle
    last = passes[number]
    assert last.splits == last.collapses > 0
    kept = last.nodes[last.nodes >= 0]
    assert len(np.unique(kept)) == len(kept) < 316
    lost = len(set(passes[number - 1].nodes) - set(last.nodes))
    assert lost <= last.collapses
    assert "gain of polish" in str(adapted())


def test_on_curved_surfaces_passes_compare_by_the_functional_if_loops_know_these():
    for surfaces, known in (({}, True), ({"rim": Asked()}, False)):
        mesh = ball(4).with_boundaries({"rim": lambda x: np.linalg.norm(x, axis=0) > 0.5})
        result = ka.adapt(mesh, Minimised(), passes=1, min_quality=0.1, surfaces=surfaces)
        assert all(step.comparable == known for step in result.history) and result.history[1].polish_gain > 0.0
        assert ("curved face" in result.message) == (not known)
        rim = result.history[1].mesh.boundary_nodes()
        assert np.linalg.norm(result.history[1].mesh.p[:, rim], axis=0) == pytest.approx(1.0, rel=1e-12)


class Asked:
    """A sphere of which loops know no formula, and nobody what its faces cut off."""

    def project(self, x):
        return x / np.linalg.norm(x, axis=0)


@pytest.mark.parametrize(("order", "cells", "nodes"), [(1, 2, 300), (2, 1, 100)])
def test_growth_from_faces_without_inner_nodes_lowers_the_functional(order, cells, nodes):
    problem = Minimised(FICHERA, order)
    coarse = ka.adapt(fichera(cells), problem, passes=2)
    found = ka.adapt(coarse.mesh, problem, passes=2, target_nodes=nodes)
    assert coarse.history[2].functional < 0.9 * coarse.history[0].functional  # both are negative
    assert found.mesh.nvertices > 0.9 * nodes
    assert found.history[2].functional < found.history[0].functional
