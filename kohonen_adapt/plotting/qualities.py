"""A picture of the quality of elements, one histogram over another."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from skfem import MeshTri

from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.plotting.drawing import BLUE, VERMILION

__all__ = ["plot_qualities"]

BINS = np.linspace(0.0, 1.0, 41)
STYLES = ((BLUE, "solid"), (VERMILION, "dashed"), ("black", "dotted"))
"""Colours that the colour-blind tell apart, and lines that a grey print does."""


def plot_qualities(meshes: Mapping[str, MeshTri], *, ax: Axes | None = None) -> Axes:
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
    axes = Figure(figsize=(6.4, 4.4), dpi=160, layout="constrained").subplots() if ax is None else ax
    for (word, mesh), (colour, style) in zip(meshes.items(), STYLES, strict=False):
        values = quality(mesh)
        label = f"{word}: worst {values.min():.2f}, mean {values.mean():.2f}"
        share = 100.0 / len(values) * np.histogram(values, BINS)[0]
        axes.stairs(share, BINS, fill=True, color=colour, alpha=0.15)
        axes.stairs(share, BINS, color=colour, linestyle=style, linewidth=1.6, label=label)
    axes.set(xlabel="quality of an element (1: equilateral, 0: flat)", ylabel="share of the elements (%)")
    axes.set(xlim=(0.0, 1.0), title="Quality of the elements")
    axes.legend(loc="upper left", frameon=False)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    return axes
