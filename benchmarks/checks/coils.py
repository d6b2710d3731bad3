"""Measure problems with coils in space."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.checks import bracket, linkage, pot_magnet, team20, torus
from benchmarks.problems.coil_devices import electromagnet, electromagnet_problem, random_blocks, random_problem
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import Coil, MagneticScalarPotential

RANDOM = 60
ROUNDING = 1e-8  # of a functional with tabulated laws, relative to its terms
NODES, PASSES, ORDERS = 4000, 5, (1, 2)


def fields(quick: bool) -> str:
    """Processor time of the free field of coils of several shapes, best of three."""
    angle, centre, axis = 2.0 * np.pi * np.arange(24) / 24, (0.0, 0.0, 0.075), (0.0, 0.0, 1.0)
    polygon = np.stack((0.0285 * np.cos(angle), 0.0285 * np.sin(angle), np.full(24, 0.075)))
    coils = {
        "polygon, 24 bars": Coil(polygon, 0.018, 0.0966, 1000.0),
        "racetrack, 4 bars and 4 arcs": Coil.racetrack(centre, axis, 0.057, 0.057, 0.014, (0.018, 0.0966), 1000.0),
        "circular, 1 arc": Coil.circular(centre, axis, 0.0285, (0.018, 0.0966), 1000.0),
    }
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (3, 10_000 if quick else 50_000))
    rows = []
    for name, coil in coils.items():
        coil.field_strength(points[:, :10])  # compiles
        seconds = [timed(coil, points) for _ in range(3)]
        rows.append([name, 1e6 * min(seconds) / points.shape[1]])
    rows[0][0] += " (target 1.3 each)"
    return aligned(["free field of a coil", "microseconds per point"], rows)


def timed(coil: Coil, points: NDArray[np.float64]) -> float:
    start = time.process_time()
    coil.field_strength(points)
    return time.process_time() - start


def polish(quick: bool) -> str:
    """Estimates with and without the polish at equal nodes, then the certificates of random problems."""
    cases = {
        "electromagnet, 1000 A": (electromagnet(1), electromagnet_problem(1000.0)),
        "electromagnet, 5000 A": (electromagnet(1), electromagnet_problem(5000.0)),
        "linear iron and a magnet in a box": (random_blocks(2), random_problem(2)),
    }
    nodes = 3000 if quick else NODES
    rows = [
        [name, order, nodes, *compared(mesh, replace(problem, order=order), nodes)]
        for (name, (mesh, problem)), order in product(cases.items(), ORDERS)
    ]
    header = ["polish beside coils", "order", "nodes", "estimate", "polished", "ratio (target 0.8)"]
    tables = [aligned([*header, "seconds", "polished"], rows)]
    tables += [certificates(10 if quick else RANDOM, beside_coil, order) for order in ORDERS]
    return "\n\n".join(tables)


def beside_coil(seed: int) -> tuple[MeshTet, MagneticScalarPotential]:
    return random_blocks(seed), random_problem(seed)


def compared(mesh: MeshTet, problem: MagneticScalarPotential, nodes: int) -> list[Cell]:
    """Relative estimates without and with the polish, their ratio, and seconds of processor time."""
    found, seconds = [], []
    for polished in (False, True):
        start = time.process_time()
        result = ka.adapt(mesh, problem, passes=PASSES, target_nodes=nodes, polish=polished)
        seconds.append(time.process_time() - start)
        best = result.best
        found.append(float(best.estimate / (best.energy_norm or np.nan)))
    return [*found, found[1] / found[0], *seconds]


def certificates(count: int, made: Callable[[int], tuple[MeshTet, MagneticScalarPotential]], order: int) -> str:
    """Random problems whose solutions are stationary before and after a polish that never raises the functional."""
    risen, falls, estimates = 0, [], []
    for mesh, problem in map(made, range(count)):
        problem = replace(problem, order=order)
        polished = ka.polish(mesh, problem)  # raises ValueError if the solution is not stationary
        ka.polish(polished, problem, sweeps=1)
        fields = [problem.solve(each) for each in (mesh, polished)]
        before, after = (problem.functional_on(each.mesh)[0].value(each.unknown)[0] for each in fields)
        size = abs(before) + fields[0].energy
        risen += after > before + ROUNDING * size
        falls.append((before - after) / size)
        norms = [np.linalg.norm(problem.indicators(each.mesh, each)) for each in fields]
        estimates.append(norms[1] / norms[0])
    header = ["random problems", "order", "risen functionals (target 0)", "fall, median", "estimate, median", "worst"]
    medians = float(np.median(falls)), float(np.median(estimates))
    return aligned(header, [[f"{count}", order, risen, *medians, float(max(estimates))]])


def report(quick: bool, parts: Sequence[str] = ()) -> str:
    """Those parts with the given names, or all but the three slowest."""
    return "\n\n".join(PARTS[name](quick) for name in parts or [*PARTS][:-3])


PARTS = {
    "fields": fields,
    "polish": polish,
    "bracket": bracket.report,
    "torus": torus.report,
    "linkage": linkage.report,
    "pot": pot_magnet.report,
    "team20": team20.report,
    "tight": team20.tight,
    "finest": team20.finest,
    "million": bracket.million,
}
