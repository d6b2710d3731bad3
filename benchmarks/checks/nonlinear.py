"""Hold functionals of nonlinear material against refinement and quadrature, and adapt the saturated C-core."""

from collections.abc import Sequence

import kohonen_adapt as ka
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.problems.steel import by_degree, fall_of, random_steel
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

PROBLEMS, FEW = 300, 40
NODES, PASSES = (581, 1600), 3
EXACT = -139.436893  # by orders 6 and 7 on 800 nodes
TARGET = -139.43600  # of order 2 with 1600 nodes, by degree 16
CORE = {
    "iron": Material(bh=Froehlich(2000.0, 0.8)),
    "magnet": Material(1.05, remanence=(0.0, 1.2)),
    "air": Material(),
}


def report(seeds: Sequence[int], quick: bool) -> str:
    """Return how often refinement raises a functional, the largest share of quadrature, and the saturated C-core."""
    return "\n\n".join([_theorem(FEW if quick else PROBLEMS), _core(NODES[:1] if quick else NODES)])


def _theorem(count: int) -> str:
    found = [fall_of(one.problem, one.mesh) for one in map(random_steel, range(count))]
    higher, worst = sum(one.rises for one in found), max(one.misjudged for one in found)
    share = f"quadrature is at most {100.0 * worst:.2g} % of the fall"
    return f"{count} problems: the functional is higher on the refined mesh in {higher}, and {share} (at most 1 %)."


def _core(counts: Sequence[int]) -> str:
    rows = []
    for order in (2, 3):
        problem = Magnetostatics(CORE, {"outer": 0.0}, order=order)
        for nodes in counts:
            result = ka.adapt(c_core_mesh("c_core_coarse.msh"), problem, passes=PASSES, target_nodes=nodes)
            for number, one in enumerate(result.history[1:], start=1):
                fine = by_degree(one.mesh, problem.ritz(one.mesh, problem.solve(one.mesh)))
                row = [order, one.mesh.nvertices, number, f"{one.functional:.6f}", f"{fine:.6f}"]
                rows.append([*row, "yes" if one is result.best else ""])
    header = ["order", "nodes", "pass", "functional as used", "by degree 16", "result"]
    return aligned(header, rows) + f"\nexact {EXACT:.6f}; order 2 with {NODES[1]} nodes at most {TARGET:.5f}"
