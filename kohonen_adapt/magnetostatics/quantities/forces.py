"""Forces and torques by the stress around a body, by Arkkio and by Lorentz."""

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import (
    Component,
    Cut,
    Names,
    air_elements,
    component_value,
    elements_in,
    isolated_body,
    mirror_cut,
    sector_cut,
    stress_force,
    weight_at_nodes,
    weight_gradient,
)
from kohonen_adapt.magnetostatics.quantities.local_field import LocalField

__all__ = [
    "arkkio_torque",
    "checked_point",
    "eggshell_force",
    "eggshell_torque",
    "force_component",
    "lorentz_force",
    "lorentz_torque",
    "torque_component",
]

NARROW = 1e-6  # least width of a gap, relative to the radius
ROUND = 0.05  # allowed distance of the sides of a gap from two circles, relative to the width of the gap


def force_component(field: LocalField, body: Names, direction: Floats) -> Component:
    slope, cut = _shell(field, body)
    along = _along(field, cut, direction)
    return Component(slope, np.tile(along[:, None], slope.shape[1]))


def torque_component(field: LocalField, body: Names, centre: ArrayLike) -> Component:
    _check_planar(field)
    inside, middle = isolated_body(field, body), checked_point("centre", centre)
    weight = weight_at_nodes(field, inside, sector_cut(field.elements.corners, inside, middle))
    slope = weight_gradient(field, inside, weight)
    x, y = field.at_quadrature.x - middle[:, None]
    return Component(slope, np.stack((-y, x)))


def eggshell_force(field: LocalField, body: Names) -> Floats:
    slope, cut = _shell(field, body)
    parts = stress_force(field.point_volumes, slope, field.at_quadrature.flux_density)
    return _along(field, cut, np.sum(parts, axis=1))


def eggshell_torque(field: LocalField, body: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
    return component_value(field.point_volumes, torque_component(field, body, centre), field.at_quadrature.flux_density)


def arkkio_torque(field: LocalField, gap: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
    """Return the torque on the interior of a ring of air, by Arkkio's method.

    ``T = 1 / (mu0 (r_o - r_i)) int r B_r B_phi`` over the ring between the radii r_i and r_o (Arkkio, Acta Polytechnica
    Scandinavica El. 59, 1987).

    Parameters
    ----------
    field
        A planar field.
    gap
        Subdomain, or sequence of subdomains, that is the ring. In a periodic sector: its part in the sector, with the
        torque on the sector.
    centre : (2,)
        Centre of the ring, in m.

    Returns
    -------
    float
        In N m per metre of depth, with `depth` in N m; counter-clockwise.

    Raises
    ------
    ValueError
        If the field is axisymmetric, if the ring is not air, or if its sides deviate from two circles about the centre
        by more than 5 % of its width.
    """
    _check_planar(field)
    ring, middle = elements_in(field.mesh, gap), checked_point("centre", centre)
    solid = int(np.count_nonzero(~air_elements(field)[ring]))
    if solid:
        raise ValueError(
            f"the ring {gap!r} must be air (permeability 1, no current, no remanence) in every element; it is not in "
            f"{solid} of {len(ring)}. Name a ring of air around the rotor."
        )
    inner, outer = _radii(field, ring, middle, gap)
    element, barycentric, size = field.elements.fine_rule
    inside = ring[element]
    at = field.at_shares(element[inside], barycentric[:, inside])
    (x, y), (right, up) = at.x - middle[:, None], at.flux_density
    product = (x * right + y * up) * (x * up - y * right) / np.hypot(x, y)
    total = float(np.sum(size[inside] * product)) * (1.0 if field.depth is None else field.depth)
    return total / (VACUUM_PERMEABILITY * (outer - inner))


def lorentz_force(field: LocalField, coil: Names) -> Floats:
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
    return _along_axis(field, np.sum(_current_force(field, coil), axis=1))


def lorentz_torque(field: LocalField, coil: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
    """Return the torque on the currents of a coil, ``int (x - centre) x (J x B)``.

    Parameters
    ----------
    field, coil
        As in `lorentz_force`; the field must be planar.
    centre : (2,)
        In m.

    Returns
    -------
    float
        In N m per metre of depth, with `depth` in N m; counter-clockwise.

    Raises
    ------
    ValueError
        If the field is axisymmetric, and as in `lorentz_force`.
    """
    _check_planar(field)
    force = _current_force(field, coil)
    x, y = field.at_quadrature.x - checked_point("centre", centre)[:, None]
    return float(np.sum(x * force[1] - y * force[0]))


def _shell(field: LocalField, body: Names) -> tuple[Floats, Cut]:
    inside = isolated_body(field, body)
    cut = mirror_cut(field.elements.corners, inside)
    return weight_gradient(field, inside, weight_at_nodes(field, inside, cut)), cut


def _along(field: LocalField, cut: Cut, force: Floats) -> Floats:
    total = _along_axis(field, force)
    return total if cut.direction is None else cut.direction * (cut.direction @ total)


def _along_axis(field: LocalField, force: Floats) -> Floats:
    return force * (0.0, 1.0) if field.axisymmetric else force


def _check_plane(field: LocalField) -> None:
    if len(field.mesh.p) != 2:
        raise ValueError(
            "lorentz_force, lorentz_torque and arkkio_torque are for meshes of triangles, whose materials carry the "
            "currents. In space give the coil in coils and use field.force(name) or field.torque(name)."
        )


def _check_planar(field: LocalField) -> None:
    _check_plane(field)
    if field.axisymmetric:
        raise ValueError("an axisymmetric field has no torque: it is the same at every angle.")


def _current_force(field: LocalField, coil: Names) -> Floats:
    """Return ``J x B`` times the volume of every quadrature point, (2, npoints)."""
    _check_plane(field)
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


def _radii(field: LocalField, ring: Mask, centre: Floats, gap: Names) -> tuple[float, float]:
    mesh = field.elements.corners
    first, second = mesh.f2t
    edge = mesh.facets[:, ring[first] != (ring[second] & (second >= 0))]
    radius = np.hypot(*(mesh.p - centre[:, None]))[edge]
    inner, outer = float(radius.min()), float(radius.max())
    # without the straight sides of a sector
    along = np.abs(radius[0] - radius[1]) < 0.5 * np.hypot(*(mesh.p[:, edge[0]] - mesh.p[:, edge[1]]))
    deviation = np.minimum(radius - inner, outer - radius)[:, along]
    if outer - inner < NARROW * outer or not deviation.size or deviation.max() > ROUND * (outer - inner):
        raise ValueError(
            f"the ring {gap!r} must be bounded by two circles about the centre {tuple(centre.tolist())}; its nodes "
            f"there are at radii between {inner:.6g} and {outer:.6g} m. Give its centre, or a subdomain that is a ring."
        )
    return inner, outer


def checked_point(
    name: str, value: ArrayLike, kind: str = "point (x, y) in m", sizes: tuple[int, ...] = (2,)
) -> Floats:
    point = np.asarray(value)
    fits = point.ndim == 1 and point.size in sizes and point.dtype.kind in "iuf"
    if not fits or not np.isfinite(point).all():
        raise ValueError(f"{name} must be a {kind}; got {value!r}.")
    return point.astype(float)
