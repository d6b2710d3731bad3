"""Result of an adaptive loop."""

from dataclasses import dataclass, field
from html import escape
from typing import Any

from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.loop.figures import OutputValue, values_of
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.table import html_table, table_lines


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """Best pass of an adaptive loop, with the history of all passes.

    ``print(result)`` and notebooks show the history as a table.

    Attributes
    ----------
    mesh
        Mesh of the best pass.
    solution
        Solution on this mesh, as returned by the problem's ``solve``.
    indicators
        Unsquared indicators of this solution, shape (nelements,).
    estimate
        Square root of the sum of the squared indicators. Within `rtol` or `atol` it includes what sides miss of their
        curves at orders 2 and 3.
    history
        All passes in order. ``history[0]`` is the input.
    status
        Reason for the end of the loop.
    message
        Reason for the end of the loop, best pass and advice, as text.
    nodes
        Index in the input mesh of every node, -1 for a new node, shape (nnodes,).
    error
        Exception that ended the loop if ``status`` is ``FAILED``, else None.
    """

    mesh: Mesh = field(repr=False)
    solution: Any = field(repr=False)
    indicators: Floats = field(repr=False)
    estimate: float
    history: tuple[Pass, ...] = field(repr=False)
    status: Status
    message: str
    nodes: Ints = field(repr=False)
    error: Exception | None = None

    @property
    def best(self) -> Pass:
        """Pass that is the result."""
        return next(step for step in self.history if step.mesh is self.mesh)

    @property
    def outputs(self) -> dict[str, OutputValue]:
        """Outputs of the best pass by name, and the goal under "goal"."""
        return values_of(self.best)

    def __str__(self) -> str:
        marks = ["  <- best" if step is self.best else "" for step in self.history]
        return "\n".join([*table_lines(self.history, marks), self.message])

    def _repr_html_(self) -> str:
        bold = [' style="font-weight: bold"' * (step is self.best) for step in self.history]
        return f"{html_table(self.history, bold)}\n<p>The best pass is in bold. {escape(self.message)}</p>"
