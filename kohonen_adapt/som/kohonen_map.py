"""The Kohonen map: a mesh whose nodes are neurons, and how it is trained."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import is_number
from kohonen_adapt.kernels.arrays import HELD, UNGUARDED
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.flip import flip_edges, mark_doubtful
from kohonen_adapt.mesh.locate import Locator, as_rows
from kohonen_adapt.mesh.ordering import along_curve
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.layers import lay
from kohonen_adapt.outline.outline import Outline, pinned_nodes
from kohonen_adapt.som.recycling import Recycled, recycle_nodes
from kohonen_adapt.som.schedule import Schedule, Stage, check_training
from kohonen_adapt.som.training import Classroom
from kohonen_adapt.som.training_points import CallableDensity, Draw, ElementDensity
from kohonen_adapt.som.transport import POINTS, Transport

__all__ = ["KohonenMap"]

FLIPS = 2_000_000  # per compiled call: Python hears Ctrl-C at least every half second
FEW = 5_000  # elements that are not worth another thread


class KohonenMap:
    """A self-organizing map whose neurons are the nodes of a mesh and whose topology is the mesh itself.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`; it is not modified.
    topology
        ``"flip"`` keeps every region constrained Delaunay by flips between epochs, and where three outlines meet an
        element may change sides for a neuron to leave; ``"fixed"`` keeps the elements.
    min_quality
        No update or flip leaves an element worse than this, unless the worst there was worse before. None switches
        every check off: elements may then overlap (Fig. 7 of the paper).
    pinned
        Node numbers, and names of boundaries and subdomains, of what stays where it is.
    curves
        The curves that named boundaries are on: `Line`, `Arc`, `Spline`, or any object with a method
        ``project(x (2, n)) -> (2, n)``. Without one, six nodes and more on a circle are taken for an arc, and other
        turns for corners.
    periodic
        Pairs of names of boundaries that a translation or rotation carries to one another: their nodes stay matched,
        and a training point beside one also reaches what lies beside the other.
    layers
        Layers of elements to keep across thin subdomains, by name; see `relocate`.

    Attributes
    ----------
    mesh
        The mesh as it is now, with all its names.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, an argument is out of range, or there are fewer layers than are
        to be kept.

    References
    ----------
    D. A. Lowther and W. Mai, "On Automatic Mesh Generation using Kohonen Maps", IEEE Trans. Magn.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> points = np.random.default_rng(0).random((2, 500)) ** 2  # many of them near the origin
    >>> som = ka.KohonenMap(skfem.MeshTri().refined(4))
    >>> errors = som.train(points, ka.Schedule.paper())
    >>> len(errors), errors[-1] < errors[0]
    (18, True)
    >>> som.mesh.p.shape
    (2, 289)
    """

    def __init__(
        self,
        mesh: MeshTri,
        *,
        topology: str = "flip",
        min_quality: float | None = 0.3,
        pinned: Sequence[int | str] | Ints | str = (),
        curves: Mapping[str, Curve] | None = None,
        periodic: Sequence[tuple[str, str]] = (),
        layers: Mapping[str, int] | None = None,
    ) -> None:
        check_options(topology, min_quality)
        self.triangulation = Triangulation.of(mesh)
        self._flips = topology == "flip"
        self.outline = Outline.of(
            self.triangulation, pinned_nodes(mesh, pinned), curves, periodic, junctions=self._flips
        )
        lay(self.triangulation, self.outline.constraints, layers)
        self._floor = UNGUARDED if min_quality is None else float(min_quality)
        self._classroom = Classroom.of(self.triangulation, self.outline.constraints, self._floor)

    def __repr__(self) -> str:
        edges = "edges flip" if self._flips else "fixed edges"
        return f"<KohonenMap of {self.triangulation.nnodes} neurons, {edges}>"

    @property
    def mesh(self) -> MeshTri:
        """The mesh as it is now, with every name it came with."""
        return self.outline.with_boundaries(self.triangulation.to_mesh(), self.triangulation)

    def train(
        self,
        points: ArrayLike | Callable[[int, np.random.Generator], tuple[ArrayLike, ArrayLike | None]],
        schedule: Schedule | None = None,
        *,
        weights: ArrayLike | None = None,
        seed: int = 0,
    ) -> tuple[float, ...]:
        """Learn training points, equation 1 of the paper.

        Parameters
        ----------
        points
            (2, n), in mesh units, or a callable ``(number, rng) -> (points, weights)`` asked anew in every epoch
            (once, if the schedule is not fresh); its weights may be None.
        schedule
            None takes the default for this mesh, without sweeps.
        weights
            (n,), >= 0: the learning rate of each point is multiplied by it, and capped at 1.
        seed
            Decides the order in which points are presented, and what the callable's generator gives.

        Returns
        -------
        tuple of float
            Quantisation error of every epoch: the mean distance of the training points to their winners before the
            update, in mesh units. Times the number of points it is the paper's equation 2.

        Raises
        ------
        ValueError
            If a training point lies outside the mesh, a shape does not fit, the schedule is none or has sweeps, or the
            seed is not an integer >= 0.

        Notes
        -----
        A map's density of nodes is not that of its training points. With radius 0 (vector quantisation) points of
        density p bring the nodes to ``p^(d / (d + 2))``, in the plane ``p^(1/2)`` (Zador, IEEE Trans. Inf. Theory 28,
        1982); wide radii give powers between 2/3 and about 1, depending on p and on the shape of the mesh (Ritter and
        Schulten, Biol. Cybern. 54, 1986). To reach a prescribed density rho, draw the points from rho itself, give each
        the weight ``rho^(2 / d)``, in the plane rho, scaled so that learning rate times weight is at most 1, and train
        with ``Stage(0, ...)``: weights and points together act as ``p = rho^((d + 2) / d)``. That needs fresh points in
        every epoch (a callable), about 20 per neuron, and a rate that falls to 0.01; nodes travel slowly without
        neighbours, so begin near the density (`relocate`) or allow hundreds of epochs. ``python -m benchmarks
        magnification`` measures it.

        Examples
        --------
        >>> import skfem, kohonen_adapt as ka
        >>> som = ka.KohonenMap(skfem.MeshTri().refined(4))
        >>> def drawn(number, rng):
        ...     return rng.random((2, number)) ** 2, None
        >>> errors = som.train(drawn, ka.Schedule((ka.Stage(2, 3, 0.3), ka.Stage(0, 2, (0.3, 0.05)))))
        >>> len(errors)  # one per epoch
        5
        """
        check_training(schedule, seed)
        schedule = self._schedule_without_sweeps(schedule)
        locator, rng = Locator(self.triangulation), np.random.default_rng(seed)
        if callable(points):
            if weights is not None:
                raise ValueError("weights must come from the callable when points is one; got both.")
            return self.learn(lambda number, rng: self._located(locator, *drawn(points(number, rng))), schedule, rng)
        given = self._located(locator, points, weights)
        return self.learn(lambda number, rng: given, replace(schedule, fresh=False), rng)

    def _located(self, locator: Locator, points: ArrayLike, weights: ArrayLike | None) -> Draw:
        """A user's training points with the elements that hold them, checked.

        Raises
        ------
        ValueError
            If a shape does not fit, a weight is negative or not finite, or a point lies outside the mesh.
        """
        rows = as_rows(points, "points")
        if len(rows) == 0:
            raise ValueError("points must hold at least one training point; got none.")
        weight = np.ones(len(rows)) if weights is None else np.array(weights, dtype=np.float64)
        if weight.shape != (len(rows),):
            raise ValueError(f"weights must have shape (n,) = ({len(rows)},); got {weight.shape}.")
        bad = np.flatnonzero(~(np.isfinite(weight) & (weight >= 0)))
        if len(bad):
            raise ValueError(f"weights must be finite and >= 0; that of point {bad[0]} is {weight[bad[0]]}.")
        element = locator.find(rows)
        outside = np.flatnonzero(element < 0)
        if len(outside):
            where = tuple(rows[outside[0]].tolist())
            raise ValueError(
                f"training points must lie in the mesh; {len(outside)} do not, point {outside[0]} at {where}."
            )
        region = self.triangulation.elements.region[element]
        return Draw(rows, element, region, weight).reordered(along_curve(rows))

    def _schedule_without_sweeps(self, schedule: Schedule | None) -> Schedule:
        if schedule is None:
            topology = "flip" if self._flips else "fixed"
            return replace(Schedule.default(self.triangulation.nnodes, topology=topology), sweeps=0)
        if schedule.sweeps:
            raise ValueError(
                f"train has no density to sweep with; got sweeps = {schedule.sweeps}. Use kohonen_adapt.relocate."
            )
        return schedule

    def learn(
        self,
        draw: Callable[[int, np.random.Generator], Draw],
        schedule: Schedule,
        rng: np.random.Generator,
        starts: Ints | None = None,
    ) -> tuple[float, ...]:
        """Train with points whose elements in the mesh that they are drawn from are known.

        Parameters
        ----------
        draw
            Called with a number of points and a generator.
        schedule
            Its sweeps are left to `smooth`.
        rng
            Decides the order of the points, too.
        starts
            A node for each element of the mesh that points are drawn from, near it and in its region; None if that is
            the mesh as it is now.

        Returns
        -------
        tuple of float
            Quantisation error of every epoch, as of `train`.
        """
        self._flip()
        errors: list[float] = []
        training = bool(schedule.rounds) or any(stage.epochs for stage in schedule.stages)
        if training:
            self._settle()
        starts = (self.triangulation.elements.node[:, 0] if starts is None else starts).copy()
        if schedule.rounds:
            self._carry(draw, schedule.rounds, rng, starts)
        for stage, rate, shown, slot, winners in self._presentations(draw, schedule, rng, starts):
            errors.append(self._classroom.epoch(stage, rate, shown, slot, winners, rng))
            self._flip()
            if schedule.tolerance is not None and errors[-1] < schedule.tolerance:
                break
        if training:
            self._settle()
        return tuple(errors)

    def _carry(
        self, draw: Callable[[int, np.random.Generator], Draw], rounds: int, rng: np.random.Generator, starts: Ints
    ) -> None:
        """Rounds of transport; `starts` learn where the winners of the elements' points are now."""
        tri = self.triangulation
        transport = Transport.of(tri, self.outline.constraints, self._floor, self._flip, self._classroom.rank)
        for _ in range(rounds):
            shown = draw(ceil(POINTS * tri.nnodes), rng)
            winners = self._classroom.search(shown, starts[shown.element])[0]
            starts[shown.element] = winners
            transport.carry(shown, winners)

    def _presentations(
        self,
        draw: Callable[[int, np.random.Generator], Draw],
        schedule: Schedule,
        rng: np.random.Generator,
        winners: Ints,
    ) -> Iterator[tuple[Stage, float, Draw, Ints, Ints]]:
        """For every epoch its stage and rate, its points, and where each finds and leaves its last winner.

        Points of a set that is shown again remember their own winner; fresh ones take over that of the last point
        drawn from the same element.
        """
        count = self.triangulation.nnodes
        most = max((stage.points_per_neuron for stage in schedule.stages), default=0.0)
        kept = None if schedule.fresh else draw(ceil(most * count), rng)
        if kept is not None:
            winners = winners[kept.element]
        for stage in schedule.stages:
            for rate in stage.rates():
                if kept is None:
                    shown = draw(ceil(stage.points_per_neuron * count), rng)
                    yield stage, rate, shown, shown.element, winners
                else:
                    yield stage, rate, kept, np.arange(len(winners)), winners

    def recycle(self, density: ElementDensity | CallableDensity, target: int, pairs: bool) -> Recycled:
        """Put nodes where the density wants more, and take others away elsewhere.

        Parameters
        ----------
        density
            Wanted nodes per area.
        target
            How many nodes there shall be; at least as many as there are.
        pairs
            Whether nodes are taken away where there are too many; else only missing ones are added.

        Returns
        -------
        Recycled
            Which nodes are old, and what was done.
        """
        self._settle()
        done = recycle_nodes(self.triangulation, self.outline, density.at_nodes(), self._floor, target, pairs)
        self._classroom = Classroom.of(self.triangulation, self.outline.constraints, self._floor)
        return done

    def smooth(self, density: ElementDensity | CallableDensity, sweeps: int) -> None:
        """Sweeps weighted with a density: optimal Delaunay smoothing with flips, else towards barycentres.

        Parameters
        ----------
        density
            Wanted nodes per area.
        sweeps
            How many.
        """
        for number in range(sweeps):
            if number % density.lasting == 0:
                weight = density.squares(self.triangulation)
            self._classroom.sweep(weight, self._flips)
            self._flip()
        self._settle()

    def along_curve(self) -> Ints:
        """Neurons along a space-filling curve, region by region; those on interfaces in one of theirs, (n,)."""
        tri = self.triangulation
        region = tri.elements.region[tri.star.element[tri.star.start[:-1]]]
        return self._classroom.order[np.argsort(region[self._classroom.order], kind="stable")]

    def _settle(self) -> None:
        """Put the nodes that slide on curves exactly there."""
        self.outline.settle(self.triangulation, self._floor)

    def _flip(self) -> None:
        """Make every region constrained Delaunay as far as the quality rule allows."""
        if not self._flips:
            return
        tri, m = self.triangulation, len(self.triangulation.elements.node)
        doubtful, stack, waiting = np.empty(m, dtype=np.bool_), np.empty(m, dtype=np.int32), np.zeros(m, dtype=np.bool_)

        def mark(thread: int, first: int, last: int) -> None:
            mark_doubtful(tri.position, tri.elements, first, last, doubtful)

        flips = limit = FLIPS
        while flips >= limit:
            shared(mark, even_cuts(m, FEW))
            flips = flip_edges(tri.position, tri.elements, self._floor, doubtful, stack, waiting, limit)
            if flips:
                tri.refill_star()

    def can_move(self) -> bool:
        """Whether any node is free to move or to slide; a corner is only left to one that slides."""
        return bool(np.any(self.outline.constraints.kind != HELD))


def check_options(topology: str, min_quality: float | None) -> None:
    """Refuse options that the map does not have."""
    if topology not in ("flip", "fixed"):
        raise ValueError(f"topology must be 'fixed' or 'flip'; got {topology!r}.")
    if min_quality is not None and not (is_number(min_quality) and 0 <= min_quality < 1):
        raise ValueError(f"min_quality must be from 0 to below 1; got {min_quality!r}.")


def drawn(answer: object) -> tuple[ArrayLike, ArrayLike | None]:
    """What a callable gave for points, checked to be points and weights."""
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise ValueError(
            f"points as a callable must return (points, weights), weights None for ones; got {type(answer).__name__}."
        )
    return answer
