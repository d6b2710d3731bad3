"""Fluxes of finite element solutions of scalar problems, checked."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import count_unknowns, number_facets
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["DiscreteFlux", "discrete_flux", "of_dual"]

LEAST_FLUX, LARGEST_FLUX = 1e-100, 1e100  # squares of these times areas and volumes are in the range of numbers


@contextmanager
def of_dual() -> Iterator[None]:
    # Messages name the dual problem.
    try:
        yield
    except ValueError as error:
        raise ValueError(f"of the dual problem, {error}") from error


@dataclass(frozen=True)
class DiscreteFlux:
    """Flux ``nu grad u - flux`` of a solution of ``-div(nu grad u - flux) = source``."""

    space: Space
    potential: Floats  # (nunknowns,): u
    reluctivity: Floats  # (nelements,)
    source: Floats  # (nelements,)
    prescribed: Floats  # (d, d + 1, nelements): the argument `flux` at the corners, linear between them

    def at(self, barycentric: Floats) -> Floats:
        """Return the flux at coordinates (n, d + 1) of every element, (d, n, nelements)."""
        slope = self.space.gradient_in_each(self.potential, barycentric)
        prescribed = barycentric @ self.prescribed
        return self.reluctivity * slope.reshape(prescribed.shape) - prescribed

    @cached_property
    def at_corners(self) -> Floats:
        return self.at(np.eye(self.space.dim + 1))

    @cached_property
    def mean(self) -> Floats:
        """Means of the flux over straight elements of order 1, (d, nelements)."""
        return self.at_corners.mean(axis=1)

    def product(self, one: Floats, other: Floats) -> Floats:
        """Return ``int_K one . other / nu`` per element, shape (nelements,).

        The two fluxes are linear in every element, given at its corners, (d, d + 1, nelements).
        """
        product = np.sum(one * other, axis=(0, 1)) + np.sum(one.sum(axis=1) * other.sum(axis=1), axis=0)
        corners = one.shape[1]
        return self.space.volumes / (corners * (corners + 1)) * product / self.reluctivity


def discrete_flux(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    source: ArrayLike | None,
    flux: ArrayLike | None,
    order: int = 1,
    varying: bool = True,
) -> DiscreteFlux:
    # A flux of shape (d, nelements) is constant in elements. Without `varying` no other is allowed.
    check_mesh(mesh, curved=order > 1)
    number_facets(mesh)
    dim, nelements = len(mesh.p), mesh.nelements
    shape = {str(dim): dim, str(dim + 1): dim + 1, "nelements": nelements}
    if not (varying and np.ndim(0.0 if flux is None else flux) == len(shape)):
        del shape[str(dim + 1)]
    name, place = ("nnodes", "node") if order == 1 else ("nunknowns", "unknown")
    nodal = finite_reals("potential", potential, {name: count_unknowns(mesh, order)}, place)
    load = finite_reals(
        "source", np.zeros(nelements) if source is None else source, {"nelements": nelements}, "element"
    )
    prescribed = finite_reals("flux", np.zeros((dim, nelements)) if flux is None else flux, shape, "element")
    corners = np.broadcast_to(prescribed.reshape(dim, -1, nelements), (dim, dim + 1, nelements))
    if is_second_order(mesh):  # the space sorts the corners
        corners = np.take_along_axis(corners, np.argsort(mesh.t, axis=0)[None], axis=1)
    material = finite_reals("reluctivity", reluctivity, {"nelements": nelements}, "element")
    bad = np.flatnonzero(material <= 0.0)
    if bad.size:
        raise ValueError(
            f"reluctivity must be positive; it is not in {bad.size} of {material.size} elements, "
            f"first {bad[0]} ({material[bad[0]]:g})."
        )
    found = DiscreteFlux(Space(mesh, order, arcs=False), nodal, material, load, corners)
    with np.errstate(over="ignore", invalid="ignore"):
        largest = float(np.abs(found.at_corners).max())
    if not (largest == 0.0 or LEAST_FLUX <= largest <= LARGEST_FLUX):
        raise ValueError(
            f"nu grad u - flux must be 0, or from {LEAST_FLUX:g} to {LARGEST_FLUX:g} at most; its largest component is "
            f"{largest:.3g}, and indicators would be 0 or infinite. Choose another unit of the potential."
        )
    return found
