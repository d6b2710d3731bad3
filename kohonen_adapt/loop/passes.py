"""Record a pass: the mesh after so many relocations, solved and estimated, in one flat record."""

from dataclasses import dataclass, field
from enum import StrEnum, auto

from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.outline.movable import Work, shown

__all__ = ["Pass", "Status"]


class Status(StrEnum):
    """How the loop ended.

    ``CONVERGED``: the tolerance is met, or every indicator is zero. ``MAX_PASSES``: all passes asked for are done.
    ``STALLED``: no pass improves any more. ``NOT_MOVED``: nothing could move. ``STOPPED``: the callback returned True,
    or Ctrl-C, or it is a result so far. ``FAILED``: an exception after the input mesh was estimated; it stands in
    ``AdaptResult.error``.
    """

    CONVERGED = auto()
    MAX_PASSES = auto()
    STALLED = auto()
    NOT_MOVED = auto()
    STOPPED = auto()
    FAILED = auto()


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Pass(Work):
    """The mesh after ``number`` relocations, solved and estimated; number 0 is the input.

    Table, ``history.csv`` and checkpoints go over the fields of this record.

    Attributes
    ----------
    number
        How many relocations made this mesh.
    mesh
        The mesh.
    indicators
        (nelements,), what the problem's ``indicators`` returned for it, unsquared.
    nodes
        (nnodes,), number in the input mesh of every node, -1 for a new one.
    unknowns
        Number of values that the solution has, given ones included: of order 1 as many as nodes.
    estimate
        Square root of the sum of the squared indicators.
    worth
        What passes are compared by where the functional does not compare: the estimate of the error in the problem's
        norm.
    energy_norm
        Energy norm of the solution, None where the problem gives none.
    calibrated
        Whether the problem vouches for the scale of the estimate, see `Problem`.
    min_quality, mean_quality
        Of the elements: 1 for an equilateral triangle, 0 for a flat one.
    seconds
        Wall time under the keys ``solve`` and ``estimate`` (on this mesh), ``relocate`` and ``polish`` (that made it).
    functional
        Ritz functional of the solution, in the problem's unit of energy; None where there is no polish, or it is for
        shapes only.
    comparable
        Whether its functional may be compared with that of other passes.
    share
        Of the solution in a functional with a dual, that of the first pass, see `Ritz`; None without a dual.
    unpolished
        Why there is no polish, or empty.
    goal, goal_error
        Value of the problem's goal and its estimated error with its sign, of the best pass alone; None without them.
        The square of the estimate is then the sum of the errors of the elements, in the unit of the goal.
    goal_unit
        Unit of the goal's value, or empty.
    sagitta
        Largest distance between curves and their facets, mesh units; 0 for sides that follow them.
    outputs
        Name to value of every output asked for.
    quantization_errors
        Mean distance of the training points to their winners, mesh units, one per epoch of the relocation that made
        this mesh; empty for the input.
    max_displacement
        The farthest that this relocation moved a node, mesh units; 0 for the input.
    moved, why_still
        How many nodes it moved or made; if none, why.
    polish_gain
        What moves, flips and recycling of the polish that made this mesh took off the functional of the solution
        carried to it.
        The map gained the rest of the difference to the pass before.
    splits, collapses
        How often an edge was split and collapsed to make this mesh, by density and by energy.
    """

    number: int
    mesh: Mesh
    indicators: Floats
    nodes: Ints
    unknowns: int
    estimate: float
    worth: float
    energy_norm: float | None = None
    calibrated: bool = False
    min_quality: float = field(metadata=shown("min quality", ".2f"))
    mean_quality: float = field(metadata=shown("mean quality", ".2f"))
    seconds: dict[str, float] = field(default_factory=dict)
    functional: float | None = None
    comparable: bool = False
    share: float | None = None
    unpolished: str = ""
    goal: float | None = None
    goal_error: float | None = None
    goal_unit: str = ""
    sagitta: float = 0.0
    outputs: dict[str, float] = field(default_factory=dict)

    @property
    def shown_estimate(self) -> float:
        """The estimate as tables show it: with a goal its square, which is in the unit of the goal."""
        return self.estimate if self.goal is None else self.estimate**2

    @property
    def estimate_text(self) -> str:
        """The shown estimate with four digits and its unit."""
        return f"{self.shown_estimate:.4g} {self.goal_unit}".rstrip()

    def __repr__(self) -> str:
        nodes, least = self.mesh.nvertices, self.min_quality
        return f"<Pass {self.number}: estimate {self.estimate_text}, {nodes} nodes, min quality {least:.2f}>"
