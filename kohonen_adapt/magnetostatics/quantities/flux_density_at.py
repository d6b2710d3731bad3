"""Flux density at a point or over a spot as a goal of mesh adaptation."""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair
from kohonen_adapt.checks import is_number, point_text
from kohonen_adapt.magnetostatics.quantities.forces import checked_point
from kohonen_adapt.magnetostatics.quantities.goals import POINT, SIZES, VectorGoal, unit_vector
from kohonen_adapt.mesh.cells import width_of
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.measures import distances
from kohonen_adapt.problem.singular_nodes import numbered_by_regions

__all__ = ["FluxDensityAt"]

AXIAL = 1  # component of vectors (r, z) along an axis
# Points along a radius, around, and between the poles of a ball. B jumps between elements within the spot, and a fifth
# of these points added more to the error than the elements did, if the elements were a tenth of the spot in size.
DISC, BALL, TURNED_BALL = (48, 192), (24, 32, 16), (32, 24, 48)

# Radius for `radius=None`, relative to the distance to the nearest material or boundary.
WHERE_HARMONIC, ELSEWHERE = 0.5, 0.1
SMOOTH = 2  # exponent of the weight for `radius=None`, whose second derivatives are bounded
ON_JUMP = 1e-9  # distance of a point on a boundary or interface, relative to the size of the mesh


class Spot(NamedTuple):
    x: Floats  # (d, n) in m
    weight: Floats  # (d, n), vectors whose products with B add up to the mean


def spot_rule(x: Floats, direction: Floats, radius: float, exponent: int, around_axis: bool) -> Spot:
    # Points of a ball around an axis are turned into the half-plane, and radial components are multiplied by the cosine
    # of the angle.
    counts = TURNED_BALL if around_axis else DISC if len(x) == 2 else BALL
    points, weight = unit_rule(exponent, *counts)
    if not around_axis:
        return Spot(x[:, None] + radius * points, direction[:, None] * weight)
    half = points[1] > 0.0  # the second half is turned to the same points
    along, aside, up = np.array([x[0], 0.0, x[1]])[:, None] + radius * points[:, half]
    r = np.hypot(along, aside)
    return Spot(np.stack([r, up]), 2.0 * direction[:, None] * weight[half] * np.stack([along / r, np.ones_like(r)]))


@cache
def unit_rule(exponent: int, radii: int, around: int, latitudes: int = 1) -> FloatsPair:
    # Points in the unit disc, or ball, and weights of the mean by the density ``(1 - s^2)^exponent`` at the distance s.
    (at, of_radius), (height, of_height) = (np.polynomial.legendre.leggauss(count) for count in (radii, latitudes))
    radius, dim = 0.5 + 0.5 * at, 3
    if latitudes == 1:
        radius, dim = np.sqrt(radius), 2
    angle = np.tile(2.0 * np.pi * (np.arange(around) + 0.5) / around, latitudes)
    up, of_direction = np.repeat(height, around), np.repeat(of_height, around)
    aside = np.sqrt(1.0 - up**2)
    directions = np.stack([aside * np.cos(angle), aside * np.sin(angle), up])[:dim]
    points = (radius[:, None] * directions[:, None]).reshape(dim, -1)
    density = of_radius * radius ** (2 * dim - 4) * (1.0 - radius**2) ** exponent
    weight = np.outer(density, of_direction).ravel()
    return points, weight / weight.sum()


def is_harmonic(field: Any, element: int) -> bool:
    coefficients = field.coefficients
    turns = field.axisymmetric and coefficients.current_density[element] != 0.0
    return not (turns or coefficients.of_its_own[element])


def distance_to_jumps(field: Any, x: Floats, include_current: bool) -> float:
    # The axis of an axisymmetric field is no boundary, and B has a kink where the current density jumps.
    mesh, coefficients = field.elements.corners, field.coefficients
    of_its_own = coefficients.of_its_own
    rows = [
        np.where(of_its_own, 0.0, np.vstack((coefficients.reluctivity, coefficients.coercivity))),
        np.where(of_its_own, coefficients.material_index, -1),
        coefficients.current_density if include_current else np.zeros(of_its_own.size),
    ]
    kind = numbered_by_regions(np.vstack(rows), coefficients.material_index)
    one, other = mesh.f2t
    facets = mesh.facets[:, (other < 0) | (kind[one] != kind[other])]
    if field.axisymmetric:
        facets = facets[:, ~field.symmetry.on_axis(mesh.p)[facets].all(axis=0)]
    return float(distances(x[:, None], mesh.p[:, facets]).min(initial=np.inf))


