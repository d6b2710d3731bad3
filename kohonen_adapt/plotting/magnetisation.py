"""Pictures of magnetic laws."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kohonen_adapt.magnetostatics import Law, Table
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.plotting.drawing import BLUE, VERMILION

__all__ = ["plot_bh"]

SATURATED = 0.9  # share of the slope of vacuum at which a magnetisation curve has been seen


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
    axes = Figure(figsize=(6.4, 4.4), dpi=160, layout="constrained").subplots() if ax is None else ax
    b = np.linspace(0.0, 4.0, 4001)
    saturated = np.flatnonzero(law.slope(b) > SATURATED / VACUUM_PERMEABILITY)
    b = np.linspace(0.01, 1.03, 800) * (b[saturated[0]] if saturated.size else b[-1])
    axes.plot(law.field_strength(b), b, color=BLUE)
    if isinstance(law, Table):
        points = np.array(law.points)[1:]
        axes.plot(points[:, 1], points[:, 0], "o", color=VERMILION, markersize=4, label="points of the table")
        axes.legend()
    axes.set(xscale="log", xlabel="field strength H (A/m)", ylabel="flux density B (T)", ylim=(0.0, None))
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    return axes
