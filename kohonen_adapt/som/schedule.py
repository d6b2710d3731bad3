"""Schedules of training with rounds of transport, stages of epochs, and sweeps."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import check_count, is_count, is_number

__all__ = ["BEFORE_POLISH", "IN_METRIC", "Schedule", "Stage"]

# More sweeps concentrate nodes too much, which raises the error of later passes, or stretch fixed elements.
SWEEPS = {"flip": 6, "fixed": 4, "recycle": 4}
# Doublings of the first radius at which points are presented, and epochs at each radius above 1.
NEAR = {"flip": (1, 1), "fixed": (2, 3), "recycle": (1, 1)}
ROUNDLESS = 2  # doublings that need no transport, to radius 2 and 4
WIDTH = 1.5  # radius in standard deviations of the Gaussian neighbourhood


@dataclass(frozen=True)
class Stage:
    """Epochs of training with one radius of the neighbourhood.

    Parameters
    ----------
    radius
        Number of rings of neighbours that learn with the winner.
    epochs
        Number of presentations of all training points.
    learning_rate
        Fraction of the distance to the training point by which the winner moves, above 0 and at most 1. A pair (first,
        last) decreases geometrically from the first epoch to the last.
    points_per_neuron
        Number of training points per node and epoch.
    neighbourhood
        ``"gaussian"`` for ``exp(-ring^2 / (2 s^2))`` with s = radius / 1.5, or ``"flat"`` for 1 in all rings, as in the
        paper.

    Raises
    ------
    ValueError
        If a value is out of range.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> stage = ka.Stage(radius=2, epochs=3, learning_rate=(0.4, 0.1))
    >>> stage.rates().round(3).tolist()
    [0.4, 0.2, 0.1]
    """

    radius: int
    epochs: int
    learning_rate: float | tuple[float, float]
    points_per_neuron: float = field(default=2.0, kw_only=True)
    neighbourhood: str = field(default="gaussian", kw_only=True)

    def __post_init__(self) -> None:
        for name in ("radius", "epochs"):
            check_count(f"{name} of a stage", getattr(self, name))
        if not are_two_rates(self._ends()):
            raise ValueError(f"learning_rate must be in (0, 1], one or (first, last); got {self.learning_rate!r}.")
        if not (is_number(self.points_per_neuron) and 0 < self.points_per_neuron < math.inf):
            raise ValueError(f"points_per_neuron must be above zero; got {self.points_per_neuron!r}.")
        if self.neighbourhood not in ("gaussian", "flat"):
            raise ValueError(f"neighbourhood must be 'gaussian' or 'flat'; got {self.neighbourhood!r}.")

    def _ends(self) -> list[float]:
        rate = self.learning_rate
        return list(rate) if isinstance(rate, Iterable) else [rate, rate]

    def rates(self) -> Floats:
        """Return the learning rate of each epoch, shape (epochs,)."""
        first, last = self._ends()
        return np.geomspace(first, last, self.epochs)

    def strength(self) -> Floats:
        """Return the neighbourhood function of rings 0 to `radius`, (radius + 1,)."""
        ring = np.arange(self.radius + 1)
        if self.neighbourhood == "flat" or self.radius == 0:
            return np.ones(len(ring))
        return np.exp(-0.5 * (ring * WIDTH / self.radius) ** 2)


@dataclass(frozen=True)
class Schedule:
    """Rounds of transport, stages of training, and sweeps of smoothing.

    Parameters
    ----------
    stages
        Stages in their order. Without stages, rounds and sweeps no node moves.
    rounds
        Rounds of transport before the stages. All nodes move at once from where training points have too many winners
        to where they have too few, at any distance. The points are counted and not presented. If there are more than
        five rounds, the first are combined: one flow replaces two or more.
    sweeps
        Sweeps of density-weighted smoothing after the stages (`relocate` and `adapt` only), towards the circumcentres
        around each node (optimal Delaunay smoothing) or, with ``topology="fixed"``, towards the barycentres.
    tolerance
        Mean distance of the training points to their winners, in mesh units, below which training ends. None means
        never.
    fresh
        True to draw new training points in every epoch, False to use one set in all epochs, as in the paper.

    Raises
    ------
    ValueError
        If a value is out of range, or `stages` contains anything but stages.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> schedule = ka.Schedule((ka.Stage(2, 5, 0.3), ka.Stage(0, 10, (0.3, 0.02))), sweeps=4)
    >>> sum(stage.epochs for stage in schedule.stages)
    15
    >>> [stage.radius for stage in ka.Schedule.paper().stages]
    [2, 1, 0]
    """

    stages: tuple[Stage, ...]
    rounds: int = field(default=0, kw_only=True)
    sweeps: int = field(default=0, kw_only=True)
    tolerance: float | None = field(default=None, kw_only=True)
    fresh: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.stages, Iterable):
            raise ValueError(
                f"stages must be a sequence of kohonen_adapt.Stage; got {self.stages!r}. Put it in a tuple."
            )
        object.__setattr__(self, "stages", tuple(self.stages))
        wrong = [stage for stage in self.stages if not isinstance(stage, Stage)]
        if wrong:
            raise ValueError(f"stages of a schedule must be kohonen_adapt.Stage; got {wrong[0]!r}.")
        for name in ("rounds", "sweeps"):
            check_count(name, getattr(self, name))
        if self.tolerance is not None and not (is_number(self.tolerance) and self.tolerance >= 0):
            raise ValueError(f"tolerance must be None or >= 0; got {self.tolerance!r}.")

    @classmethod
    def paper(
        cls, epochs: tuple[int, int, int] = (3, 10, 5), learning_rate: tuple[float, float] = (0.3, 0.02)
    ) -> "Schedule":
        """Return the schedule of Lowther and Mai.

        The radius is 2, 1, 0, and one set of two training points per neuron serves all epochs.

        Parameters
        ----------
        epochs
            Number of epochs at radius 2, 1 and 0.
        learning_rate
            Rate of the first and last epoch, between which the rate decreases geometrically.

        Returns
        -------
        Schedule
            Schedule without fresh points and without sweeps.

        Raises
        ------
        ValueError
            If `epochs` are not three integers >= 0, or `learning_rate` are not two numbers in (0, 1].
        """
        if not isinstance(epochs, Iterable) or len(epochs) != 3 or not all(is_count(count) for count in epochs):
            raise ValueError(f"epochs must be three integers >= 0, for radius 2, 1 and 0; got {epochs!r}.")
        if not isinstance(learning_rate, Iterable) or not are_two_rates(learning_rate):
            raise ValueError(f"learning_rate must be (first, last), both in (0, 1]; got {learning_rate!r}.")
        rates = np.geomspace(*learning_rate, max(sum(epochs), 1))
        ends = np.cumsum(epochs)
        stages = [
            Stage(radius, count, (float(rates[end - count]), float(rates[end - 1])), neighbourhood="flat")
            for radius, count, end in zip((2, 1, 0), epochs, ends, strict=True)
            if count
        ]
        return cls(tuple(stages), fresh=False)

    @classmethod
    def default(cls, nnodes: int, *, radius: int | None = None, topology: str = "flip") -> "Schedule":
        """Return the schedule that gave the smallest errors in measurements.

        Nodes first move far, then near, and at the end the mesh is smoothed.

        Parameters
        ----------
        nnodes
            Number of nodes of the mesh.
        radius
            Largest distance over which nodes are exchanged, in edges, rounded down to a power of two. None means the
            farthest, 0.6 sqrt(nnodes), or 1 with recycling. `relocate` derives the value from how far the mesh is from
            the density. Transport covers distances above 4, with a round for every doubling, and stages cover the rest.
        topology
            ``"fixed"`` trains longer at radius 1, because nothing else repairs elements that a fixed topology
            stretches. ``"recycle"`` has no transport, because nodes need not travel.

        Returns
        -------
        Schedule
            Schedule with fresh points in every epoch, and with sweeps.

        Raises
        ------
        ValueError
            If the topology is unknown, or a number is not an integer >= 0.

        Notes
        -----
        At a local radius a wave of 2n nodes decays by only ``1 - O((pi / n)^2)`` per epoch; a round of transport
        removes most of the wave at once, whatever its length. At radius 1 the density of nodes lags behind the density
        of points, and the sweeps of smoothing at the end overshoot: over many passes both effects balance.
        """
        if topology not in SWEEPS:
            raise ValueError(f"topology must be 'fixed', 'flip' or 'recycle'; got {topology!r}.")
        check_count("nnodes", nnodes)
        if radius is not None and not is_count(radius):
            raise ValueError(f"radius must be an integer >= 0, or None; got {radius!r}.")
        farthest = 0 if topology == "recycle" else most_doublings(nnodes)
        doublings = farthest if radius is None else max(0, int(radius).bit_length() - 1)
        near, epochs = NEAR[topology]
        radii = [2**k for k in range(min(doublings, near), 0, -1)]
        stages = [Stage(r, epochs, min(0.3, 1 / r), points_per_neuron=2 / r**2) for r in radii]
        rounds = max(0, doublings - ROUNDLESS)
        return cls((*stages, LOCAL[topology]), rounds=rounds, sweeps=SWEEPS[topology])

    @property
    def trains(self) -> bool:
        """True if the schedule presents or counts any point."""
        return bool(self.rounds) or any(stage.epochs for stage in self.stages)

    def epochs(self) -> Iterator[tuple[Stage, float]]:
        """Return the stage and the learning rate of every epoch."""
        return ((stage, rate) for stage in self.stages for rate in stage.rates())


def check_training(schedule: object, seed: object) -> None:
    if not isinstance(schedule, Schedule | None):
        raise ValueError(f"schedule must be a kohonen_adapt.Schedule or None; got {schedule!r}.")
    check_count("seed", seed)


def are_two_rates(rates: Iterable[float]) -> bool:
    rates = list(rates)
    return len(rates) == 2 and all(is_number(rate) and 0 < rate <= 1 for rate in rates)


def most_doublings(nnodes: int) -> int:
    return max(1, math.floor(math.log2(max(2.0, 0.6 * math.sqrt(nnodes)))))


# Stages at radius 1 of the default schedules. For the errors run `python -m benchmarks map`.
LOCAL = {
    "flip": Stage(1, 1, 0.3),
    "fixed": Stage(1, 5, (0.3, 0.1)),
    "recycle": Stage(1, 1, 0.45),  # as good as two epochs with 0.3
}
# After recycling in a metric, and before a polish, nodes are near their places, and a low rate averages many points per
# node. Sweeps bring nothing before a polish, and eight points no more than four: errors on L, M, C, F and two layers
# differ by half a per cent at most. For the errors run `python -m benchmarks map`.
NEAR_PLACES = Stage(1, 1, 0.05, points_per_neuron=8.0)
BEFORE_POLISH = Schedule((replace(NEAR_PLACES, points_per_neuron=4.0),))
IN_METRIC = Schedule((NEAR_PLACES,), sweeps=2)
