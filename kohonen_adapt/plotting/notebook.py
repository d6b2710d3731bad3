"""The picture that a notebook shows of a result: small, whatever the mesh."""

from collections.abc import Sequence
from io import BytesIO

from matplotlib.figure import Figure
from skfem import MeshTri

from kohonen_adapt.plotting.drawing import draw_mesh
from kohonen_adapt.plotting.passes import SolvedPass, draw_passes

__all__ = ["overview_png"]


def overview_png(before: MeshTri, after: MeshTri, history: Sequence[SolvedPass]) -> bytes:
    """The mesh before and after and the estimate over the passes side by side, as a PNG of less than 200 kB.

    Parameters
    ----------
    before, after
        The input and the mesh of the result.
    history
        The passes.

    Returns
    -------
    bytes
        The content of a PNG file.
    """
    figure = Figure(figsize=(10.0, 3.4), dpi=90, layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, word, mesh in zip(panels, ("before", "after"), (before, after), strict=False):
        draw_mesh(axes, mesh, unit="")
        axes.locator_params(nbins=4)  # so that the numbers have room
        axes.set_title(f"Mesh {word}: {mesh.p.shape[1]} nodes")
    draw_passes(panels[2], history)
    panels[2].set_title("Estimate over the passes")
    content = BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()
