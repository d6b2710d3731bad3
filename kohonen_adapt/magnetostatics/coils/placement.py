"""Checks of coils against a mesh, its materials and its planes of symmetry."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import checked_mapping, point_text
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.motion import images_of
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import subdomains_at
from kohonen_adapt.mesh.cells import centroids_of
from kohonen_adapt.mesh.host import edges_in
from kohonen_adapt.mesh.locate import elements_at
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["check_placement", "checked_coils", "listed_coils"]

INSET = 1e-3  # of the section, by which samples are off the surface of a winding
TOUCHING = 1e-6  # of the section, by which a body may reach into a winding
ALONG_EDGE = np.linspace(0.0, 1.0, 9)[1:-1]
ASYMMETRY = 1e-3  # allowed asymmetric part of the current density


def checked_coils(value: Any) -> dict[str, Coil]:
    expected = "coils must map names to magnetostatics.Coil, as {'winding': coil}"
    coils = checked_mapping(value, expected)
    if not all(isinstance(coil, Coil) for coil in coils.values()):
        raise ValueError(f"{expected}; got {value!r}.")
    return coils


def listed_coils(value: Any) -> list[Coil]:
    coils = list(value) if isinstance(value, Iterable) else [value]
    if isinstance(value, Coil) or not all(isinstance(coil, Coil) for coil in coils):
        raise ValueError(f"coils must be a list of Coil, as list(problem.coils.values()); got {value!r}.")
    return coils


def check_placement(mesh: MeshTet, solid: Mask, coils: Mapping[str, Coil], mirrors: Mapping[str, Mirror]) -> None:
    """Raise ValueError for a coil that the mesh contradicts.

    Parameters
    ----------
    mesh
        The mesh.
    solid : (nelements,)
        True in iron and in magnets.
    coils, mirrors
        Coils and planes of symmetry by name.
    """
    for name, coil in coils.items():
        samples = _inset(coil, INSET).winding.samples
        for plane, mirror in mirrors.items():
            _check_symmetry(name, samples, coils.values(), plane, mirror)
        inside, _ = images_of(mesh, mirrors.values()).folded(samples, samples)
        element = elements_at(mesh, inside)
        if np.any(element < 0):
            low, high = (point_text(end(mesh.p, axis=1)) for end in (np.min, np.max))
            raise ValueError(
                f"the coil {name!r} leaves the mesh at {point_text(inside[:, np.argmax(element < 0)])}, where the far "
                f"boundary would be near; the mesh is from {low} to {high} m. Extend the air around the coil, or give "
                "its field as applied_field."
            )
        met: Ints = element[solid[element]]
        if not met.size:
            met = _met_elements(mesh, np.flatnonzero(solid), _inset(coil, TOUCHING))
        if met.size:
            raise ValueError(
                f"the coil {name!r} meets {subdomains_at(mesh, met[:1])}, which is iron or a magnet, at "
                f"{point_text(centroids_of(mesh, met[0]))}; wind the coil through air."
            )


def _inset(coil: Coil, fraction: float) -> Coil:
    return replace(coil, width=(1.0 - fraction) * coil.width, height=(1.0 - fraction) * coil.height)


def _met_elements(mesh: MeshTet, rows: Ints, coil: Coil) -> Ints:
    # elements with a node, the centroid or points of edges in the winding
    t, (start, end) = mesh.t[:, rows], edges_in(mesh, rows)
    nodes, inside = np.unique(t), np.zeros((2, mesh.nvertices), bool)
    in_winding, crossing = inside
    in_winding[nodes] = coil.contains(mesh.p[:, nodes])
    size = magnitude(np.ptp(coil.path, axis=1)) + coil.width + coil.height
    length = magnitude(mesh.p[:, end] - mesh.p[:, start])
    near = magnitude(mesh.p[:, start] - coil.path.mean(axis=1)[:, None]) < size + length
    start, end = start[near], end[near]
    for fraction in ALONG_EDGE:
        meets = coil.contains((1.0 - fraction) * mesh.p[:, start] + fraction * mesh.p[:, end])
        crossing[start[meets]] = crossing[end[meets]] = True
    met = in_winding[t].any(axis=0) | coil.contains(mesh.p[:, t].mean(axis=1))
    return rows[met | (crossing[t].sum(axis=0) > 1)]


def _check_symmetry(name: str, samples: Floats, coils: Iterable[Coil], plane: str, mirror: Mirror) -> None:
    here, image = (
        np.sum([coil.current_density(x) for coil in coils], axis=0) for x in (samples, mirror.image(samples))
    )
    if magnitude(image + mirror.sign * mirror.reflection @ here).max() > ASYMMETRY * magnitude(here).max():
        raise ValueError(
            f"the coil {name!r} is not symmetric about the plane {plane!r}, to which the flux is {mirror.kind}; give "
            "the whole coil, which crosses the plane at right angles, or the coil and its image."
        )
