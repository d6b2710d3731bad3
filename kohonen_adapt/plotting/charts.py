"""Charts of estimates, element qualities, densities and magnetisation curves."""

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

from kohonen_adapt.arrays import Floats, FloatsPair
from kohonen_adapt.checks import as_reals
from kohonen_adapt.display import in_unit
from kohonen_adapt.loop.figures import are_in_percent, estimate_word, word_for_estimate
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.magnetostatics.materials.bh_table import Table
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY, Law
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.plotting.drawing import COLOURS, draw_indicators

__all__ = ["axes_of", "draw_passes", "plot_bh", "plot_convergence", "plot_density", "plot_qualities"]

BLUE, VERMILION = COLOURS[:2]
MARKERS = ("o", "s", "^", "D", "v", "P")  # one for each of the colours, for prints without colour
ERROR = "energy-norm error (%)"
SPREAD = 6.0  # minimum ratio of the limits of the axis of nodes
BINS = np.linspace(0.0, 1.0, 41)
STYLES = ((BLUE, "solid"), (VERMILION, "dashed"), ("black", "dotted"))  # of histograms of quality
DECADES = 5  # maximum range of the colours, below the largest density
SATURATED = 0.9  # fraction of dH/dB = 1/mu0 at which a magnetisation curve ends


def draw_passes(axes: Axes, history: Sequence[Pass], *, errors: Sequence[float] | None = None) -> None:
    """Draw the estimate over the passes.

    The unit is per cent of the energy norm if the estimates are calibrated and every pass has an energy norm,
    and the unit of the goal if there is one.

    Parameters
    ----------
    axes
        Axes to draw on.
    history
        The passes.
    errors
        The exact error of every pass, in the same norm.
    """
    percent = are_in_percent(history)
    number, norms = [step.number for step in history], _norms(history, percent)
    estimates = np.array([step.shown_estimate for step in history])
    axes.plot(number, estimates / norms, "o-", color=BLUE, label=estimate_word(history))
    if errors is not None:
        exact = as_reals("errors", errors, {"passes": len(history)})
        axes.plot(number, exact / norms, "s--", color=VERMILION, label="exact error")
        axes.legend()
    counts = sorted({step.mesh.nvertices for step in history})
    last = f", then order {history[-1].order}" if history[-1].order != history[0].order else ""
    axes.set_xlabel(f"relocations, with {' to '.join(map(str, counts[:: max(len(counts) - 1, 1)]))} nodes{last}")
    axes.set(ylabel=_label(history), ylim=(0.0, None))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _rule(axes)


def plot_convergence(histories: Mapping[str, Sequence[Pass]], *, slope: float = -0.5, ax: Axes | None = None) -> Axes:
    """Plot the estimate of every pass over the number of nodes, on logarithmic axes.

    Grey lines of the slope ``N ** slope`` run through the first and the best pass of the first history, without passes
    of another order than the first. The best pass has the smallest estimate times ``N ** -slope``. If both have equal
    numbers of nodes, a circle marks the number of nodes at which the first line reaches the error of the best pass.

    Parameters
    ----------
    histories
        Mapping from label to passes, for instance ``{"adapted": result.history}``; at most six.
    slope
        Slope of the reference lines. The best rate of the energy-norm error in the plane is -1/2 for P1 elements and -1
        for P2, and the rate of the error of a goal is twice that.
    ax
        Axes to draw on; None creates a figure.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `histories` is empty or has more than six entries, or if one of them has no pass.
    """
    if not 1 <= len(histories) <= len(COLOURS) or not all(histories.values()):
        raise ValueError(f"histories must be one to {len(COLOURS)}, each with a pass; got {len(histories)}.")
    axes = axes_of(ax)
    passes = [step for history in histories.values() for step in history]
    percent = are_in_percent(passes)
    drawn = [_points(history, percent) for history in histories.values()]
    for word, (nodes, errors), colour, marker in zip(histories, drawn, COLOURS, MARKERS, strict=False):
        axes.plot(nodes, errors, marker, linestyle="-", color=colour, label=word, zorder=3)
    first, (nodes, errors) = next(iter(histories.values())), drawn[0]
    of_one_order = [step.order == first[0].order for step in first]
    needed = _draw_slopes(axes, nodes[of_one_order], errors[of_one_order], slope)
    axes.set(xscale="log", yscale="log" if any(np.any(errors > 0.0) for _, errors in drawn) else "linear")
    every = np.concatenate([needed, *(nodes for nodes, _ in drawn)])
    low, high = every.min() / 1.3, every.max() * 1.3
    margin = max(1.0, SPREAD * low / high) ** 0.5
    axes.set(xlim=(low / margin, high * margin))
    axes.set(xlabel="nodes N", ylabel=_label(passes), title=f"{estimate_word(passes).capitalize()} over nodes")
    _number_axes(axes)
    _rule(axes)
    axes.legend(loc="upper right", fontsize="small")
    return axes


def _number_axes(axes: Axes) -> None:
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(ScalarFormatter())
            axis.set_minor_formatter(NullFormatter())


def _points(history: Sequence[Pass], percent: bool) -> FloatsPair:
    nodes = np.array([step.mesh.nvertices for step in history], float)
    errors = np.array([step.shown_estimate for step in history]) / _norms(history, percent)
    return nodes, np.where(errors > 0.0, errors, np.nan)


def _label(history: Sequence[Pass]) -> str:
    if are_in_percent(history):
        return ERROR
    calibrated = all(step.calibrated for step in history)
    return "energy-norm error" if calibrated else word_for_estimate(history)


