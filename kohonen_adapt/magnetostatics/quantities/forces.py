"""Forces and torques on bodies and on currents, in the plane and in space."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.coils.motion import Motion, images_of, motion_of
from kohonen_adapt.magnetostatics.coils.rules import currents_of
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE, Solver
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import Names, air_elements, elements_in, isolated_body
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil, is_coil
from kohonen_adapt.magnetostatics.quantities.cuts import Cut, cut_of, without_cancelled
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = [
    "OUT_OF_PAGE",
    "OfBody",
    "check_plane",
    "check_torque",
    "checked_point",
    "current_force",
    "force_along",
    "lorentz_force",
    "parts_along",
]

OUT_OF_PAGE = (0.0, 0.0, 1.0)  # axis of a torque in the plane


class WeightedPoints(NamedTuple):
    # points of a quadrature, with the gradient of a weight that is linear in elements
    x: Floats  # (d, n) in m
    element: Ints  # (n,)
    volumes: Floats  # (n,)
    slope: Floats  # (d, n) in 1/m
    flux_density: Floats  # (d, n) in T


class LayerCurrents(NamedTuple):
    x: Floats  # (3, n) in m
    element: Ints  # (n,)
    moment: Floats  # (3, n) in A m

    def force(self, field: MagneticField) -> Floats:
        return np.cross(self.moment, field.reaction_at(self.x, self.element), axis=0)


def layer_currents(field: MagneticField, weight: Floats) -> LayerCurrents:
    mesh, images, points, moments = field.mesh, images_of(field.mesh, field.mirrors), [], []
    for coil in field.sources.coils.values():
        x, moment = currents_of(coil.winding)
        x, moment = images.folded(x, coil.ampere_turns / len(images.sign) * moment)
        points.append(x)
        moments.append(moment)
    x, moment = np.concatenate(points, axis=1), np.concatenate(moments, axis=1)
    element = field.elements_at(x)
    rows = np.flatnonzero(element >= 0)
    x, moment, element = x[:, rows], moment[:, rows], element[rows]
    factor = np.sum(weight[mesh.t[:, element]] * field.elements.barycentric(x, element), axis=0)
    rows = np.flatnonzero(factor != 0.0)
    return LayerCurrents(x[:, rows], element[rows], factor[rows] * moment[:, rows])


@dataclass(frozen=True, eq=False)
class Shell:
    # Weight around a body, and the currents where the weight falls.
    # With ``f = J x B`` in the layer, the force on the body is ``-int T grad w - int w f``. The field of the currents
    # in free space makes no force on the body, so that both integrals leave out its part: T less the stress of this
    # field, and f without B of this field.

    field: MagneticField
    inside: Mask
    cut: Cut

    @classmethod
    def of(cls, field: MagneticField, body: Names, centre: Floats | None) -> "Shell":
        inside = isolated_body(field, body)
        cut = cut_of(field, inside, centre)
        key = "shell", *(np.asarray(part).tobytes() for part in (inside, *cut))
        if key not in field.kept:
            field.kept[key] = cls(field, inside, cut)
        shell: Shell = field.kept[key]
        return shell

    @cached_property
    def _weight(self) -> Floats:
        return weight_at_nodes(self.field, self.inside, self.cut)

    @cached_property
    def layer(self) -> Mask:
        # the elements of air where the weight falls
        falls = np.ptp(self._weight[self.field.mesh.t], axis=0) > 0.0
        return np.asarray(falls & air_elements(self.field) & ~self.inside)

    @cached_property
    def at(self) -> WeightedPoints:
        field, (x, element, volumes) = self.field, self.field.points_in(self.layer)
        slope = field.elements.slope_of_corners_at(self._weight, element, x)
        return WeightedPoints(x, element, volumes, slope, field.at(x, element).flux_density)

    @cached_property
    def currents(self) -> LayerCurrents | None:
        return layer_currents(self.field, self._weight) if self.field.sources.coils else None

    @cached_property
    def forces(self) -> tuple[Floats, Floats]:
        # points and the forces there, (d, n) each
        at, currents = self.at, self.currents
        forces = stress_force(at.volumes, at.slope, at.flux_density)
        if currents is None:
            return at.x, forces
        free = at.flux_density - self.field.reaction_at(at.x, at.element)
        forces = forces - stress_force(at.volumes, at.slope, free)
        return np.hstack((at.x, currents.x)), np.hstack((forces, -currents.force(self.field)))


@dataclass(frozen=True, eq=False)
class OfBody:
    shell: Shell
    motion: Motion

    @property
    def vanishes(self) -> bool:
        return not (self.motion.shift.any() or self.motion.turn.any())

    def value(self) -> float:
        x, forces = self.shell.forces
        return float(np.sum(forces * self.motion.at(x)))

    def load(self) -> Floats:
        field, at, currents = self.shell.field, self.shell.at, self.shell.currents
        weight = np.zeros(field.elements.points.shape)
        weight[:, self.shell.layer[field.elements.element]] = stress_change(at, self.motion.at(at.x))
        load = field.load_of(weight)
        if currents is None or not currents.x.size:
            return load
        along = np.cross(currents.moment, self.motion.at(currents.x), axis=0)
        return load + field.load_at(currents.x, currents.element, along)


def parts_along(field: MagneticField, names: Names, vector: Floats, centre: Floats | None) -> list[OfBody | OfCoil]:
    """Return the parts of a force along a vector, or of a torque about an axis.

    A force is the work by a shift of the body, and a torque the work by a turn.
    """
    if centre is not None:
        check_torque(field)
    coils, body = _split(field, names)
    found: list[OfBody | OfCoil] = [OfCoil(field, name, motion_of(vector, centre)) for name in coils]
    if body or not coils:
        shell = Shell.of(field, body, centre)
        found.append(OfBody(shell, motion_of(without_cancelled(shell.cut, vector, centre is not None), centre)))
    return found


def force_along(field: MagneticField, names: Names, vector: Floats, centre: Floats | None = None) -> float:
    return float(sum(part.value() for part in parts_along(field, names, vector, centre)))


def _split(field: MagneticField, names: Names) -> tuple[list[str], Names]:
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Sequence) else []
    coils = [name for name in listed if is_coil(field, name)]
    return coils, [name for name in listed if name not in coils] if coils else names


def stress_force(volumes: Floats, slope: Floats, b: Floats) -> Floats:
    # ``-T slope`` times the volume of every point, (d, npoints), with Maxwell's stress tensor T of air for b
    normal, pressure = np.sum(b * slope, axis=0), 0.5 * np.sum(b**2, axis=0)
    return -volumes / VACUUM_PERMEABILITY * (b * normal - pressure * slope)


def stress_change(at: WeightedPoints, arm: Floats) -> Floats:
    """Return the derivative of ``-arm . T slope`` by B, shape (d, npoints).

    ``-((B . slope) arm + (B . arm) slope - (arm . slope) B) / mu0``.
    """
    slope, b = at.slope, at.flux_density
    normal, along, both = (np.sum(first * second, axis=0) for first, second in ((b, slope), (b, arm), (arm, slope)))
    return -(normal * arm + along * slope - both * b) / VACUUM_PERMEABILITY


# Three weights: one layer of elements around the body / the solution of Laplace's equation / this weight.
# Magnet over iron, meshes of Gmsh, 3623 nodes (`benchmarks force`; F_x = 106.0 N/m):
#     mean of F_x in N/m               114.0 / 108.7 / 107.2        scatter  2.4 / 0.32 / 0.10
#     the same meshes adapted          106.0 / 106.0 / 106.0        scatter  0.031 / 0.012 / 0.014
# Two magnets on a regular grid, 5265 nodes: error of the force 1.2 / 3.1 / 1.1 %, rate of convergence - / 1.5 / 2.


def weight_at_nodes(field: MagneticField, inside: Mask, cut: Cut) -> Floats:
    """Return the weight at the nodes, (nnodes,).

    The weight falls smoothly between the levels 3/4 and 1/4 of the P1 solution of Laplace's equation in the air, which
    is 1 on the body, and 0 on all other materials and on the outer boundary except the cut. The exact force is the same
    for any weight with these boundary values. This weight uses the field at a distance from the corners of body and
    neighbours, where B is most accurate, and in many elements. The force converges by the square of the element size,
    also on uniform meshes.
    """
    mesh, air = field.elements.corners, air_elements(field) & ~inside
    values, is_fixed = np.zeros(mesh.p.shape[1]), ~_free_nodes(mesh, air, cut)
    values[cut.master[mesh.t[:, inside]]] = 1.0
    is_fixed[cut.master[is_fixed]] = True
    level = np.clip(2.0 * _laplace(mesh, air, cut.master, values, is_fixed) - 0.5, 0.0, 1.0)
    return level**2 * (3.0 - 2.0 * level)


def _free_nodes(mesh: Mesh, air: Mask, cut: Cut) -> Mask:
    free = np.ones(mesh.p.shape[1], dtype=bool)
    free[mesh.t[:, ~air]] = False
    free[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), cut.facets)]] = False
    return free


def _laplace(mesh: Mesh, air: Mask, master: Ints, values: Floats, is_fixed: Mask) -> Floats:
    hats, size = hat_gradients(mesh)[:, :, air], area(mesh)[air]
    corner = master[mesh.t[:, air]]
    products = np.einsum("cik,cjk,k->ijk", hats, hats, size)
    row, column = (np.broadcast_to(part, products.shape).ravel() for part in (corner[:, None], corner[None, :]))
    matrix = coo_array((products.ravel(), (row, column)), shape=(values.size, values.size)).tocsr()
    solution, unknown = values.copy(), np.unique(master[~is_fixed[master]])
    if unknown.size:
        solver = IN_SPACE if len(mesh.p) == 3 else Solver()
        solution[unknown] = solver.solve(matrix[unknown][:, unknown].tocsc(), -(matrix @ values)[unknown])
    return solution[master]


def lorentz_force(field: MagneticField, coil: Names) -> Floats:
    """Return the force on the currents of a coil, ``int J x B``.

    Parameters
    ----------
    field
        A field.
    coil
        Subdomain, or sequence of subdomains, of permeability 1 and without remanence.

    Returns
    -------
    ndarray (2,)
        In N per metre of depth; with `depth` in N, axisymmetric (0, F_z) in N.

    Raises
    ------
    ValueError
        If the coil carries no current, or is magnetic, because its force is then not only the force on currents.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material, lorentz_force
    >>> def inside(x):
    ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
    >>> mesh = skfem.MeshTri().refined(4).with_defaults()
    >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
    >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
    >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
    >>> lorentz_force(field, "coil").round(1).tolist()[0]  # 1000 A/m^2 times 0.25 m^2 times 1 T, in N/m
    250.0
    """
    total = np.sum(current_force(field, coil), axis=1)
    return total * (0.0, 1.0) if field.axisymmetric else total


def check_plane(field: MagneticField) -> None:
    if len(field.mesh.p) != 2:
        raise ValueError(
            "lorentz_force, lorentz_torque and arkkio_torque are for meshes of triangles, whose materials carry the "
            "currents. In space give the coil in coils and use field.force(name) or field.torque(name)."
        )


def check_torque(field: MagneticField) -> None:
    if field.axisymmetric:
        raise ValueError("an axisymmetric field has no torque: it is the same at every angle.")


def current_force(field: MagneticField, coil: Names) -> Floats:
    """Return ``J x B`` times the volume of every quadrature point, (2, npoints)."""
    check_plane(field)
    inside = elements_in(field.mesh, coil)
    current = np.where(inside, field.current_density, 0.0)
    if not current.any():
        raise ValueError(f"the coil {coil!r} carries no current; use field.force for the force on its material.")
    plain = np.isclose(field.reluctivity * VACUUM_PERMEABILITY, 1.0) & ~field.remanence.any(axis=0)
    if not plain[inside].all():
        raise ValueError(
            f"the coil {coil!r} is magnetic, so the Lorentz force is only a part; use field.force instead."
        )
    # The directions out of the page and along phi are opposite, because x, y, z and r, phi, z are both right-handed.
    at = field.at_quadrature
    right, up = at.flux_density * (-1.0 if field.axisymmetric else 1.0)
    return field.point_volumes * current[at.element] * np.stack((-up, right))


def checked_point(
    name: str, value: ArrayLike, kind: str = "point (x, y) in m", sizes: tuple[int, ...] = (2,)
) -> Floats:
    point = np.asarray(value)
    fits = point.ndim == 1 and point.size in sizes and point.dtype.kind in "iuf"
    if not fits or not np.isfinite(point).all():
        raise ValueError(f"{name} must be a {kind}; got {value!r}.")
    return point.astype(float)
