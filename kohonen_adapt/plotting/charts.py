"""Draw numbers over numbers: estimates over passes and over nodes, qualities, densities, magnetisation curves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, ScalarFormatter
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import as_reals
from kohonen_adapt.display import in_unit
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.table import energy_error, word_for_estimate
from kohonen_adapt.magnetostatics.materials.bh_table import Table
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY, Law
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.plotting.drawing import COLOURS, draw_indicators

__all__ = ["axes_of", "draw_passes", "plot_bh", "plot_convergence", "plot_density", "plot_qualities"]

BLUE, VERMILION = COLOURS[:2]
MARKERS = ("o", "s", "^", "D", "v", "P")
"""One for each of the colours, for a grey print."""

ERROR = "energy error (% of the energy norm)"
"""Label of an axis in per cent."""

SPREAD = 6.0
"""The factor in nodes that the axis spans at least."""

BINS = np.linspace(0.0, 1.0, 41)
STYLES = ((BLUE, "solid"), (VERMILION, "dashed"), ("black", "dotted"))
"""Of histograms of quality."""

DECADES = 5
"""How far below the largest density the colours reach at most."""

SATURATED = 0.9
"""Share of the slope of vacuum at which a magnetisation curve has been seen."""


def draw_passes(axes: Axes, history: Sequence[Pass], *, errors: Sequence[float] | None = None) -> None:
    """Draw the estimate over the passes; where it is calibrated, in per cent of the energy norm if every pass has one.

    Parameters
    ----------
    axes
        Where to.
    history
        The passes.
    errors
        The exact error of every pass, in the same norm.
    """
    percent = _in_percent(history)
    number, norms = [step.number for step in history], _norms(history, percent)
    axes.plot(number, [step.estimate for step in history] / norms, "o-", color=BLUE, label=word_for_estimate(history))
    if errors is not None:
        exact = as_reals("errors", errors, {"passes": len(history)})
        axes.plot(number, exact / norms, "s--", color=VERMILION, label="exact error")
        axes.legend()
    counts = sorted({step.mesh.nvertices for step in history})
    axes.set_xlabel(f"relocations, with {' to '.join(map(str, counts[:: max(len(counts) - 1, 1)]))} nodes")
    axes.set(ylabel=_label(history), ylim=(0.0, None))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _rule(axes)


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
    if not 1 <= len(histories) <= len(COLOURS) or not all(histories.values()):
        raise ValueError(f"histories must be one to {len(COLOURS)}, each with a pass; got {len(histories)}.")
    axes = axes_of(ax)
    passes = [step for history in histories.values() for step in history]
    percent = _in_percent(passes)
    drawn = [_points(history, percent) for history in histories.values()]
    for word, (nodes, errors), colour, marker in zip(histories, drawn, COLOURS, MARKERS, strict=False):
        axes.plot(nodes, errors, marker, linestyle="-", color=colour, label=word, zorder=3)
    needed = _draw_slopes(axes, *drawn[0], slope)
    axes.set(xscale="log", yscale="log" if any(np.any(errors > 0.0) for _, errors in drawn) else "linear")
    axes.set(xlim=_span_of(np.concatenate([needed, *(nodes for nodes, _ in drawn)])))
    axes.set(xlabel="nodes N", ylabel=_label(passes), title=f"{word_for_estimate(passes).capitalize()} over nodes")
    _number_axes(axes)
    _rule(axes)
    axes.legend(loc="upper right", fontsize="small")
    return axes


def _number_axes(axes: Axes) -> None:
    """Plain numbers at 1, 2 and 5 of every decade."""
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(ScalarFormatter())
            axis.set_minor_formatter(NullFormatter())


def _points(history: Sequence[Pass], percent: bool) -> tuple[Floats, Floats]:
    """Nodes and estimates of passes, the estimates positive: zero has no logarithm."""
    nodes = np.array([step.mesh.nvertices for step in history], dtype=float)
    errors = [step.estimate for step in history] / _norms(history, percent)
    return nodes, np.where(errors > 0.0, errors, np.nan)


def _in_percent(history: Sequence[Pass]) -> bool:
    return all(energy_error(step) is not None for step in history)


def _label(history: Sequence[Pass]) -> str:
    if word_for_estimate(history) == "indicator":
        return "indicator"
    return ERROR if _in_percent(history) else "energy error"


def _norms(history: Sequence[Pass], percent: bool) -> Floats:
    """What errors are divided by: a hundredth of the energy norm, or nothing."""
    return np.array([0.01 * (step.energy_norm or 1.0) if percent else 1.0 for step in history])


def _span_of(nodes: Floats) -> tuple[float, float]:
    """Ends of the axis: all the nodes, some room, and at least a factor."""
    low, high = nodes.min() / 1.3, nodes.max() * 1.3
    room = max(1.0, SPREAD * low / high) ** 0.5
    return float(low / room), float(high * room)


def _draw_slopes(axes: Axes, nodes: Floats, errors: Floats, slope: float) -> Floats:
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


def plot_qualities(meshes: Mapping[str, Mesh], *, ax: Axes | None = None) -> Axes:
    """Plot how many elements have which quality, in per cent of all elements of their mesh.

    Parameters
    ----------
    meshes
        Word to mesh, for instance ``{"before": mesh, "after": result.mesh}``; at most three.
    ax
        Where to; None for a new figure.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If there are none or more than three.
    """
    if not 1 <= len(meshes) <= len(STYLES):
        raise ValueError(f"meshes must be one to {len(STYLES)}; got {len(meshes)}. Plot the others in another figure.")
    axes = axes_of(ax)
    for (word, mesh), (colour, style) in zip(meshes.items(), STYLES, strict=False):
        values = quality(mesh)
        label = f"{word}: worst {values.min():.2f}, mean {values.mean():.2f}"
        share = 100.0 / len(values) * np.histogram(values, BINS)[0]
        axes.stairs(share, BINS, fill=True, color=colour, alpha=0.15)
        axes.stairs(share, BINS, color=colour, linestyle=style, linewidth=1.6, label=label)
    axes.set(xlabel="quality of an element (1: regular, 0: flat)", ylabel="share of the elements (%)")
    axes.set(xlim=(0.0, 1.0), title="Quality of the elements")
    axes.legend(loc="upper left", frameon=False)
    _rule(axes)
    return axes


def plot_density(
    mesh: Mesh, density: ArrayLike, *, plane: CutBy | None = None, ax: Axes | None = None, unit: str = "m"
) -> Axes:
    """Colour every element by the density of nodes that is asked for there, on a logarithmic scale.

    Parameters
    ----------
    mesh
        The mesh.
    density
        (nelements,), nodes per area or volume in mesh units, as `kohonen_adapt.density_from_indicators` gives them:
        over the mesh they integrate to its number of nodes.
    plane
        Where tetrahedra are cut, a `kohonen_adapt.Plane`.
    ax
        Where to; None for a new figure.
    unit
        Unit of lengths, "m", "mm" or ""; the density is shown per square or cube of it.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `density` has another shape, the unit is unknown, or the plane does not go with the mesh.
    """
    axes = axes_of(ax, height=5.0)
    shown = as_reals("density", density, {"nelements": mesh.t.shape[1]}) / in_unit(unit) ** len(mesh.p)
    low, high = _scale_of(shown)
    norm = LogNorm(low, high) if low < high else Normalize(0.0, high)
    shades = draw_indicators(axes, mesh, shown, norm=norm, plane=plane, unit=unit)
    power, size = {2: ("²", "area"), 3: ("³", "volume")}[len(mesh.p)]
    label = f"nodes asked for per {unit}{power}" if unit else f"nodes asked for per unit of {size}"
    axes.figure.colorbar(shades, ax=axes, label=label, extend="min" if shown.min() < low < high else "neither")
    axes.set_title("Density of nodes asked for")
    return axes


def _scale_of(density: Floats) -> tuple[float, float]:
    """The ends of the scale: all there is, but some decades at most; the same twice where there is nothing to scale."""
    high = float(density.max(initial=0.0)) or 1.0
    low = float(density.min(initial=high, where=density > 0.0))
    return max(low, 10.0**-DECADES * high), high


def plot_bh(law: Law, ax: Axes | None = None) -> Axes:
    """Plot a magnetisation curve, B over H, from 1 % of the saturation up to where dB/dH is nearly mu0.

    Parameters
    ----------
    law
        The law; of a `Table` with its points.
    ax
        Where to; None for a new figure.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import Brauer
    >>> from kohonen_adapt.plotting import plot_bh
    >>> plot_bh(Brauer(k1=50.0, k2=10.0, k3=1.5)).figure.savefig("brauer.png")
    """
    axes = axes_of(ax)
    b = np.linspace(0.0, 4.0, 4001)
    saturated = np.flatnonzero(law.slope(b) > SATURATED / VACUUM_PERMEABILITY)
    b = np.linspace(0.01, 1.03, 800) * (b[saturated[0]] if saturated.size else b[-1])
    axes.plot(law.field_strength(b), b, color=BLUE)
    if isinstance(law, Table):
        points = np.array(law.points)[1:]
        axes.plot(points[:, 1], points[:, 0], "o", color=VERMILION, markersize=4, label="points of the table")
        axes.legend()
    axes.set(xscale="log", xlabel="field strength H (A/m)", ylabel="flux density B (T)", ylim=(0.0, None))
    _rule(axes)
    return axes


def axes_of(given: Axes | None, *, height: float = 4.4) -> Axes:
    """The axes that were given, or those of a new figure; inches."""
    return Figure(figsize=(6.4, height), dpi=160, layout="constrained").subplots() if given is None else given


def _rule(axes: Axes) -> None:
    """Pale lines behind what is drawn."""
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
