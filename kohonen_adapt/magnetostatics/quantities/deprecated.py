"""Functions that are replaced by methods of fields, and will be removed in 1.2."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import air_elements
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.forces import check_plane, check_torque, checked_point, current_force
from kohonen_adapt.magnetostatics.quantities.linkage import Circuit, checked_circuit
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import Names, elements_in

__all__ = ["apparent_inductance", "arkkio_torque", "circuit_current", "energy_inductance", "lorentz_torque"]

NARROW = 1e-6  # least width of a gap, relative to the radius
ROUND = 0.05  # allowed distance of the sides of a gap from two circles, relative to the width of the gap
EQUAL = 0.05  # allowed deviation of the currents of sides from their mean; meshed areas are polygons


def _warn(name: str, instead: str) -> None:
    warnings.warn(f"{name} is deprecated and will be removed in 1.2; use {instead}.", DeprecationWarning, stacklevel=3)


def arkkio_torque(field: Field, gap: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
    """Return the torque on the interior of a ring of air, by Arkkio's method.

    Deprecated, and removed in 1.2: use `Field.torque` of the parts that turn, which needs no ring.

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
    _warn("arkkio_torque", "field.torque(body, centre) of the parts that turn")
    check_plane(field)
    check_torque(field)
    ring, middle = elements_in(field.mesh, gap), checked_point("centre", centre)
    solid = int(np.count_nonzero(~air_elements(field)[ring]))
    if solid:
        raise ValueError(
            f"the ring {gap!r} must be air (permeability 1, no current, no remanence) in every element; it is not in "
            f"{solid} of {len(ring)}. Name a ring of air around the rotor."
        )
    inner, outer = _radii(field, ring, middle, gap)
    at, volumes = field.at_quadrature, field.point_volumes
    if field.order == 1:  # midpoints of sides, for products of coordinates
        at, volumes = field.at_each(0.5 - 0.5 * np.eye(3)), np.tile(field.volume / 3.0, 3)
    inside = ring[at.element]
    (x, y), (right, up) = at.x[:, inside] - middle[:, None], at.flux_density[:, inside]
    product = (x * right + y * up) * (x * up - y * right) / np.hypot(x, y)
    total = float(np.sum(volumes[inside] * product))
    return total / (VACUUM_PERMEABILITY * (outer - inner))


def lorentz_torque(field: Field, coil: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
    """Return the torque on the currents of a coil, ``int (x - centre) x (J x B)``.

    Deprecated, and removed in 1.2: use `Field.torque` of the coil.

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
    _warn("lorentz_torque", "field.torque(coil, centre)")
    check_torque(field)
    force = current_force(field, coil)
    x, y = field.at_quadrature.x - checked_point("centre", centre)[:, None]
    return float(np.sum(x * force[1] - y * force[0]))


def circuit_current(field: Field, circuit: Circuit) -> float:
    """Return the current in the conductor of a circuit.

    Deprecated, and removed in 1.2: use the current that you have given to the problem.

    Parameters
    ----------
    field
        A field.
    circuit
        Subdomain to turns for every side of a coil, negative for return sides: ``{"go": 100, "return": -100}``.

    Returns
    -------
    float
        In A: the total current of a side divided by its turns, averaged over the sides.

    Raises
    ------
    ValueError
        If a side has no turns or no current, or its current differs from the mean by more than 5 %, and for fields on
        tetrahedra.
    """
    _warn("circuit_current", "the current that you have given to the problem")
    return _current(field, circuit)


def _current(field: Field, circuit: Circuit) -> float:
    if len(field.mesh.p) != 2:
        raise ValueError(
            "circuits are sides of coils on meshes of triangles. In space give the coil in coils and use "
            "field.flux_linkage(name, turns) or field.inductance(name, turns)."
        )
    total, sides = area(field.mesh) * field.current_density, checked_circuit(circuit).items()
    currents = {name: float(np.sum(total[elements_in(field.mesh, name)])) / turns for name, turns in sides}
    mean = float(np.mean(list(currents.values())))
    if mean == 0.0 or any(abs(value - mean) > EQUAL * abs(mean) for value in currents.values()):
        found = ", ".join(f"{name!r} {value:.6g} A" for name, value in currents.items())
        raise ValueError(
            f"the sides of a circuit must carry one current; got {found}. Check the signs: turns are negative for "
            "return sides."
        )
    return mean


def apparent_inductance(field: Field, circuit: Circuit) -> float:
    """Return the flux linkage of a circuit divided by its current.

    Deprecated, and removed in 1.2: divide the linkage by the current, as in the example.

    For linear material without magnets and other currents this is the inductance. Magnets and other circuits add flux
    to the linkage, and the result is then no inductance.

    Parameters
    ----------
    field, circuit
        As in `circuit_current`.

    Returns
    -------
    float
        In H per metre of depth; with `depth`, and axisymmetric, in H.

    Raises
    ------
    ValueError
        As in `circuit_current`.

    Examples
    --------
    >>> import skfem
    >>> import kohonen_adapt.magnetostatics as km
    >>> mesh = skfem.MeshTri().refined(4).with_defaults()
    >>> mesh = mesh.with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    >>> materials = {"coil": km.Material(current_density=1e3), "air": km.Material()}
    >>> field = km.Magnetostatics(materials, potential={"left": 0.0, "right": 0.0}).solve(mesh)
    >>> inductance = field.flux_linkage("coil", 10) / 50.0  # in H/m, of 500 A in ten turns
    >>> abs(2.0 * field.energy / 50.0**2 / inductance - 1.0) < 1e-9  # the same by the energy
    True
    """
    _warn("apparent_inductance", "field.flux_linkage(coil, turns) / current, added up over the sides of the coil")
    current = _current(field, circuit)
    return sum(field.flux_linkage(name, turns) for name, turns in circuit.items()) / current


def energy_inductance(field: Field, circuit: Circuit) -> float:
    """Return ``2 W / I^2`` of a circuit, with the stored energy W of the whole field.

    Deprecated, and removed in 1.2: divide ``2 field.energy`` by the squared current.

    Requires linear material without magnets and without current in other circuits. With A = 0 on the boundary the
    result equals `apparent_inductance` up to rounding.

    Parameters
    ----------
    field, circuit
        As in `circuit_current`.

    Returns
    -------
    float
        As in `apparent_inductance`, whose example compares both.

    Raises
    ------
    ValueError
        As in `circuit_current`.
    """
    _warn("energy_inductance", "2 * field.energy / current**2")
    return 2.0 * field.energy / _current(field, circuit) ** 2


def _radii(field: Field, ring: Mask, centre: Floats, gap: Names) -> tuple[float, float]:
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
