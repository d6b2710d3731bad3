"""A figure of the outputs of a sweep over its first parameter."""

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from kohonen_adapt.sweeps.result import SweepResult, shown

__all__ = ["sweep_figure"]

COLUMNS = 3  # of panels
NAMED = 10  # maximum number of curves in a legend


def sweep_figure(result: SweepResult) -> Figure:
    """Draw every output of a sweep over the first parameter.

    Each output has a panel of its own, with one curve for every combination of the remaining parameters.

    Parameters
    ----------
    result
        The result of `kohonen_adapt.sweep`. Cases without an output leave a gap.

    Returns
    -------
    matplotlib.figure.Figure
        Save with ``figure.savefig(path)``.

    Raises
    ------
    ValueError
        If the result has no outputs, for instance because every case failed.
    """
    if not result.outputs:
        raise ValueError("a sweep must have outputs to be drawn; every case of this one ended with an error.")
    columns = min(COLUMNS, len(result.outputs))
    rows = -(-len(result.outputs) // columns)
    figure = Figure(figsize=(5.5 * columns, 4.5 * rows), dpi=100, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, output in zip(panels, result.outputs, strict=False):
        _draw_output(axes, result, output)
    for axes in panels[len(result.outputs) :]:
        axes.remove()
    return figure


def _draw_output(axes: Axes, result: SweepResult, output: str) -> None:
    first = result.parameters[0]
    curves = _curves(result)
    colours = colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))
    named = set(np.linspace(0, len(curves) - 1, min(NAMED, len(curves))).round().astype(int).tolist())
    for number, ((label, cases), colour) in enumerate(zip(curves.items(), colours, strict=True)):
        axes.plot(
            result.table[first][cases],
            result.table[output][cases],
            "o-",
            color=colour,
            label=label if number in named else None,
            markersize=4,
        )
    axes.set(xlabel=first, ylabel=output)
    axes.grid(alpha=0.3)
    if len(curves) > 1:
        axes.legend(fontsize="small")


def _curves(result: SweepResult) -> dict[str, list[int]]:
    first, *others = result.parameters
    found: dict[str, list[int]] = {}
    for number in _order(result.table[first]):
        shared = [f"{name} = {shown(result.table[name][number])}" for name in others]
        found.setdefault(", ".join(shared), []).append(number)
    return found


def _order(values: NDArray[Any]) -> list[int]:
    return np.argsort(values, kind="stable").tolist() if values.dtype.kind in "bif" else list(range(values.size))
