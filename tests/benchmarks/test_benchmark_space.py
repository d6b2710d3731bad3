"""The problems on tetrahedra have the errors that others measured, and relocation beats Mmg's; peers are described."""

import pytest

from benchmarks.checks.space import compared
from benchmarks.peers.peers_in_space import described, dihedral_angles, lost_names, methods, refined, timed
from benchmarks.peers.peers_order_2 import described as described_at_order_2
from benchmarks.peers.peers_order_2 import methods as methods_of_order_2
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import BUMP, CUBE, EDGE, MAGNET


@pytest.mark.parametrize(
    ("problem", "cells", "nodes", "uniform", "mmg"),
    [
        (BUMP, 10, 1331, 0.416, 0.2050),
        (EDGE, 6, 931, 0.1109, 0.0959),
    ],
)
def test_recycling_is_better_than_mmg_at_equal_nodes(problem, cells, nodes, uniform, mmg):
    row = compared(problem, cells)
    assert row[1] == nodes and row[2] == pytest.approx(uniform, rel=2e-3)
    assert row[4] < 0.95 * mmg


def test_peers_on_tetrahedra_are_described():
    """Refinement loses the boundary, nothing of ours is lost, and a uniform mesh is what it is."""
    start = CUBE.mesh(6)
    assert dihedral_angles(start) == pytest.approx((45.0, 90.0))
    ours = [timed(method, CUBE, start, 0) for name, method in methods().items() if name.startswith("this package")]
    row, other = described(CUBE, start, ours), described(CUBE, start, [refined(CUBE, start.nvertices)])
    assert row.lost == "none" and row.nodes == start.nvertices and other.lost == "given"
    assert row.error < other.error and 0.0 < row.least < row.greatest < 180.0
    assert 0 < row.jacobi < 100 and row.seconds > 0.0


def test_lost_names_are_those_of_another_size():
    mesh = MAGNET.coarsest()
    less = mesh.subdomains["iron"][1:]
    assert lost_names(mesh, mesh) == []
    assert lost_names(mesh, mesh.with_subdomains({"iron": less})) == ["iron"]


def test_peers_of_order_2_come_near_the_unknowns_and_a_polish_is_best():
    problem, start = Quadratic(EDGE), EDGE.mesh(3)
    methods = methods_of_order_2(problem, start, 700)
    chosen = ("refined by scikit-fem", "this package, graded", "this package, floor 0.2")
    rows = [described_at_order_2(problem, methods[name], 0, 700) for name in chosen]
    assert all(350 < row[0] < 1400 for row in rows) and all(0.0 < row[2] <= 1.0 for row in rows)
    assert rows[2][1] < rows[1][1] < rows[0][1] * 1.5
