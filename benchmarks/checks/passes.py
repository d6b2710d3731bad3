"""Hold the relocations and polishes of whole runs of adapt against their own solves and estimates."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from skfem import Mesh

import kohonen_adapt as ka
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

QUICK = 2  # times refined: 13 769 nodes, with --quick these alone
STEPS = ("solve", "estimate", "relocate", "polish")
MATERIALS = {"iron": Material(1000.0), "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": Material()}
CONDITIONS = {"outer": 0.0}


class ByIndicators(Magnetostatics):
    """A problem whose nodes are exchanged by the indicators in every pass, and never by energy."""

    def ritz(self, mesh: Mesh, solution: Field) -> ka.Ritz:
        """The functional, which gives elements their shapes alone."""
        return replace(super().ritz(mesh, solution), shapes_only=True, comparable=False)


# Problems, orders of elements and targets, set when order 1 was the default, by how often the mesh of 899 nodes is
# refined: to 3493, where there is no target, and to 13 769, 54 673 and 217 889.
CASES: tuple[tuple[type[Magnetostatics], int, dict[int, float | None]], ...] = (
    (Magnetostatics, 1, {2: 2.5, 3: 2.5, 4: 2.0}),
    (ByIndicators, 1, {2: 1.8, 3: 1.8, 4: 1.5}),
    (Magnetostatics, 2, {0: None, 1: None, 2: 2.5, 3: 2.5, 4: 2.0}),
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node of every step of a pass on the C-core, and the ratio; the best of three runs."""
    ka.warmup()
    rows = []
    for kind, order, targets in CASES:
        problem = kind(MATERIALS, potential=CONDITIONS, order=order)
        exchanged = "by indicators" if kind is ByIndicators else "by energy"
        for levels, target in {QUICK: targets[QUICK]}.items() if quick else targets.items():
            mesh = c_core_mesh("c_core.msh").refined(levels)
            least = min((_seconds(mesh, problem, seed) for seed in list(seeds)[:3]), key=_ratio)
            micros, ratio = [1e6 * least[step] / mesh.nvertices for step in STEPS], _ratio(least)
            rows.append([order, exchanged, mesh.nvertices, *micros, ratio, target, _verdict(ratio, target)])
    return markdown(["passes: order", "exchanged", "nodes", *STEPS, "ratio", "target", ""], rows)


def _seconds(mesh: Mesh, problem: Magnetostatics, seed: int) -> dict[str, float]:
    """Mean seconds of a step of a pass, those of the input left out."""
    history = ka.adapt(mesh, problem, seed=seed).history[1:]
    return {step: float(np.mean([each.seconds[step] for each in history])) for step in STEPS}


def _verdict(ratio: float, target: float | None) -> str | None:
    if target is None:
        return None
    return "met" if ratio <= target else "missed"


def _ratio(seconds: dict[str, float]) -> float:
    return (seconds["relocate"] + seconds["polish"]) / (seconds["solve"] + seconds["estimate"])
