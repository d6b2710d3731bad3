"""Data of a scalar problem and discrete flux of a P1 solution, checked."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.host import count_unknowns, number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["DiscreteFlux", "Given", "checked_given", "checked_reluctivity", "discrete_flux", "of_dual"]

LEAST_FLUX, LARGEST_FLUX = 1e-100, 1e100  # squares of these times areas and volumes are in the range of numbers


class Given(NamedTuple):
    # one problem ``-div(nu grad u - flux) = source``
    values: Floats  # (nunknowns,)
    source: Floats  # (nelements,)
    flux: Floats  # (d, d + 1, nelements), at the corners and linear between them


def checked_given(
    mesh: Mesh,
    order: int,
    values: ArrayLike,
    source: ArrayLike | None,
    flux: ArrayLike | None,
    varying: bool = True,
) -> Given:
    # A flux of shape (d, nelements) is constant in elements. Without `varying` no other is allowed.
    dim, nelements = cell_of(mesh).dim, mesh.t.shape[1]
    name, place = ("nnodes", "node") if order == 1 else ("nunknowns", "unknown")
    shape = {str(dim): dim, str(dim + 1): dim + 1, "nelements": nelements}
    if flux is None:
        flux = np.zeros((dim, nelements))
    if not (varying and np.ndim(flux) == len(shape)):
        del shape[str(dim + 1)]
    nodal = finite_reals("potential", values, {name: count_unknowns(mesh, order)}, place)
    load = (
        np.zeros(nelements) if source is None else finite_reals("source", source, {"nelements": nelements}, "element")
    )
    prescribed = finite_reals("flux", flux, shape, "element").reshape(dim, -1, nelements)
    return Given(nodal, load, np.broadcast_to(prescribed, (dim, dim + 1, nelements)))


@contextmanager
def of_dual() -> Iterator[None]:
    # Messages name the dual problem.
    try:
        yield
    except ValueError as error:
        raise ValueError(f"of the dual problem, {error}") from error


@dataclass(frozen=True)
class DiscreteFlux:
    """Flux ``nu grad u - flux`` of a P1 solution, and the data per element."""

    area: Floats  # (nelements,)
    hats: Floats  # (d, d + 1, nelements), gradients of the hat functions
    reluctivity: Floats  # (nelements,)
    source: Floats  # (nelements,)
    prescribed: Floats  # (d, nelements), means of the argument `flux`
    variation: Floats  # (d, d + 1, nelements), of the argument `flux` at the corners from its mean
    values: Floats  # (d, nelements), means of nu grad u - flux

    @property
    def at_corners(self) -> Floats:
        return self.values[:, None] - self.variation

    def product(self, one: Floats, other: Floats) -> Floats:
        """Return ``int_K one . other / nu`` per element, shape (nelements,).

        The two fluxes are linear in every element, given at its corners, (d, d + 1, nelements).
        """
        product = np.sum(one * other, axis=(0, 1)) + np.sum(one.sum(axis=1) * other.sum(axis=1), axis=0)
        corners = one.shape[1]
        return self.area / (corners * (corners + 1)) * product / self.reluctivity


def discrete_flux(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    source: ArrayLike | None,
    flux: ArrayLike | None,
    varying: bool = True,
) -> DiscreteFlux:
    check_mesh(mesh, space=True)
    number_facets(mesh)
    given = checked_given(mesh, 1, potential, source, flux, varying)
    material, hats, mean = checked_reluctivity(mesh, reluctivity), hat_gradients(mesh), given.flux.mean(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        values = material * gradient(mesh, given.values, hats) - mean
    check_range(values)
    return DiscreteFlux(area(mesh), hats, material, given.source, mean, given.flux - mean[:, None], values)


def check_range(flux: Floats) -> None:
    largest = float(np.abs(flux).max())
    if not (largest == 0.0 or LEAST_FLUX <= largest <= LARGEST_FLUX):
        raise ValueError(
            f"nu grad u - flux must be 0, or from {LEAST_FLUX:g} to {LARGEST_FLUX:g} at most; its largest component is "
            f"{largest:.3g}, and indicators would be 0 or infinite. Choose another unit of the potential."
        )


def checked_reluctivity(mesh: Mesh, reluctivity: ArrayLike) -> Floats:
    material = finite_reals("reluctivity", reluctivity, {"nelements": mesh.t.shape[1]}, "element")
    bad = np.flatnonzero(material <= 0.0)
    if bad.size:
        raise ValueError(
            f"reluctivity must be positive; it is not in {bad.size} of {material.size} elements, "
            f"first {bad[0]} ({material[bad[0]]:g})."
        )
    return material
