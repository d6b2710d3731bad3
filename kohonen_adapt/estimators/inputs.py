"""Check the arguments that all estimators share, and evaluate the discrete flux they give."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["DiscreteFlux", "discrete_flux"]


@dataclass(frozen=True)
class DiscreteFlux:
    """The flux ``nu grad u - flux`` of a P1 solution, with what an estimator needs beside it, per element."""

    area: Floats  # (nelements,)
    hats: Floats  # (2, 3, nelements), gradients of the hat functions
    reluctivity: Floats  # (nelements,)
    source: Floats  # (nelements,)
    prescribed: Floats  # (2, nelements), the argument `flux`
    values: Floats  # (2, nelements), nu grad u - flux


def discrete_flux(
    mesh: MeshTri, potential: ArrayLike, reluctivity: ArrayLike, source: ArrayLike | None, flux: ArrayLike | None
) -> DiscreteFlux:
    """Check the arguments of an estimator and evaluate the flux of the solution; what is None counts as zero."""
    check_mesh(mesh)
    number_facets(mesh)
    nnodes, nelements = mesh.p.shape[1], mesh.t.shape[1]
    nodal = finite_reals("potential", potential, {"nnodes": nnodes}, "node")
    material = finite_reals("reluctivity", reluctivity, {"nelements": nelements}, "element")
    _check_positive(material)
    load, prescribed = np.zeros(nelements), np.zeros((2, nelements))
    if source is not None:
        load = finite_reals("source", source, {"nelements": nelements}, "element")
    if flux is not None:
        prescribed = finite_reals("flux", flux, {"2": 2, "nelements": nelements}, "element")
    hats = hat_gradients(mesh)
    values = material * gradient(mesh, nodal, hats) - prescribed
    return DiscreteFlux(area(mesh), hats, material, load, prescribed, values)


def _check_positive(reluctivity: Floats) -> None:
    bad = np.flatnonzero(reluctivity <= 0.0)
    if bad.size:
        raise ValueError(
            f"reluctivity must be positive; it is not in {bad.size} of {reluctivity.size} elements, "
            f"first {bad[0]} ({reluctivity[bad[0]]:g})."
        )
