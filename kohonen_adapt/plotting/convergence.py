"""A picture of estimates over numbers of nodes, with the slope that refinement would follow at best."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

from kohonen_adapt.loop.result import Pass
from kohonen_adapt.plotting.drawing import BLUE, VERMILION

__all__ = ["plot_convergence"]

STYLES = ((BLUE, "o"), (VERMILION, "s"), ("#009e73", "^"), ("#cc79a7", "D"), ("#e69f00", "v"), ("#56b4e9", "P"))
"""Okabe and Ito's colours, which the colour-blind tell apart, each with a marker of its own."""

SPREAD = 6.0
"""The factor in nodes that the axis spans at least."""


def plot_convergence(histories: Mapping[str, Sequence[Pass]], *, slope: float = -0.5, ax: Axes | None = None) -> Axes:
    """Plot the estimate over the number of nodes for every pass, both logarithmic, with reference slopes.

    Grey lines with ``N ** slope`` go through the first pass of the first history and through its best. Where nodes stay
    as many, a circle marks how many the first line would need for the error of the best pass.

    Parameters
    ----------
    histories
        Word to passes, for instance ``{"adapted": result.history}``; at most six.
    slope
        Of the reference lines: -1/2 is the best rate of the energy error of P1 elements in the plane (-1 of P2).
    ax
        Where to; None for a new figure.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If there is no history, more than six, or one without a pass.
    """
    if not 1 <= len(histories) <= len(STYLES) or not all(histories.values()):
        raise ValueError(f"histories must be one to {len(STYLES)}, each with a pass; got {len(histories)}.")
    axes = Figure(figsize=(6.4, 4.4), dpi=160, layout="constrained").subplots() if ax is None else ax
    percent = all(step.energy_norm for history in histories.values() for step in history)
    drawn = [_points(history, percent) for history in histories.values()]
    for word, (nodes, errors), (colour, marker) in zip(histories, drawn, STYLES, strict=False):
        axes.plot(nodes, errors, marker, linestyle="-", color=colour, label=word, zorder=3)
    needed = _draw_slopes(axes, *drawn[0], slope)
    axes.set(xscale="log", yscale="log" if any(np.any(errors > 0.0) for _, errors in drawn) else "linear")
    axes.set(xlim=_ends(np.concatenate([needed, *(nodes for nodes, _ in drawn)])))
    axes.set(xlabel="nodes N", ylabel="energy error (% of the energy norm)" if percent else "energy error")
    axes.set_title("Estimate over nodes")
    _number_axes(axes)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.legend(loc="upper right", fontsize="small")
    return axes


def _number_axes(axes: Axes) -> None:
    """Plain numbers at 1, 2 and 5 of every decade."""
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(ScalarFormatter())
            axis.set_minor_formatter(NullFormatter())


def _points(history: Sequence[Pass], percent: bool) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and estimates of passes, the estimates positive: zero has no logarithm."""
    nodes = np.array([step.mesh.p.shape[1] for step in history], dtype=float)
    norms = [0.01 * (step.energy_norm or 1.0) if percent else 1.0 for step in history]
    errors = np.array([step.estimate for step in history]) / norms
    return nodes, np.where(errors > 0.0, errors, np.nan)


def _ends(nodes: np.ndarray) -> tuple[float, float]:
    """What the axis spans: all the nodes, some room, and at least a factor."""
    low, high = nodes.min() / 1.3, nodes.max() * 1.3
    room = max(1.0, SPREAD * low / high) ** 0.5
    return float(low / room), float(high * room)


def _draw_slopes(axes: Axes, nodes: np.ndarray, errors: np.ndarray, slope: float) -> np.ndarray:
    """Reference lines through the first pass and the best; where the first comes to the error of the best, if it does.

    Returns
    -------
    ndarray
        The nodes that the first line needs for the error of the best pass, or none.
    """
    known = np.flatnonzero(errors > 0.0)
    if not known.size:
        return np.empty(0)
    first, best = int(known[0]), int(known[np.argmin(errors[known] * nodes[known] ** -slope)])
    _draw_slope(axes, (nodes[first], errors[first]), slope, (0, (5, 3)), "first pass")
    if best == first:
        return np.empty(0)
    _draw_slope(axes, (nodes[best], errors[best]), slope, "dotted", "best pass")
    if nodes[best] != nodes[first]:
        return np.empty(0)
    needed = nodes[first] * (errors[best] / errors[first]) ** (1.0 / slope)
    axes.plot([nodes[best], needed], [errors[best]] * 2, color="0.45", linewidth=0.8, zorder=1)
    label = f"the error of the best at $N^{{{slope:g}}}$: {needed:.4g} nodes"
    axes.plot(needed, errors[best], "o", color="0.3", markerfacecolor="white", label=label, zorder=3)
    return np.array([needed])


def _draw_slope(axes: Axes, through: tuple[float, float], slope: float, style: Any, where: str) -> None:
    """A line through a point that is longer than the axes; it does not change their scale, as `add_line` would."""
    factors = np.array([1e-6, 1e6])
    x, y = through[0] * factors, through[1] * factors**slope
    label = f"$N^{{{slope:g}}}$ through the {where}"
    axes.add_artist(Line2D(x, y, color="0.45", linestyle=style, label=label, zorder=1))
