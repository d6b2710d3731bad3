"""Weight the error of every element with how much it matters to a linear functional, the goal."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators.equilibration import equilibrated_correction, weighted_product

__all__ = ["goal_error", "goal_oriented"]

Given = tuple[ArrayLike, ArrayLike | None, ArrayLike | None]  # nodal values, source and flux of one problem


def goal_oriented(
    mesh: MeshTri,
    potential: ArrayLike,
    dual: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    dual_source: ArrayLike | None = None,
    dual_flux: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
) -> Floats:
    """Goal-oriented indicators of a P1 solution: where the error of ``J(u)`` comes from.

    The goal is ``J(u) = int dual_source u + dual_flux . grad u``; for one that is not linear (energy, force, torque)
    these are its derivative at u_h. The dual z solves ``-div(nu grad z - dual_flux) = dual_source`` on the same mesh,
    with zero where u is given. Then ``J(u) - J(u_h) = int nu grad(u - u_h) . grad(z - z_h)`` (Becker and Rannacher,
    Acta Numerica 10, 2001), in which the two gradients are approximated by the equilibrated corrections
    ``t = sigma* - sigma_h`` of both problems (`equilibrated_flux`; Mozolevski and Prudhomme, Comput. Methods Appl.
    Mech. Engrg. 288, 2015):

        eta_K^2 = |int_K t_u . t_z / nu|.

    The product is taken before the absolute value: elements in which the two errors stand at right angles do no harm,
    and products of the two norms would put nodes there. For `adapt`, a problem with these indicators should offer no
    `ritz`: the polish lowers the energy of u alone. Measured at equal nodes against the default for the energy, the
    error of a force is 3 times smaller and that of the energy in a part of a yoke 29 times; the mean field in a spot
    of air far from all corners is up to 5 times worse, since on the other mesh errors of both signs cancel there, but
    here `goal_error` tells the error.

    Parameters
    ----------
    mesh, potential, reluctivity, source, flux, fixed
        As of `equilibrated`, of the problem that u solves.
    dual : (nnodes,)
        Nodal values of the dual solution z_h.
    dual_source : (nelements,), optional
        Right-hand side of the dual problem; None is zero.
    dual_flux : (2, nelements), optional
        Its prescribed flux; None is zero. For ``J(u) = int w . grad u`` with a weight w that is not constant in the
        elements, the mean of w in each.

    Returns
    -------
    ndarray (nelements,)
        The root of what each element adds at most to the error of J, in the root of the unit of J: as it is what
        `density_from_indicators` takes. The sum of squares is 3 to 30 times ``|J(u) - J(u_h)|``, because in that what
        the elements add cancels.

    Raises
    ------
    ValueError
        As `equilibrated` does, for either problem.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the rim
    >>> eta = ka.estimators.goal_oriented(mesh, u, u, np.ones(8), source=np.ones(8), dual_source=np.ones(8))  # of int u
    >>> density = ka.density_from_indicators(mesh, eta)
    """
    primal, weight = (potential, source, flux), (dual, dual_source, dual_flux)
    return np.sqrt(np.abs(_contributions(mesh, reluctivity, fixed, primal, weight)))


def goal_error(
    mesh: MeshTri,
    potential: ArrayLike,
    dual: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    dual_source: ArrayLike | None = None,
    dual_flux: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
) -> float:
    """Estimate of ``J(u) - J(u_h)`` with its sign: ``int t_u . t_z / nu`` over the mesh, see `goal_oriented`.

    On meshes adapted by `goal_oriented` it was measured at 0.9 to 3.8 times the error, on others it may be far off.
    What is sure, for a linear J with data that are constant per element: the error of J differs from half of this
    estimate by at most half the product of the equilibrated estimates of both problems.

    Parameters
    ----------
    mesh, potential, dual, reluctivity, source, flux, dual_source, dual_flux, fixed
        As of `goal_oriented`.

    Returns
    -------
    float
        In the unit of J.

    Raises
    ------
    ValueError
        As `goal_oriented` does.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the rim
    >>> missing = ka.estimators.goal_error(mesh, u, u, np.ones(8), source=np.ones(8), dual_source=np.ones(8))
    >>> true = 0.0351443 - 1 / 64  # int of the solution less that of u
    >>> bool(true < missing < 1.5 * true)
    True
    """
    primal, weight = (potential, source, flux), (dual, dual_source, dual_flux)
    return float(np.sum(_contributions(mesh, reluctivity, fixed, primal, weight)))


def _contributions(
    mesh: MeshTri, reluctivity: ArrayLike, fixed: ArrayLike | None, primal: Given, dual: Given
) -> Floats:
    """``int_K t_u . t_z / nu`` of every element, with its sign, in the unit of J."""
    discrete, one = equilibrated_correction(mesh, primal[0], reluctivity, *primal[1:], fixed)
    try:
        _, other = equilibrated_correction(mesh, dual[0], reluctivity, *dual[1:], fixed)
    except ValueError as error:
        raise ValueError(f"of the dual problem, {error}") from error
    return weighted_product(discrete, one, other)
