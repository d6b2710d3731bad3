"""Kohonen map on a mesh, trained with user-defined points."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Int32s
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import LeastQuality, Pinned, Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.surfaces import NamedSurfaces
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of, centroids_of, check_kind
from kohonen_adapt.mesh.locate import Locator, as_rows, find_elements
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.shapes import are_round, density_and_shape, shapes_at_nodes, tensors_of_elements
from kohonen_adapt.som.map_method import map_method_of
from kohonen_adapt.som.schedule import Schedule, check_training
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Draw

__all__ = ["KohonenMap"]

Finder = Callable[[Floats], tuple[Int32s, Int32s]]


class KohonenMap:
    """Self-organizing map whose neurons are the nodes of a mesh.

    Neighbours in the map are neighbours in the mesh.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, a `skfem.MeshTri2`, of which the corners are neurons, or a `skfem.MeshTet`. The mesh is not
        modified.
    topology
        ``"flip"`` keeps every region constrained Delaunay by flips between epochs. Elements of a `skfem.MeshTet` are
        swapped while this raises the worst quality involved. ``"fixed"`` keeps the elements.
    metric
        Symmetric positive definite tensors of the elements of `mesh`, shape (nelements, d, d). Then the winner is the
        neuron that is nearest in the metric of the training point, and edges flip to Delaunay's rule in the metric.
        Directions and ratios of lengths matter, but lengths do not: the points have the density. None is the Euclidean
        metric.
    min_quality
        As in `Rules`. None disables all checks: then elements may overlap (Fig. 7 of the paper).
    pinned, curves, periodic, layers, surfaces
        As in `Rules`.

    Attributes
    ----------
    mesh
        Present mesh with all names, a `skfem.MeshTri2` if the input is one and a boundary or interface is curved.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, if an argument is out of range,
        or if the mesh has fewer layers than `layers` requests.

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
        mesh: Mesh,
        *,
        topology: str = "flip",
        metric: ArrayLike | None = None,
        min_quality: LeastQuality | None = "auto",
        pinned: Pinned = (),
        curves: Curves | None = None,
        periodic: Sequence[Pair] = (),
        layers: Mapping[str, int] | None = None,
        surfaces: NamedSurfaces | None = None,
    ) -> None:
        if topology not in ("flip", "fixed"):
            raise ValueError(f"topology must be 'fixed' or 'flip'; got {topology!r}.")
        rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces)
        check_kind(mesh)
        method = map_method_of(cell_of(mesh).dim)
        expect(*method.kernel_groups)
        solid = method.cell is TETRAHEDRON
        self._movable = MovableSolid.of(mesh, rules) if solid else MovableMesh.of(mesh, rules)
        self._shapes = None if metric is None else ShapesOfElements.of(mesh, metric)
        if self._shapes is not None:
            self._movable.measure_by(self._shapes.at_nodes())
        self._trainer = Trainer.of(self._movable)

    def __repr__(self) -> str:
        edges = "edges flip" if self._movable.flips else "fixed edges"
        return f"<KohonenMap of {self._movable.nnodes} neurons, {edges}>"

    @property
    def mesh(self) -> Mesh:
        """Present mesh with all names of the input."""
        return self._movable.mesh()

    def train(
        self,
        points: ArrayLike | Callable[[int, Generator], tuple[ArrayLike, ArrayLike | None]],
        schedule: Schedule | None = None,
        *,
        weights: ArrayLike | None = None,
        seed: int = 0,
    ) -> tuple[float, ...]:
        """Present training points to the map, by equation 1 of the paper.

        Parameters
        ----------
        points
            Points in mesh units, shape (2, n), in space (3, n), or a callable ``(number, rng) -> (points, weights)``.
            The callable is called in every epoch (once, if the schedule is not fresh); weights may be None.
        schedule
            Schedule without sweeps. None means the default for the mesh.
        weights
            Factors >= 0 of the learning rate of every point, shape (n,). The product is limited to 1.
        seed
            Seed of the generator that orders the points and that the callable receives.

        Returns
        -------
        tuple of float
            Quantisation error of every epoch, the mean distance of the training points to their winners before the
            update, in mesh units. Multiplied by the number of points, this is equation 2 of the paper. With a metric,
            distances are measured in its tensors divided by the d-th root of the determinant.

        Raises
        ------
        ValueError
            If a training point lies outside the mesh, a shape does not fit, `schedule` is no `Schedule` or has sweeps
            (or, in space, rounds of transport), or `seed` is not an integer >= 0.

        Notes
        -----
        The density of nodes differs from the density of training points. With radius 0 (vector quantisation) points of
        density p bring the nodes to the density ``p^(d / (d + 2))``, in the plane ``p^(1/2)`` (Zador, IEEE Trans. Inf.
        Theory 28, 1982). Wide radii give powers between 2/3 and about 1, which depend on p and on the shape of the mesh
        (Ritter and Schulten, Biol. Cybern. 54, 1986).

        To reach a prescribed density rho, draw the points from rho itself, give each the weight ``rho^(2 / d)``, in the
        plane rho, scaled so that learning rate times weight is at most 1, and train with ``Stage(0, ...)``: weights and
        points together act as ``p = rho^((d + 2) / d)``. Use fresh points in every epoch (a callable), about 20 per
        neuron, and a rate that falls to 0.01. Nodes travel slowly without neighbours, so begin near the density
        (`relocate`) or allow hundreds of epochs.

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
        trainer = self._trainer
        find, rng = self._finder(), np.random.default_rng(seed)
        if not callable(points):
            given = self._located(find, points, weights)
            return trainer.learn(lambda number, rng: given, replace(schedule, fresh=False), rng)
        if weights is not None:
            raise ValueError("weights must come from the callable when points is one; got both.")

        def draw(number: int, rng: Generator) -> Draw:
            return self._located(find, *points_and_weights(points(number, rng)))

        return trainer.learn(draw, schedule, rng)

    def _finder(self) -> Finder:
        movable = self._movable
        region = self._trainer.neurons.elements.region.copy()
        has_curves = movable.curved and isinstance(movable, MovableMesh)
        locator = Locator(movable.tessellation)

        def find(rows: Floats) -> tuple[Int32s, Int32s]:
            element = find_elements(self.mesh, rows.T) if has_curves else locator.find(rows)
            return element, region[element]

        return find

    def _located(self, find: Finder, points: ArrayLike, weights: ArrayLike | None) -> Draw:
        rows = as_rows(points, "points", self._trainer.method.cell.dim)
        if len(rows) == 0:
            raise ValueError("points must hold at least one training point; got none.")
        weight = np.ones(len(rows)) if weights is None else np.array(weights, np.float64)
        if weight.shape != (len(rows),):
            raise ValueError(f"weights must have shape (n,) = ({len(rows)},); got {weight.shape}.")
        bad = np.flatnonzero(~(np.isfinite(weight) & (weight >= 0)))
        if len(bad):
            raise ValueError(f"weights must be finite and >= 0; that of point {bad[0]} is {weight[bad[0]]}.")
        element, region = find(rows)
        outside = np.flatnonzero(element < 0)
        if len(outside):
            where = tuple(rows[outside[0]].tolist())
            raise ValueError(
                f"training points must lie in the mesh; {len(outside)} do not, point {outside[0]} at {where}."
            )
        shape = None if self._shapes is None else self._shapes.at(rows)
        return Draw(rows, element, region, weight, shape).reordered(along_curve(rows))

    def _schedule_without_sweeps(self, schedule: Schedule | None) -> Schedule:
        if schedule is None:
            topology = "flip" if self._movable.flips else "fixed"
            return self._trainer.method.schedule(self._movable.nnodes, topology)
        if schedule.sweeps:
            raise ValueError(
                f"train has no density to sweep with; got sweeps = {schedule.sweeps}. Use kohonen_adapt.relocate."
            )
        return schedule


@dataclass
class ShapesOfElements:
    """Shapes (nelements, 3) or (nelements, 6) of a metric on the input mesh."""

    mesh: Mesh
    shape: Floats

    @classmethod
    def of(cls, mesh: Mesh, metric: ArrayLike) -> "ShapesOfElements | None":
        """Return the shapes of tensors (nelements, d, d), or None if all are round."""
        shape = density_and_shape(tensors_of_elements(metric, mesh.nelements, len(mesh.p), "metric"))[1]
        return None if are_round(shape) else cls(mesh, shape)

    def at_nodes(self) -> Floats:
        return shapes_at_nodes(self.mesh.t.T, self.shape, area(self.mesh), self.mesh.nvertices)

    def at(self, points: Floats) -> Floats:
        element = find_elements(self.mesh, points.T)
        outside = np.flatnonzero(element < 0)  # between a chord that has moved and its curve
        if len(outside):
            centroids = centroids_of(self.mesh).T
            element[outside] = cKDTree(centroids).query(points[outside])[1]
        return self.shape[element]


def points_and_weights(answer: object) -> tuple[ArrayLike, ArrayLike | None]:
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise ValueError(
            f"points as a callable must return (points, weights), weights None for ones; got {type(answer).__name__}."
        )
    return answer
