"""Forces and torques on bodies and on coils, in the plane and in space.

A force along a vector is the work by a shift of a body, and a torque about an axis the work by a turn. Plane and space
have these motions and the stress in the air around the body in common. Only the cuts of a body at the outer boundary
differ, see `cuts`, and the coils that need no elements, see `coil_quantities`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.magnetostatics.coils.motion import images_of, motion_of
from kohonen_adapt.magnetostatics.coils.rules import currents_of
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE, Solver
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import air_elements, isolated_body
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil, is_coil
from kohonen_adapt.magnetostatics.quantities.cuts import Cut, cut_of, without_cancelled
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.quantities.point_values import PointValues
from kohonen_adapt.mesh.elements.assembly import assembled
from kohonen_adapt.mesh.measures import area, hat_gradients
from kohonen_adapt.mesh.motions import moved
from kohonen_adapt.mesh.names import Names, elements_in

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


def parts_along(field: MagneticField, names: Names, vector: Floats, centre: Floats | None) -> list["OfBody | OfCoil"]:
    """Return the parts of a force along a vector, or of a torque about an axis."""
    if centre is not None:
        check_torque(field)
    listed = names if isinstance(names, Sequence) and not isinstance(names, str) else [names]
    coils = [name for name in listed if is_coil(field, name)]
    found: list[OfBody | OfCoil] = [OfCoil(field, name, motion_of(vector, centre)) for name in coils]
    body = [name for name in listed if name not in coils] if coils else names
    if body or not coils:
        inside = isolated_body(field, body)
        cut = cut_of(field, inside, centre)
        key = "shell", *(np.asarray(part).tobytes() for part in (inside, *cut))
        shell = field.kept.setdefault(key, Shell(field, inside, cut))
        found.append(OfBody(shell, motion_of(without_cancelled(cut, vector, centre is not None), centre)))
    return found


def force_along(field: MagneticField, names: Names, vector: Floats, centre: Floats | None = None) -> float:
    return float(sum(part.value() for part in parts_along(field, names, vector, centre)))


@dataclass(frozen=True, eq=False)
class OfBody:
    shell: "Shell"
    motion: Floats

    @property
    def vanishes(self) -> bool:
        return not self.motion.any()

    def value(self) -> float:
        x, forces = self.shell.forces
        return float(np.sum(forces * moved(self.motion, x)))

    def load(self) -> Floats:
        shell, field, (at, slope, _) = self.shell, self.shell.field, self.shell.at
        weight = np.zeros_like(field.elements.points)
        weight[:, shell.layer[field.elements.element]] = -stress(moved(self.motion, at.x), at.flux_density, slope)
        load = field.load_of(weight)
        if not field.sources.coils:
            return load
        x, element, moment = shell.currents
        return load + field.load_at(x, element, np.cross(moment, moved(self.motion, x), axis=0)) if x.size else load


def stress(u: Floats, v: Floats, w: Floats) -> Floats:
    # ``((v . w) u + (u . v) w - (u . w) v) / mu0``: for u = w = B twice Maxwell's stress tensor of air times v, and for
    # v = B the derivative by B of ``u . T w`` with this tensor T
    one, other, both = (np.sum(a * b, axis=0) for a, b in ((v, w), (u, v), (u, w)))
    return (one * u + other * w - both * v) / VACUUM_PERMEABILITY


@dataclass(frozen=True, eq=False)
class Shell:
    # Weight around a body, and the currents where the weight falls.
    # With ``f = J x B`` in the layer, the force on the body is ``-int T grad w - int w f``. The field of the currents
    # in free space makes no force on the body, so that both integrals leave out its part: T less the stress of this
    # field, and f without B of this field.

    field: MagneticField
    inside: Mask
    cut: Cut

    @cached_property
    def _air(self) -> Mask:
        return air_elements(self.field) & ~self.inside

    @cached_property
    def layer(self) -> Mask:
        # the elements of air where the weight falls
        return (np.ptp(self._weight[self.field.mesh.t], axis=0) > 0.0) & self._air

    @cached_property
    def at(self) -> tuple[PointValues, Floats, Floats]:
        # the field at points of the layer, the gradient of the weight (d, n), and the volumes
        field, (x, element, volumes) = self.field, self.field.points_in(self.layer)
        return field.at(x, element), field.elements.slope_of_corners_at(self._weight, element, x), volumes

    @cached_property
    def currents(self) -> tuple[Floats, Ints, Floats]:
        # points (3, n) of coils in the layer, their elements, and the moments (3, n) in A m times the weight
        field, images = self.field, images_of(self.field.mesh, self.field.mirrors)
        each = [(currents_of(coil.winding), coil.ampere_turns) for coil in field.sources.coils.values()]
        folded = [images.folded(x, total / len(images.sign) * moment) for (x, moment), total in each]
        x, moment = (np.concatenate(part, axis=1) for part in zip(*folded, strict=True))
        factor = np.nan_to_num(field.interpolated(x, self._weight[None, field.mesh.t])[0])
        rows = np.flatnonzero(factor)
        return x[:, rows], field.elements_at(x[:, rows]), factor[rows] * moment[:, rows]

    @cached_property
    def forces(self) -> FloatsPair:
        # points and the forces there, (d, n) each
        field, (at, slope, volumes) = self.field, self.at
        forces = -0.5 * volumes * stress(at.flux_density, slope, at.flux_density)
        if not field.sources.coils:
            return at.x, forces
        free, (x, element, moment) = at.flux_density - field.reaction_at(at.x, at.element), self.currents
        forces += 0.5 * volumes * stress(free, slope, free)
        on_currents = np.cross(moment, field.reaction_at(x, element), axis=0)
        return np.hstack((at.x, x)), np.hstack((forces, -on_currents))

    # Three weights: one layer of elements around the body / the solution of Laplace's equation / this weight.
    # Magnet over iron, meshes of Gmsh, 3623 nodes (F_x = 106.0 N/m):
    #     mean of F_x in N/m               114.0 / 108.7 / 107.2        scatter  2.4 / 0.32 / 0.10
    #     the same meshes adapted          106.0 / 106.0 / 106.0        scatter  0.031 / 0.012 / 0.014
    # Two magnets on a regular grid, 5265 nodes: error of the force 1.2 / 3.1 / 1.1 %, rate of convergence - / 1.5 / 2.

    @cached_property
    def _weight(self) -> Floats:
        """Weight at the nodes, (nnodes,).

        The weight falls smoothly between the levels 3/4 and 1/4 of the P1 solution of Laplace's equation in the air,
        which is 1 on the body, and 0 on all other materials and on the outer boundary except the cut. The exact force
        is the same for any weight with these boundary values. This weight uses the field at a distance from the corners
        of body and neighbours, where B is most accurate, and in many elements. The force converges by the square of the
        element size, also on uniform meshes.
        """
        mesh, air, (along, _, master) = self.field.elements.corners, self._air, self.cut
        values, fixed = np.zeros(master.size), np.zeros(master.size, bool)
        fixed[mesh.t[:, ~air]] = fixed[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), along)]] = True
        fixed[master[fixed]] = True
        values[master[mesh.t[:, self.inside]]] = 1.0
        unknown = np.unique(master[~fixed[master]])
        if unknown.size:
            hats, (i, j) = hat_gradients(mesh)[:, :, air], np.triu_indices(len(mesh.t))
            products = np.sum(hats[:, i] * hats[:, j], axis=0) * area(mesh)[air]
            matrix = assembled(master[mesh.t[:, air]], products, np.arange(master.size), master.size)
            solver, right = IN_SPACE if len(mesh.p) == 3 else Solver(), -(matrix @ values)[unknown]
            values[unknown] = solver.solve(matrix[unknown][:, unknown].tocsc(), right)
        level = np.clip(2.0 * values[master] - 0.5, 0.0, 1.0)
        return level**2 * (3.0 - 2.0 * level)


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
    if point.ndim != 1 or point.size not in sizes or point.dtype.kind not in "iuf" or not np.isfinite(point).all():
        raise ValueError(f"{name} must be a {kind}; got {value!r}.")
    return point.astype(float)
