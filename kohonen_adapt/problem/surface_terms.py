"""Offsets and loads of a discontinuous potential on surfaces in space."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD, NO_SURFACE, OFFSET

__all__ = ["SurfaceTerms", "checked_surface", "corner_values", "nodal_terms", "reduced_regions", "surface_work"]


@dataclass(frozen=True, eq=False)
class SurfaceTerms:
    """Offsets and loads at nodes of a P1 functional on tetrahedra.

    In reduced regions the function is u minus an offset, as a scalar potential is outside iron if u is the total
    potential in iron. The functional is ``Pi(u - offset) - sum load (u - offset)``.

    Attributes
    ----------
    nodal
        Offset and load at the nodes, shape (nnodes, 2). Offsets are 0 except on surfaces between reduced regions and
        the rest, loads are 0 except on faces of regions.
    reduced
        Reduced regions by their number in `Ritz`, shape (nregions,).
    on_mesh
        Function of a mesh with the same subdomains that returns `nodal` there, for the same potential.
    """

    nodal: Floats
    reduced: NDArray[np.bool_]
    on_mesh: Callable[[MeshTet], Floats]


def checked_surface(given: SurfaceTerms | None, nodes: int, region: NDArray[np.int64] | None) -> None:
    if given is None:
        return
    if not isinstance(given, SurfaceTerms) or np.shape(given.nodal) != (nodes, 2):
        raise ValueError(f"surface of Ritz must be SurfaceTerms with nodal of shape ({nodes}, 2); got {given!r}.")
    needed = 1 if region is None else int(region.max(initial=0)) + 1
    if len(given.reduced) < needed:
        raise ValueError(f"reduced of SurfaceTerms must have {needed} entries; got {len(given.reduced)}.")


def nodal_terms(surface: SurfaceTerms | None) -> Floats:
    return NO_SURFACE if surface is None else surface.nodal


def reduced_regions(surface: SurfaceTerms | None, number: Ints) -> Mask:
    return np.zeros(np.shape(number), dtype=np.bool_) if surface is None else np.asarray(surface.reduced)[number]


def corner_values(values: Floats, nodal: Floats, node: Ints, reduced: Mask) -> Floats:
    if not len(nodal):
        return values[node]
    return values[node] - np.where(reduced, nodal[node, OFFSET], 0.0)


def surface_work(values: Floats, nodal: Floats) -> float:
    return float(nodal[:, LOAD] @ (values - nodal[:, OFFSET])) if len(nodal) else 0.0
