"""A picture of how many nodes are asked for where."""

from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.display import in_unit, one_per
from kohonen_adapt.plotting.drawing import draw_indicators

__all__ = ["plot_density"]

DECADES = 5
"""How far below the largest density the colours reach at most."""


def plot_density(mesh: MeshTri, density: ArrayLike, *, ax: Axes | None = None, unit: str = "m") -> Axes:
    """Colour every element by the density of nodes that is asked for there, on a logarithmic scale.

    Parameters
    ----------
    mesh
        The mesh.
    density
        (nelements,), nodes per area in mesh units, as `kohonen_adapt.density_from_indicators` gives them: over the mesh
        they integrate to its number of nodes.
    ax
        Where to; None for a new figure.
    unit
        Unit of lengths, "m", "mm" or ""; the density is shown per square of it.

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `density` has another shape or the unit is unknown.
    """
    axes = Figure(figsize=(6.4, 5.0), dpi=160, layout="constrained").subplots() if ax is None else ax
    shown = one_per(mesh.t.shape[1], density, "density", "nelements") / in_unit(unit) ** 2
    low, high = _ends(shown)
    norm = LogNorm(low, high) if low < high else Normalize(0.0, high)
    shades = draw_indicators(axes, mesh, shown, norm=norm, unit=unit)
    label = f"nodes asked for per {unit}²" if unit else "nodes asked for per unit of area"
    axes.figure.colorbar(shades, ax=axes, label=label, extend="min" if shown.min() < low < high else "neither")
    axes.set_title("Density of nodes asked for")
    return axes


def _ends(density: Floats) -> tuple[float, float]:
    """The ends of the scale: all there is, but some decades at most; the same twice where there is nothing to scale."""
    high = float(density.max(initial=0.0)) or 1.0
    low = float(density.min(initial=high, where=density > 0.0))
    return max(low, 10.0**-DECADES * high), high
