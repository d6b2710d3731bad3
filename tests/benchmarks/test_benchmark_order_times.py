"""What the comparison of times by order calls reached is what was asked for, with no fewer nodes than the start has."""

from dataclasses import replace

import pytest

import kohonen_adapt as ka
from benchmarks.peers import orders_to_error


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_fewest_nodes_reach_the_error(order):
    model = next(model for model in orders_to_error.models() if model.name == "C")
    start, problem = model.start(), replace(model.problem, order=order)
    exact = ka.adapt(start, replace(problem, order=3), passes=3).solution.coenergy
    reached = orders_to_error.with_fewest_nodes(start, problem, 2, exact, 4.0, [0])
    assert reached.error <= 4.0
    assert start.nvertices <= reached.nodes < 1000
    assert reached.unknowns == ka.adapt(start, problem, passes=2, target_nodes=reached.nodes).best.unknowns
