"""Measure errors around an axis, of a coil alone and around iron."""

from collections.abc import Sequence
from itertools import product

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.axis import error, norm, problem, start
from benchmarks.table import Cell, markdown

PASSES = 4


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors in % of uniform meshes, by the map alone and polished, and of estimates."""
    ka.warmup()
    header = ["around an axis, error %", "nodes", "uniform", "map only", "default", "worst", "estimate / error"]
    return markdown(header, [_row(*each, seeds) for each in product((1,) if quick else (1, 2, 3), (False, True))])


def _row(order: int, iron: bool, seeds: Sequence[int]) -> list[Cell]:
    mesh, given = start(iron), problem(iron, order)
    plain = [ka.adapt(mesh, given, passes=PASSES, polish=False, seed=seed) for seed in seeds]
    whole = [ka.adapt(mesh, given, passes=PASSES, seed=seed) for seed in seeds]
    by_map, errors = ([error(each.mesh, iron, order) for each in results] for results in (plain, whole))
    ratio = [100.0 * each.estimate / norm(iron) / one for each, one in zip(whole, errors, strict=True)]
    medians = map(float, np.median([by_map, errors, [max(errors)] * len(errors), ratio], axis=1))
    return [f"P{order}, coil{' and iron core' if iron else ''}", mesh.nvertices, error(mesh, iron, order), *medians]
