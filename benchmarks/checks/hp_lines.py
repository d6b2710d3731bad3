"""Fit a line to the logarithm of the error over the cube root of unknowns, of orders 2 to 8 with layers at corners."""

from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.corner_models import CornerModel, c_core, l_model, magnet_over_iron
from benchmarks.table import Cell, markdown

ORDERS = range(2, 9)
NODES = {"L": 60, "C": 1000, "M over iron": 400}  # of the adapted mesh
FACTOR, MORE = 0.4, 2  # of the sizes of successive layers; layers above the order
LEAST_FIT, LEAST_ERROR = 0.98, 1e-3  # targets: R^2, and % of the norm


def report(quick: bool) -> str:
    """Of the start mesh and of one adapted by order 2, each with two layers more than the order."""
    orders, rows = ORDERS[:3] if quick else ORDERS, list[list[Cell]]()
    for model in (l_model(), c_core(), magnet_over_iron()):
        rows.append(line(model, "start", model.start(), orders))
        if not quick:
            mesh = ka.adapt(model.start(), model.problem(2), passes=2, target_nodes=NODES[model.name]).mesh
            rows.append(line(model, "adapted", mesh, orders))
    header = [
        "",
        "mesh",
        "nodes",
        *(f"p {order}" for order in orders),
        "unknowns",
        "R^2",
        "target",
        "least %",
        "target",
    ]
    return markdown(header, rows)


def line(model: CornerModel, name: str, mesh: MeshTri, orders: Sequence[int]) -> list[Cell]:
    """Return a row: errors in % by order, unknowns of the last, R^2 and the least error."""
    points = [_point(model, mesh, order) for order in orders]
    unknowns, errors = zip(*points, strict=True)
    fit = float(np.corrcoef(np.cbrt(unknowns), np.log(errors))[0, 1] ** 2)
    figures = [f"{error:.2g}" for error in errors]
    least = f"{min(errors):.2g}"
    return [
        model.name,
        name,
        mesh.nvertices,
        *figures,
        unknowns[-1],
        f"{fit:.4f}",
        LEAST_FIT,
        least,
        f"{LEAST_ERROR:g}",
    ]


def _point(model: CornerModel, mesh: MeshTri, order: int) -> tuple[int, float]:
    field = model.problem(order).solve(model.with_layers(mesh, order + MORE, FACTOR))
    return len(field.values), model.error(field)
