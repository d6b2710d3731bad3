"""Forces and torques on bodies, and Lorentz forces on currents."""

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import (
    Component,
    Cut,
    Names,
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
    "check_planar",
    "checked_point",
    "current_force",
    "eggshell_force",
    "eggshell_torque",
    "force_component",
    "lorentz_force",
    "torque_component",
]


def force_component(field: LocalField, body: Names, direction: Floats) -> Component:
    slope, cut = _shell(field, body)
    along = _along(field, cut, direction)
    return Component(slope, np.tile(along[:, None], slope.shape[1]))


def torque_component(field: LocalField, body: Names, centre: ArrayLike) -> Component:
    check_planar(field)
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
    return _along_axis(field, np.sum(current_force(field, coil), axis=1))


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


def check_planar(field: LocalField) -> None:
    _check_plane(field)
    if field.axisymmetric:
        raise ValueError("an axisymmetric field has no torque: it is the same at every angle.")


def current_force(field: LocalField, coil: Names) -> Floats:
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


def checked_point(
    name: str, value: ArrayLike, kind: str = "point (x, y) in m", sizes: tuple[int, ...] = (2,)
) -> Floats:
    point = np.asarray(value)
    fits = point.ndim == 1 and point.size in sizes and point.dtype.kind in "iuf"
    if not fits or not np.isfinite(point).all():
        raise ValueError(f"{name} must be a {kind}; got {value!r}.")
    return point.astype(float)
