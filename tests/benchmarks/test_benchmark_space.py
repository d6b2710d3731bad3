"""The problems on tetrahedra have the errors that others measured, and relocation beats Mmg's; peers are described."""

import pytest

import kohonen_adapt as ka
from benchmarks.peers.lost_names import lost_names
from benchmarks.peers.peers_in_space import COUNTED, ERROR, LOST, SECONDS, Contest, greatest_angle
from benchmarks.problems.solids import BUMP, CUBE, EDGE, MAGNET


@pytest.mark.parametrize(
    ("problem", "cells", "nodes", "uniform", "mmg"),
    [
        (BUMP, 10, 1331, 0.416, 0.2050),
        (EDGE, 6, 931, 0.1109, 0.0959),
    ],
)
def test_recycling_is_better_than_mmg_at_equal_nodes(problem, cells, nodes, uniform, mmg):
    start = problem.mesh(cells)
    assert start.nvertices == nodes and problem.error(start, problem.solve(start)) == pytest.approx(uniform, rel=2e-3)
    result = ka.adapt(start, problem, passes=4, polish=False, anisotropic=False)
    assert problem.error(result.mesh, result.solution) < 0.95 * mmg


@pytest.mark.parametrize(("solid", "order", "cells"), [(CUBE, 1, 6), (EDGE, 2, 3)])
def test_peers_on_tetrahedra_are_described(solid, order, cells):
    """Refinement loses the boundary, nothing of ours is lost, and a polish is best."""
    contest = Contest(solid, order, cells, 700 if order == 2 else None)
    assert greatest_angle(contest.start()) == pytest.approx(90.0)
    chosen = ("this package, floor 0.2", "this package, graded", "refined by scikit-fem")
    rows = [contest.described(contest.methods()[name], [0]) for name in chosen]
    assert [row[LOST] for row in rows] == [0, 0, 1]
    assert rows[0][ERROR] < rows[1][ERROR] < 1.5 * rows[2][ERROR]
    assert all(row[SECONDS] > 0.0 and 0.0 < row["least quality"] <= 1.0 for row in rows)
    assert order == 2 or 0 < rows[0][COUNTED[0]] < 100


def test_lost_names_are_those_of_another_size():
    mesh = MAGNET.coarsest()
    less = mesh.subdomains["iron"][1:]
    assert lost_names(mesh, mesh) == []
    assert lost_names(mesh, mesh.with_subdomains({"iron": less})) == ["iron"]
