"""Compare elements with curved sides with chords on a round magnet, whose field is known."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.round_magnet import CURVES, RoundMagnet
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Field

KINDS = (("P1, chords", 1, False), ("P2, chords", 2, False), ("P2, curved", 2, True), ("P3, curved", 3, True))
RINGS = {1: (20, 40, 80), 2: (10, 20, 40), 3: (5, 10, 20)}  # multiples of 5, for the magnet to have its radius
PERMEABILITIES = (1.0, 1000.0)
TOLERANCES = (0.01, 0.005, 0.001, 0.0003)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Uniform meshes of concentric magnets, and meshes of a tolerance."""
    header = ["round magnet, error %", *(f"mu_r = {permeability:g}" for permeability in PERMEABILITIES)]
    rows = [[name, *(falling(order, curved, each, quick) for each in PERMEABILITIES)] for name, order, curved in KINDS]
    return "\n\n".join([markdown(header, rows), told(quick)])


def falling(order: int, curved: bool, permeability: float, quick: bool) -> str:
    """Errors in % of the energy norm on rings of nodes, and how the last two fall with the number of unknowns."""
    given = RoundMagnet(permeability)
    found = [uniform_error(given, order, curved, rings) for rings in RINGS[order][: 2 if quick else 3]]
    (before, large), (unknowns, small) = found[-2:]
    rate = np.log(large / small) / np.log(unknowns / before)
    return f"{', '.join(f'{error:.3g}' for _, error in found)}; rate {rate:.2f}"


def told(quick: bool) -> str:
    """Errors that `rtol` leads to on the concentric magnet from few facets, told and by energy, in %."""
    given, rows = RoundMagnet(), list[list[Cell]]()
    for order in (2, 3):
        for rtol in TOLERANCES[: 2 if quick else None]:
            result = ka.adapt(given.mesh(5, curved=False), given.problem(order), curves=CURVES, rtol=rtol)
            error = 100.0 * result.estimate / (result.best.energy_norm or 1.0)
            indicated = 100.0 * float(np.linalg.norm(result.indicators)) / (result.best.energy_norm or 1.0)
            lacking = given.lacking(result.solution)
            rows.append([f"P{order}", 100.0 * rtol, result.best.unknowns, indicated, error, lacking, error / lacking])
    header = ["by rtol", "asked, %", "unknowns", "by elements alone, %", "told, %", "by energy, %"]
    return markdown([*header, "told over it"], rows)


def uniform_error(given: RoundMagnet, order: int, curved: bool, rings: int) -> tuple[int, float]:
    """Unknowns, and the error in %."""
    field = given.problem(order).solve(given.mesh(rings, curved))
    return unknowns_of(field, order), given.error(field, order)


def unknowns_of(field: Field, order: int) -> int:
    """Of a solution, given ones included."""
    return len(field.potential if order == 1 else field.values)
