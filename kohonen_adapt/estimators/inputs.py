"""What all estimators start from: checked arguments and the discrete flux they give."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["DiscreteFlux", "checked", "discrete_flux"]


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
    nodal = checked("potential", potential, {"nnodes": nnodes}, "node")
    material = checked("reluctivity", reluctivity, {"nelements": nelements}, "element")
    _check_positive(material)
    load = checked("source", np.zeros(nelements) if source is None else source, {"nelements": nelements}, "element")
    empty = np.zeros((2, nelements)) if flux is None else flux
    prescribed = checked("flux", empty, {"2": 2, "nelements": nelements}, "element")
    hats = hat_gradients(mesh)
    values = material * gradient(mesh, nodal, hats) - prescribed
    return DiscreteFlux(area(mesh), hats, material, load, prescribed, values)


def checked(name: str, given: ArrayLike, wanted: dict[str, int], place: str) -> Floats:
    """A copy of an argument as floats, or an error that says what of its shape or values is wrong."""
    array = np.asarray(given)
    shape = tuple(wanted.values())
    if array.shape != shape:
        names = ", ".join(wanted) + ("," if len(wanted) == 1 else "")
        raise ValueError(f"{name} must have shape ({names}) = {shape}; got {array.shape}.")
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} must be real numbers; got an array of {array.dtype}.")
    bad = np.flatnonzero(~np.isfinite(array).reshape(-1, shape[-1]).all(axis=0))
    if bad.size:
        raise ValueError(f"{name} must be finite; it is not at {bad.size} of {shape[-1]} {place}s, first {bad[0]}.")
    return array.astype(float)


def _check_positive(reluctivity: Floats) -> None:
    bad = np.flatnonzero(reluctivity <= 0.0)
    if bad.size:
        raise ValueError(
            f"reluctivity must be positive; it is not in {bad.size} of {reluctivity.size} elements, "
            f"first {bad[0]} ({reluctivity[bad[0]]:g})."
        )
