"""Give back what the loop found: the best pass, its solution, and how the loop got there."""

from dataclasses import dataclass, field
from html import escape
from typing import Any

from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.table import html_table, table_lines

__all__ = ["AdaptResult"]


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """The best pass of a loop and how the loop got there; ``print(result)`` and a notebook show a table.

    Attributes
    ----------
    mesh
        The mesh of the best pass.
    solution
        What the problem's ``solve`` returned for it.
    indicators
        (nelements,), what its ``indicators`` returned, unsquared.
    estimate
        Square root of the sum of the squared indicators.
    history
        Every pass in order; ``history[0]`` is the input.
    status
        How the loop ended.
    message
        One sentence: how it ended and what to do.
    nodes
        (nnodes,), index in the input mesh of every node, -1 for a new one.
    error
        The exception that ended the loop if ``status`` is ``FAILED``, else None.
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
        """The pass that is the result."""
        return next(step for step in self.history if step.mesh is self.mesh)

    def __str__(self) -> str:
        marks = ["  <- result" if step is self.best else "" for step in self.history]
        return "\n".join([*table_lines(self.history, marks), self.message])

    def _repr_html_(self) -> str:
        """The table, for notebooks."""
        bold = [' style="font-weight: bold"' * (step is self.best) for step in self.history]
        return f"{html_table(self.history, bold)}\n<p>The result is the pass in bold. {escape(self.message)}</p>"
