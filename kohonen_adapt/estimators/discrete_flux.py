"""Discrete flux of a P1 solution, with checks of its arguments."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["DiscreteFlux", "checked_reluctivity", "discrete_flux"]

LEAST_FLUX, LARGEST_FLUX = 1e-100, 1e100  # squares of these times areas and volumes are in the range of numbers


@dataclass(frozen=True)
class DiscreteFlux:
    """Flux ``nu grad u - flux`` of a P1 solution, and the data per element."""

    area: Floats  # (nelements,)
    hats: Floats  # (d, d + 1, nelements), gradients of the hat functions
    reluctivity: Floats  # (nelements,)
    source: Floats  # (nelements,)
    prescribed: Floats  # (d, nelements), the argument `flux`
    values: Floats  # (d, nelements), nu grad u - flux


def discrete_flux(
    mesh: Mesh, potential: ArrayLike, reluctivity: ArrayLike, source: ArrayLike | None, flux: ArrayLike | None
) -> DiscreteFlux:
    check_mesh(mesh, space=True)
    number_facets(mesh)
    (dim, nnodes), nelements = mesh.p.shape, mesh.t.shape[1]
    nodal = finite_reals("potential", potential, {"nnodes": nnodes}, "node")
    material = checked_reluctivity(mesh, reluctivity)
    source = np.zeros(nelements) if source is None else source
    flux = np.zeros((dim, nelements)) if flux is None else flux
    load = finite_reals("source", source, {"nelements": nelements}, "element")
    prescribed = finite_reals("flux", flux, {str(dim): dim, "nelements": nelements}, "element")
    hats = hat_gradients(mesh)
    with np.errstate(over="ignore", invalid="ignore"):
        values = material * gradient(mesh, nodal, hats) - prescribed
    check_range(values)
    return DiscreteFlux(area(mesh), hats, material, load, prescribed, values)


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
