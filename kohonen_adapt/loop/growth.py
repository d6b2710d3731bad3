"""Node counts of the passes of an adaptive loop."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, inf

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import is_count
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.mesh.cells import TETRAHEDRON

MAX_NODES = 200_000  # largest mesh of a run with a tolerance, unless another is given
AIM = 0.9  # of the tolerance, because the error of adapted meshes is up to 1.15 times the estimate
# The same at order 3, where corners need more elements than predicted: with 0.9 runs take 1.15 times as long, with as
# many unknowns.
AIM_AT_ORDER_3 = 0.83
MAX_FACTOR = 3.0  # of the number of nodes per pass: the prediction from an ungraded mesh is coarse
# Least growth on tetrahedra of order 2 after a pass with a growth by GREW, if the error requires as much.
REGROWN = 1.25
# Least factor of the number of nodes after the second pass, if the prediction called that large enough. Its power rises
# by one from pass to pass, because the prediction has failed more often.
MISSED = 1.1
# Largest number of nodes in the first pass, as a multiple of the predicted number for the estimate of the input. More
# nodes on an ungraded mesh, as on M to 0.1 % at order 2, take half as long again (`python -m benchmarks error`).
FIRST = 10.0
# Ratio of a squared indicator to the mean, from which an element has an error that nodes elsewhere do not lower.
CONCENTRATED = 100.0
GREW = 1.5  # growth of a pass, from which the next gains much by placing the new nodes

# Least number of nodes for the estimate of the last pass, and largest factor of the last pass. With fewer nodes or a
# larger factor the polish does not always correct misplaced nodes. Another pass: 1.4 to 1.9 times the time.
MIN_PLACING_NODES = 500
MAX_LAST_FACTOR = 3
# Recycling by energy at order 2 on tetrahedra keeps the number of unknowns, so the number of nodes changes.
DRIFT = 0.1


@dataclass(frozen=True)
class Growth:
    """Geometric growth from `start` to `target` nodes.

    The estimate on the mesh of the last pass but one, with `placing` nodes, places the nodes of the last pass.

    Attributes
    ----------
    start, placing, target
        Number of nodes of the input, of the last pass but one, and of the last pass.
    passes
        Maximum number of passes.
    """

    start: int
    placing: int
    target: int
    passes: int

    @classmethod
    def of(cls, start: int, target: int | None, passes: int, corrected: bool) -> "Growth":
        """Return the growth for a target, None for no growth.

        If the polish corrects misplaced nodes (`corrected`), the last pass but one has fewer nodes than the target,
        which saves a pass over all nodes. Raises ValueError if `target` is no integer or less than `start`.
        """
        if target is not None and not is_count(target):
            raise ValueError(f"target_nodes must be an integer >= 0, or None; got {target!r}.")
        if target is not None and target < start:
            raise ValueError(
                f"target_nodes must be at least the number of nodes of the mesh, {start}; got {target}. "
                "Start from a coarser mesh."
            )
        target = start if target is None else int(target)
        if not corrected:
            return cls(start, target, target, passes)
        evenly = round(target * (start / target) ** (1 / max(1, passes)))
        return cls(start, min(target, max(MIN_PLACING_NODES, ceil(target / MAX_LAST_FACTOR), evenly)), target, passes)

    def nodes(self, number: int, polished: bool = True, last: Pass | None = None) -> int:
        """Return the number of nodes of pass `number`, whatever the pass before.

        Without a polish the last pass adds no nodes, because nothing would correct their positions.
        """
        if number >= self.passes:
            return self.target
        placing = self.placing if polished else self.target
        wanted = round(self.start * (placing / self.start) ** (number / max(1, self.passes - 1)))
        return min(self.target, max(wanted, self.start + number))

    def grows_after(self, number: int) -> bool:
        return self.nodes(number) < self.target


@dataclass(frozen=True)
class GrowthByTolerance:
    """Number of nodes for a tolerance, predicted from the indicators.

    Attributes
    ----------
    start, target
        Number of nodes of the input, and the largest number.
    tolerance
        Allowed estimate for a pass.
    order, dim
        Degree of the elements and dimension of the mesh.
    removes
        True if passes may have fewer nodes than the mesh before.
    """

    start: int
    target: int
    tolerance: Callable[[Pass], float | None]
    order: int
    dim: int
    removes: bool

    def nodes(self, number: int, polished: bool, last: Pass) -> int:
        now, aim = int(last.mesh.nvertices), (self.tolerance(last) or 0.0) * (AIM if self.order < 3 else AIM_AT_ORDER_3)
        wanted, drifts = predicted_nodes(last, aim, self.order, self.dim), drift_of_nodes(self.dim, self.order) > 0.0
        if last.number == 0:
            wanted = min(wanted, FIRST * predicted_nodes(last, last.estimate, self.order, self.dim))
        elif last.number > 1 and last.estimate > 0.0 and (drifts or wanted < MISSED * now):
            wanted = max(wanted, self._required_nodes(last, aim, wanted, drifts))
        least = now / MAX_FACTOR if self.removes else now
        return min(self.target, round(min(MAX_FACTOR * now, max(least, wanted))))

    def _required_nodes(self, last: Pass, aim: float, wanted: float, drifts: bool) -> float:
        now = int(last.mesh.nvertices)
        grew = now > GREW * (now - last.splits + last.collapses)
        if grew and not drifts:
            return now
        # If few nodes are new, the next pass gains little by placing, least of all at order 2 on tetrahedra.
        missed = MISSED ** (last.number - 1)
        missing = max(missed, (spread_error(last.indicators) / aim) ** (self.dim / self.order) if aim > 0.0 else inf)
        if grew:
            return max(now * min(missing, REGROWN), (wanted * (now * missing) ** 2) ** (1.0 / 3.0))
        return now * missing

    def grows_after(self, number: int) -> bool:
        return True


NodeCounts = Growth | GrowthByTolerance
"""Node counts to a target or by a tolerance."""


def predicted_nodes(last: Pass, tolerance: float, order: int, dim: int) -> float:
    """Return the number of nodes of a graded mesh whose estimate is `tolerance`.

    An indicator of degree p in d dimensions falls like ``h^(p + d/2)``. If all are equal, ``N = (sum eta^(2d / (d +
    2p)))^((d + 2p) / 2p) / tolerance^(d / p)`` elements suffice (equidistribution); nodes have the ratio of the mesh.
    """
    if tolerance <= 0.0:
        return inf
    power = 2.0 * dim / (dim + 2.0 * order)
    largest = float(last.indicators.max())
    if largest == 0.0:
        return 0.0
    total = float(np.sum((last.indicators / largest) ** power)) ** (2.0 * dim / (order * power) / 2.0)
    elements = total * (largest / tolerance) ** (dim / order)
    return elements * last.mesh.nvertices / len(last.indicators)


def spread_error(indicators: Floats) -> float:
    # Return the estimated error without the elements with far more than the mean, as at strong corners.
    squared = indicators**2
    return float(np.sqrt(np.sum(squared[squared <= CONCENTRATED * squared.mean()])))


def drift_of_nodes(dim: int, order: int) -> float:
    return DRIFT if dim == TETRAHEDRON.dim and order > 1 else 0.0
