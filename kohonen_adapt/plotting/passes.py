"""The estimate over the passes."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from skfem import MeshTri

from kohonen_adapt.display import one_per
from kohonen_adapt.plotting.drawing import BLUE, VERMILION

__all__ = ["SolvedPass", "draw_passes"]


class SolvedPass(Protocol):
    """What of a `kohonen_adapt.Pass` is drawn."""

    @property
    def number(self) -> int:
        """How many relocations made its mesh."""

    @property
    def mesh(self) -> MeshTri:
        """The mesh."""

    @property
    def estimate(self) -> float:
        """Of its error."""

    @property
    def energy_norm(self) -> float | None:
        """Of its solution."""


def draw_passes(axes: Axes, history: Sequence[SolvedPass], *, errors: Sequence[float] | None = None) -> None:
    """Draw the estimate over the passes, in per cent of the energy norm where every pass has one.

    Parameters
    ----------
    axes
        Where to.
    history
        The passes.
    errors
        The exact error of every pass, in the same norm.
    """
    norms = [step.energy_norm for step in history]
    percent = all(norms)
    scale = np.array([100.0 / norm if percent and norm else 1.0 for norm in norms])
    number = [step.number for step in history]
    axes.plot(number, scale * [step.estimate for step in history], "o-", color=BLUE, label="estimate")
    if errors is not None:
        exact = scale * one_per(len(history), errors, "errors", "passes")
        axes.plot(number, exact, "s--", color=VERMILION, label="exact error")
        axes.legend()
    counts = sorted({step.mesh.p.shape[1] for step in history})
    axes.set_xlabel(f"relocations, with {' to '.join(map(str, counts[:: max(len(counts) - 1, 1)]))} nodes")
    axes.set_ylabel("energy error (% of the energy norm)" if percent else "energy error")
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
