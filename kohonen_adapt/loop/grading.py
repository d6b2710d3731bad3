"""Tolerance of the passes at order 2 before a solve of a higher order."""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from kohonen_adapt.loop.growth import predicted_nodes
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Tolerance
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE
from kohonen_adapt.problem.protocol import OF_PASSES

DIRECT = 0.5  # fraction of this error from which a tolerance is met by passes alone
OF_GOAL = 10.0  # tolerance of passes for goals, as a multiple of the tolerance of the estimate


class Raise(NamedTuple):
    """Solve of a higher order after the passes.

    Attributes
    ----------
    order, layers
        Order of the elements, and number of layers at corners or edges.
    gain
        Error at order 2 over the error of this order, on a mesh of the former error with layers.
    """

    order: int
    layers: int
    gain: float


@dataclass(frozen=True)
class HighOrders:
    """Gains of high orders on layers, in the plane or in space.

    Attributes
    ----------
    graded
        Relative error at order 2 of a mesh that is graded well enough for higher orders.
    enough
        Relative error up to which no pass follows: one order more takes less time than a pass that only adds nodes.
    raises
        Solves that may follow the passes, the quickest first.
    aim
        Estimate that a pass aims at, over the estimate that suffices.
    most
        Gain that passes count on. More nodes take less time than an order with a larger gain.
    smooth
        Power of the gains of a smooth solution, whose mesh has no layers.
    few
        Nodes at order 2 that take less time for a goal than a higher order, relative to the nodes of the last pass,
        before a mesh with layers is known.
    by_nodes
        Estimate of a raised order over the tolerance, up to which more nodes take less time than the next order.
    """

    graded: float
    enough: float
    raises: tuple[Raise, ...]
    aim: float
    most: float = inf
    smooth: float = 1.0
    few: float = 0.0
    by_nodes: float = 0.0

    def within(self, orders: range) -> list[Raise]:
        """Return the solves at the given orders.

        A single order need not be one of the table.
        """
        return [each for each in self.raises if each.order in orders] or [self.raises[-1]._replace(order=orders[-1])]

    def after(self, orders: range, before: Raise, missing: float, on_layers: bool) -> Raise | None:
        """Return the solve after another, None after the last.

        `missing` is the estimate of the solve `before`, over the tolerance.
        """
        known = [
            each for each in self.within(orders) if each.order > before.order or (on_layers and each[:2] > before[:2])
        ]
        return next((each for each in known if each.gain > missing * before.gain), known[-1] if known else None)

    def least(self, orders: range, wanted: float, smooth: bool = False) -> Raise:
        """Return the quickest that gains more than `wanted`, or the last one."""
        power, known = self.smooth if smooth else 1.0, self.within(orders)
        return next((each for each in known if each.gain**power > wanted), known[-1])


HIGH_ORDERS = {
    TRIANGLE.dim: HighOrders(  # C-core, 211 nodes
        graded=0.019,
        enough=0.03,
        raises=(Raise(4, 2, 8.0), Raise(5, 2, 17.0), Raise(6, 3, 34.0), Raise(7, 3, 60.0), Raise(8, 4, 100.0)),
        aim=0.8,
    ),
    # Fichera's corner, an L-shaped edge and a magnet under iron, 110 to 980 nodes: 7.5 to 10.5, 10.5 to 12, 17 to 32
    # and 24 to 57; a cube, 70 and 181 nodes: 19 to 26, 49 to 65 and 99 to 136. An order takes a quarter to a half of
    # the time of the next, so that a gain that is too large costs less than one that is too small. A block of iron on
    # 109 nodes gains 5 to 15: to .3, .5 and .7 % the next order in place of nodes takes more than 5, 2.7 and 1.5 times
    # as long. On Fichera's corner both take the same time.
    TETRAHEDRON.dim: HighOrders(
        graded=0.075,
        enough=0.15,
        raises=(Raise(4, 1, 10.5), Raise(4, 2, 11.5), Raise(5, 2, 25.0), Raise(6, 2, 30.0)),
        aim=1.1,
        most=25.0,
        smooth=1.27,
        few=6.5,
        by_nodes=2.5,
    ),
}


@dataclass
class GradingTolerance:
    """Tolerance of the passes at order 2, lowered if higher orders do not suffice.

    Attributes
    ----------
    tolerance
        Tolerance of the result.
    orders
        Orders for the result.
    high
        What these orders bring.
    relative
        Tolerance of the passes, relative to the energy norm, or to the tolerance of a goal.
    most
        Nodes at order 2 with the unknowns of the last mesh with layers, None before the first and without a goal.
    """

    tolerance: Tolerance
    orders: range
    high: HighOrders
    relative: float | None = None
    most: float | None = None

    def __call__(self, last: Pass) -> float | None:
        return self._within(last, self.high.enough)

    def _within(self, last: Pass, enough: float) -> float | None:
        tolerance = self.tolerance.estimate(last)
        if tolerance is None or self._needs_few(last, tolerance):
            return tolerance
        if last.energy_norm is None:
            return max(1.0, OF_GOAL if self.relative is None else self.relative) * tolerance
        aim, graded = (self.high.graded, enough) if self.relative is None else (self.relative,) * 2
        if tolerance > DIRECT * aim * last.energy_norm:
            return tolerance
        gain = min(self.high.most, self.high.within(self.orders)[-1].gain)
        return min(graded * last.energy_norm, gain ** (self.high.smooth if last.smooth else 1.0) * tolerance)

    def _needs_few(self, last: Pass, tolerance: float) -> bool:
        # True if order 2 meets the tolerance of a goal with few nodes, and no higher order is prescribed. Without a
        # goal passes at order 2 take 1.1 to 2.8 times as long, for tolerances of 1 to 3 %.
        if len(self.orders) == 1 or last.goal is None or self.high.few == 0.0:
            return False
        most = self.high.few * last.mesh.nvertices if self.most is None else self.most
        return predicted_nodes(last, tolerance, OF_PASSES, last.mesh.dim()) < most

    def prefers_nodes(self, best: Pass, unknowns: int) -> bool:
        """Return True if order 2 takes fewer unknowns for a goal than a mesh with layers.

        Solutions of the next order and of duals take six times as long as the solution of a high order.
        """
        tolerance = self.tolerance.estimate(best)
        if best.goal is None or tolerance is None:
            return False
        self.most = unknowns * best.mesh.nvertices / best.unknowns
        return self._needs_few(best, tolerance)

    def aim(self, last: Pass) -> float | None:
        # Return the estimate that passes aim at, to meet the tolerance at once.
        tolerance = self._within(last, self.high.graded)
        return tolerance and (tolerance if tolerance == self.tolerance.estimate(last) else self.high.aim * tolerance)

    def lower(self, last: Pass, factor: float) -> None:
        unit = last.energy_norm if last.energy_norm is not None else self.tolerance.estimate(last)
        self.relative = factor * last.estimate / unit if unit else 0.0
