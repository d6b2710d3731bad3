"""The polish for a goal at orders 2 and 3, with the errors of both solutions that the benchmark knows."""

import pytest

import kohonen_adapt as ka
from benchmarks.problems.patch_mean import PatchMeanOfOrder, PolishedPatchMeanOfOrder, patched_mesh


@pytest.mark.parametrize("order", (2, 3))
def test_at_higher_orders_the_certificate_falls_and_the_product_is_smaller(order):
    by_map, polished = PatchMeanOfOrder(order), PolishedPatchMeanOfOrder(order)
    one, other = (ka.adapt(patched_mesh(8), problem, passes=2) for problem in (by_map, polished))
    exact = None
    for step in other.history:
        assert step.comparable and step.share == other.history[0].share
        error, weight, (product, goal) = *polished.each_error(step.mesh), polished.errors(step.mesh)
        bound = 0.5 * (step.share * error**2 + weight**2 / step.share)
        exact = step.functional - bound if exact is None else exact
        assert step.functional - bound == pytest.approx(exact, rel=1e-9)  # the minimum, the same on every mesh
        assert bound >= product > goal
    assert other.best.functional == min(step.functional for step in other.history) < other.history[0].functional
    assert by_map.errors(other.mesh)[0] < 0.75 * by_map.errors(one.mesh)[0]