@dataclass(frozen=True)
class FluxDensityAt(VectorGoal):
    """Component of B at a point, or its mean over a spot about the point.

    The value of B at a point of a finite element solution jumps between elements, and its derivative is no function of
    finite energy. Therefore a goal at a point is a mean over a spot, a disc in the plane and a ball in space and around
    an axis. Every mesh is evaluated at the same quadrature points of the spot, so that values of passes are comparable.

    Parameters
    ----------
    x : (2,), in space (3,)
        Point in m, inside the mesh and inside a material.
    direction : (2,), in space (3,)
        Vector of any nonzero length; around an axis (r, z).
    radius
        Radius of the spot in m: the goal is the mean over the spot. With None the goal is the value at `x`, by a mean
        with the weight ``(1 - s^2)^2`` at the distance s times the radius from `x`. The radius is then half the
        distance to the nearest boundary or change of material, and a tenth in nonlinear material, in magnets that vary,
        and in coils around an axis. In linear material of constant remanence and current density, every Cartesian
        component of B is harmonic and equal to such a mean (mean value theorem). Elsewhere the mean differs from the
        value at `x` by about ``radius^2 / 16`` times the Laplacian of B.

    Raises
    ------
    ValueError
        For invalid arguments. At a field if `x` is outside the mesh, if the spot reaches beyond the mesh or into a
        material where B jumps, and for a direction across the axis at a point of the axis.

    Examples
    --------
    >>> import skfem
    >>> from kohonen_adapt.magnetostatics import FluxDensityAt, Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(3).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
    >>> goal = FluxDensityAt((0.4, 0.7), (0.0, 1.0))
    >>> problem = Magnetostatics({"air": Material()}, potential={"left": 0.0, "right": 1.0}, goal=goal)
    >>> round(goal(problem.solve(mesh)), 9)  # of A = x
    -1.0
    """

    x: tuple[float, ...]
    direction: tuple[float, ...]
    radius: float | None = None
    unit: ClassVar[str] = "T"
    vector: ClassVar[str] = "direction"

    def __post_init__(self) -> None:
        point = checked_point("x of FluxDensityAt", self.x, POINT, SIZES)
        vars(self)["x"] = tuple(point.tolist())
        vars(self)["direction"] = unit_vector("direction of FluxDensityAt", self.direction)
        if len(self.x) != len(self.direction):
            raise ValueError(
                "x and direction of FluxDensityAt must have equally many components; got "
                f"{self.x} and {self.direction}."
            )
        if self.radius is not None and not (is_number(self.radius) and 0.0 < self.radius < np.inf):
            raise ValueError(f"radius of FluxDensityAt must be a finite number > 0 in m, or None; got {self.radius!r}.")

    def __call__(self, field: Any) -> float:
        spot = self._place(field)
        return float(np.sum(spot.weight * field.flux_density_at(spot.x)))

    def derivative(self, field: Any) -> FloatsPair:
        spot = self._place(field)
        return np.zeros_like(field.volume), field.load_at(spot.x, field.elements_at(spot.x), spot.weight)

    def _place(self, field: Any) -> Spot:
        mesh = field.elements.corners
        self.check_dimension(len(mesh.p))
        x, point, around_axis = np.array(self.x), point_text(np.array(self.x)), field.axisymmetric
        element = find_elements(mesh, x[:, None])[0]
        if element < 0:
            low, high = (point_text(end(field.mesh.p, axis=1)) for end in (np.min, np.max))
            raise ValueError(
                f"x of FluxDensityAt must be a point of the mesh, which is from {low} to {high} m; {point} is outside."
            )
        nearest = ON_JUMP * float(width_of(field.mesh))
        if around_axis and x[0] <= nearest and self.direction[AXIAL] == 0.0:
            raise ValueError("B on an axis is along z; FluxDensityAt there must have a direction with a z component.")
        reach = distance_to_jumps(field, x, include_current=self.radius is None)
        if reach <= nearest:
            raise ValueError(
                f"x of FluxDensityAt must be inside a material; {point} is on the boundary of "
                "the mesh or between two materials. Move it into one of them."
            )
        radius, exponent = self.radius, 0
        if radius is None:
            radius, exponent = reach * (WHERE_HARMONIC if is_harmonic(field, element) else ELSEWHERE), SMOOTH
        elif radius > reach:
            raise ValueError(self._too_large(f"they are {reach:.6g} m from {point}"))
        spot = spot_rule(x, np.array(self.direction), radius, exponent, around_axis)
        if np.any(find_elements(mesh, spot.x) < 0):
            raise ValueError(self._too_large("the boundary of the mesh cuts it"))
        return spot

    def _too_large(self, why: str) -> str:
        return (
            "the spot of FluxDensityAt must not reach the boundary of the mesh or another material, where B jumps; "
            f"{why}, and the radius is {self.radius}. Give a smaller radius."
        )
