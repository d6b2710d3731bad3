"""Tolerance of the passes at order 2 before a solve of a higher order."""

from collections.abc import Mapping
from dataclasses import dataclass

from kohonen_adapt.loop.growth import predicted_nodes
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Tolerance
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE
from kohonen_adapt.problem.protocol import OF_PASSES

DIRECT = 0.5  # fraction of this error from which a tolerance is met by passes alone
OF_GOAL = 10.0  # tolerance of passes for goals, as a multiple of the tolerance of the estimate
SAFE = 0.8  # of the tolerance of passes before a higher order


@dataclass(frozen=True)
class HighOrders:
    """Gains of high orders on layers, in the plane or in space.

    Attributes
    ----------
    graded
        Relative error at order 2 of a mesh that is graded well enough for higher orders.
    enough
        Relative error up to which no pass follows: one order more takes less time than a pass that only adds nodes.
    gains
        Error at order 2 over the error of a higher order, on a mesh of the former error with layers.
    orders_per_layer
        Order of the elements, over the number of layers.
    smooth
        Power of the gains of a smooth solution, whose mesh has no layers.
    few
        Nodes at order 2 that take less time than a higher order, relative to the nodes of the last pass, before a mesh
        with layers is known.
    """

    graded: float
    enough: float
    gains: Mapping[int, float]
    orders_per_layer: float
    few: float = 0.0
    smooth: float = 1.0

    def gain(self, order: int) -> float:
        return self.gains[min(order, max(self.gains))]

    def least_order(self, orders: range, wanted: float, power: float = 1.0) -> int:
        return next((order for order in orders if self.gain(order) ** power > wanted), orders[-1])

    def layers(self, order: int) -> int:
        return int(order / self.orders_per_layer)


HIGH_ORDERS = {
    TRIANGLE.dim: HighOrders(0.019, 0.03, {4: 8.0, 5: 17.0, 6: 34.0, 7: 60.0, 8: 100.0}, 2.0),  # C-core, 211 nodes
    # Fichera's corner, an L-shaped edge and a magnet under iron, 110 to 980 nodes: 7.5 to 10.5, 19 to 32 and 24 to 43;
    # a cube, 70 and 181 nodes: 19 to 26, 49 to 65 and 99 to 136. An order takes a quarter to a half of the time of the
    # next, so that a gain that is too large costs less than one that is too small.
    TETRAHEDRON.dim: HighOrders(0.1, 0.15, {4: 10.5, 5: 25.0, 6: 30.0}, 2.5, 6.5, 1.27),
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
        return min(graded * last.energy_norm, self.high.gain(self.orders[-1]) * tolerance)

    def _needs_few(self, last: Pass, tolerance: float) -> bool:
        # True if order 2 meets the tolerance with few nodes, and no higher order is prescribed
        if len(self.orders) == 1 or self.high.few == 0.0:
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
        return tolerance and (tolerance if tolerance == self.tolerance.estimate(last) else SAFE * tolerance)

    def lower(self, last: Pass, factor: float) -> None:
        unit = last.energy_norm if last.energy_norm is not None else self.tolerance.estimate(last)
        self.relative = factor * last.estimate / unit if unit else 0.0