def _norms(history: Sequence[Pass], percent: bool) -> Floats:
    return np.array([0.01 * (step.energy_norm or 1.0) if percent else 1.0 for step in history])


def _draw_slopes(axes: Axes, nodes: Floats, errors: Floats, slope: float) -> list[float]:
    positive = np.flatnonzero(errors > 0.0)
    if not positive.size:
        return []
    first, best = int(positive[0]), int(positive[np.argmin(errors[positive] * nodes[positive] ** -slope)])
    _draw_slope(axes, (nodes[first], errors[first]), slope, (0, (5, 3)), "first pass")
    if best == first:
        return []
    _draw_slope(axes, (nodes[best], errors[best]), slope, "dotted", "best pass")
    if nodes[best] != nodes[first]:
        return []
    needed = nodes[first] * (errors[best] / errors[first]) ** (1.0 / slope)
    axes.plot([nodes[best], needed], [errors[best]] * 2, color="0.45", linewidth=0.8, zorder=1)
    label = f"the error of the best at $N^{{{slope:g}}}$: {needed:.4g} nodes"
    axes.plot(needed, errors[best], "o", color="0.3", markerfacecolor="white", label=label, zorder=3)
    return [needed]


def _draw_slope(axes: Axes, through: tuple[float, float], slope: float, style: Any, where: str) -> None:
    factors = np.array([1e-6, 1e6])
    x, y = through[0] * factors, through[1] * factors**slope
    label = f"$N^{{{slope:g}}}$ through the {where}"
    axes.add_artist(Line2D(x, y, color="0.45", linestyle=style, label=label, zorder=1))


def plot_qualities(meshes: Mapping[str, Mesh], *, ax: Axes | None = None) -> Axes:
    """Plot a histogram of element qualities, in per cent of the elements.

    Parameters
    ----------
    meshes
        Mapping from label to mesh, for instance ``{"before": mesh, "after": result.mesh}``; at most three.
    ax
        Axes to draw on; None creates a figure.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `meshes` is empty or has more than three entries.
    """
    if not 1 <= len(meshes) <= len(STYLES):
        raise ValueError(f"meshes must be one to {len(STYLES)}; got {len(meshes)}. Plot the others in another figure.")
    axes = axes_of(ax)
    for (word, mesh), (colour, style) in zip(meshes.items(), STYLES, strict=False):
        values = quality(mesh)
        label = f"{word}: worst {values.min():.2f}, mean {values.mean():.2f}"
        percent = 100.0 / len(values) * np.histogram(values, BINS)[0]
        axes.stairs(percent, BINS, fill=True, color=colour, alpha=0.15)
        axes.stairs(percent, BINS, color=colour, linestyle=style, linewidth=1.6, label=label)
    axes.set(xlabel="quality of an element (1: regular, 0: flat)", ylabel="share of the elements (%)")
    axes.set(xlim=(0.0, 1.0), title="Quality of the elements")
    axes.legend(loc="upper left", frameon=False)
    _rule(axes)
    return axes


def plot_density(
    mesh: Mesh,
    density: ArrayLike,
    *,
    plane: CutBy | None = None,
    ax: Axes | None = None,
    unit: str = "m",
    axisymmetric: bool = False,
) -> Axes:
    """Colour every element by the density of nodes wanted, on a logarithmic scale.

    Parameters
    ----------
    mesh
        The mesh.
    density
        Nodes per area or volume in mesh units, (nelements,), as returned by `kohonen_adapt.density_from_indicators`.
        The integral over the mesh is its number of nodes.
    plane
        Cutting plane for a mesh of tetrahedra, a `kohonen_adapt.Plane`.
    ax
        Axes to draw on; None creates a figure.
    unit
        Unit of lengths, "m", "mm" or ""; the density is shown per square or cube of this unit.
    axisymmetric
        As in `draw_mesh`.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `density` has the wrong shape, if the unit is unknown, if no plane that cuts the mesh is given for
        tetrahedra, or if a plane is given for triangles.
    """
    axes = axes_of(ax, height=5.0)
    shown = as_reals("density", density, {"nelements": mesh.nelements}) / in_unit(unit) ** len(mesh.p)
    high = float(shown.max(initial=0.0)) or 1.0
    low = max(float(shown.min(initial=high, where=shown > 0.0)), 10.0**-DECADES * high)
    norm = LogNorm(low, high) if low < high else Normalize(0.0, high)
    shades = draw_indicators(axes, mesh, shown, norm=norm, plane=plane, unit=unit, axisymmetric=axisymmetric)
    power, size = {2: ("²", "area"), 3: ("³", "volume")}[len(mesh.p)]
    label = f"nodes asked for per {unit}{power}" if unit else f"nodes asked for per unit of {size}"
    axes.figure.colorbar(shades, ax=axes, label=label, extend="min" if shown.min() < low < high else "neither")
    axes.set_title("Density of nodes asked for")
    return axes


def plot_bh(law: Law, ax: Axes | None = None) -> Axes:
    """Plot a magnetisation curve, B over H.

    The curve runs from 1 % of the saturation flux density to where dB/dH is nearly mu0.

    Parameters
    ----------
    law
        The law. The points of a `Table` are also drawn.
    ax
        Axes to draw on; None creates a figure.

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


def axes_of(axes_or_none: Axes | None, *, height: float = 4.4) -> Axes:
    if axes_or_none is None:
        return Figure(figsize=(6.4, height), dpi=160, layout="compressed").subplots()
    return axes_or_none


def _rule(axes: Axes) -> None:
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
