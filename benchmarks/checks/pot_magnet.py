"""Hold force and flux linkage of a round magnet in space, adapted to a tolerance, against those around its axis."""

import time
from collections.abc import Callable
from typing import Any

import kohonen_adapt as ka
from benchmarks.problems.pot_magnet import around_axis, in_space, mesh
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import FluxLinkage, Force

FINE = 2e-4  # tolerance around the axis
MOST = 40_000


def report(quick: bool) -> str:
    plane, solid = mesh(2), mesh(3)
    rows: list[list[Cell]] = []
    for ampere_turns in (2500.0,) if quick else (500.0, 2500.0):
        plunger: dict[str, Callable[[Any], float]] = {"force": pull, "linkage": FluxLinkage({"winding": 1})}
        section = ka.adapt(plane, around_axis(ampere_turns), outputs=plunger, output_rtol=FINE)
        exact = {name: each.corrected for name, each in section.outputs.items()}
        for order in (1, 2):
            for tolerance in (0.01,) if quick else (0.01, 0.003):
                rows += in_a_quarter(solid, ampere_turns, order, tolerance, exact)
    header = ["pot magnet", "order", "output_rtol", "nodes", "seconds", "quantity", "a quarter times 4"]
    return aligned([*header, "around the axis", "error %", "told %"], rows)


def in_a_quarter(
    solid: Any, ampere_turns: float, order: int, tolerance: float, exact: dict[str, float]
) -> list[list[Cell]]:
    outputs: dict[str, Callable[[Any], float]] = {
        "force": Force("plate", (0.0, 0.0, -1.0)),
        "linkage": FluxLinkage({"winding": 1}),
    }
    start = time.process_time()
    problem = in_space(ampere_turns, order)
    result = ka.adapt(solid, problem, outputs=outputs, output_rtol=tolerance, max_nodes=MOST)
    row: list[Cell] = [f"{ampere_turns:.0f} A", order, tolerance, result.mesh.nvertices, time.process_time() - start]
    return [
        [
            *row,
            name,
            4.0 * each.value,
            exact[name],
            100.0 * abs(4.0 * each.value / exact[name] - 1.0),
            100.0 * abs(each.error / each.value),
        ]
        for name, each in result.outputs.items()
    ]


def pull(field: Any) -> float:
    return -float(field.force("plate")[1])
