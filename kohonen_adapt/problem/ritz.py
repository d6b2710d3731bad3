"""The Ritz functional of a problem as its user states it, with the solution that belongs to it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import is_number, with_nearest_names
from kohonen_adapt.mesh.names import named
from kohonen_adapt.mesh.polynomials import count_unknowns
from kohonen_adapt.problem.robin import Robin, checked_conditions, sides_of_boundary
from kohonen_adapt.problem.tables import (
    EnergyLaw,
    check_axis,
    checked_flux,
    checked_laws,
    checked_signs,
    constants,
    floats,
    flux_table,
    numbers,
)

__all__ = ["VECTORS", "Flux", "Ritz", "Source", "check_fits", "parts_of", "unknown_in_space"]

Source = ArrayLike | Callable[[Floats, Ints], ArrayLike]
Flux = ArrayLike | Callable[[Floats, Ints], ArrayLike]

VECTORS = "vector problems, with several unknowns per node, are moved by the map alone"
SYNONYMS = {
    "solution": "values",
    "u": "values",
    "potential": "values",
    "dirichlet": "fixed",
    "conductivity": "coefficient",
    "diffusion": "coefficient",
    "permeability": "coefficient",
    "reluctivity": "coefficient",
    "load": "source",
    "rhs": "source",
    "f": "source",
    "remanence": "flux",
    "subdomains": "region",
    "neumann": "robin",
    "degree": "order",
    "periodic": "signs",
    "goal": "dual",
}


@dataclass(frozen=True, eq=False)
class Ritz:
    """The functional that the exact solution minimises, and a solution of it by elements of order 1 to 3.

    ``Pi(u) = int coefficient / 2 |grad u|^2 - source u - flux . grad u``, of which
    ``-div(coefficient grad u - flux) = source`` is the Euler equation; where no value is fixed the natural boundary
    condition holds. What a problem's ``ritz(mesh, solution)`` returns. Nonlinear material has ``W(|grad u|)``, with
    ``W(b) = int_0^b H db`` of a law H, in place of ``coefficient / 2 |grad u|^2``.

    Around an axis x = 0, of u = x A with a field that turns with the angle,
    ``Pi(u) = int coefficient / (2 x) |grad u|^2 - source u - flux . grad u``, with laws ``x W(|grad u| / x)``. There u
    is 0 on the axis and falls like x^2: in an element with corners there, functions of the elements are multiplied by
    ``s = 1 - sum of the barycentric coordinates of these corners``, which is 1 where the next element begins and, on a
    side that ends at the axis, the same in both its elements. Those that are 0 on all such sides fall like x^2 as they
    are, where only a corner is on the axis, and stay so. The integrals are finite, and u is admissible: the functional
    bounds the exact one from above.

    On tetrahedra the elements are of order 1, and there is no axis, no Robin condition, no dual and no sign.

    Parameters
    ----------
    values
        (nunknowns,): values of the solution, in the order of scikit-fem's `ElementTriP1`, `ElementTriP2` or
        `ElementTriP3` on the mesh: of order 1 at the nodes, (nnodes,).
    fixed
        (nunknowns,) bool: which of these are given (Dirichlet).
    coefficient
        > 0: a constant, or one value per region number, (nregions,).
    source
        A constant, or one value per region number, (nregions,). Where it varies inside regions, a function of x (2, n)
        or (3, n) and the region numbers there (n,) that returns (n,), smooth in each region. A quadrature rule of
        degree 2 order + 4 integrates it, on tetrahedra of degree 7, with points inside elements. The loops of the
        polish on tetrahedra have one value around each node in each region, its weighted mean; the functional by the
        rule decides whether a sweep or a recycling stays. There a function counts as a source that ends at every curved
        surface. In the plane a flux that is a function has no polish beside it.
    flux
        0.0 for none; a constant (2,), or one per region number, (2, nregions); of a magnet ``nu (-Br_y, Br_x)``. On
        tetrahedra it has three components. Where it varies inside regions of a mesh in the plane, a function of x
        (2, n) and the region numbers there (n,) that returns (2, n), smooth in each: an element has the mean over three
        points (half-way from its middle to its corners).
    region
        (nelements,) of integers >= 0: the number that each element looks its constants up by. None where there are no
        tables to look up. The constants must not change inside a region of the mesh, a connected set of elements that
        carry the same subdomain names; a flux that does is a function.
    laws
        None or a law per region number, (nregions,); a law is an object with the methods ``field_strength(b)``, which
        rises from 0, and its integral ``energy(b)``, both for arrays of b >= 0. Where there is one the coefficient has
        no say. Empty for a linear problem.
    order
        Degree of the elements, 1, 2 or 3.
    axisymmetric
        Whether the functional is that around the axis x = 0. Its values are those of u at the places of the unknowns,
        given as 0 on the axis.
    robin
        Name of a boundary to (kappa, load): ``int kappa / 2 u^2 - load u`` over its facets, all on the outer boundary,
        is a part of the functional, so that ``(coefficient grad u - flux) . n + kappa u = load`` is the natural
        condition there (Robin, of convection or an open boundary; Neumann with kappa = 0). kappa >= 0 is a constant,
        the load a constant or a function of x (2, n) that returns (n,), interpolated at the unknowns. The polish
        improves the values there, and the nodes stay where they are. Around an axis both are integrated over 1 / x.
    dual
        The functional of the dual solution z of a goal J, where the mesh is to be adapted for that: with the
        coefficient of this one, J as its load, and zeros given where values are. What is lowered then is ``share Pi(u)
        + Pi_dual(z) / share``, which lies above its minimum by ``(share |e|^2 + |d|^2 / share) / 2``, and that is no
        less than ``|e| |d| >= |J(u) - J(u_h)|``, e and d the errors of u and z in the energy norm. Both have the same
        order, in the plane, no laws and the signs of this one.
    share
        > 0: best ``|d| / |e|``, as estimated. `adapt` keeps that of the first mesh, so that passes compare.
    comparable
        Whether values of the functional on different meshes may be compared; not where it was linearised at a solution,
        as the dual of a goal that is not linear.
    shapes_only
        Whether it is not what the mesh is for, as without the dual of a goal, and only gives elements their shapes: all
        passes of `adapt` exchange nodes by the indicators then, and the polish moves nodes and flips edges. Such a
        functional is not comparable.
    signs
        Pairs of names of boundaries, as of `Rules.periodic`, to 1 where the function is the same on both (periodic), or
        -1 where it is the other's negative (antiperiodic). What is `fixed` has no part in that. Values on boundaries
        that are pairs of the mesh, but of which nothing is said here, stay as they are, and so do their nodes.

    Notes
    -----
    `adapt` and `polish` refuse a solution at which the functional is not stationary: a residual at a free unknown of
    more than 1 % of the terms there and 0.1 % of the largest terms anywhere. Quadrature rules other than those of the
    functional are allowed for where source or flux are functions.

    Raises
    ------
    ValueError
        If a shape does not fit, something is not finite, the coefficient is not positive, or a region number has no
        entry in a table, or a law lacks a method; if there is a dual, and one of both has laws or an axis, or the
        dual another order, other places where values are given or a dual of its own.

    Examples
    --------
    -lap u = 1 with u = 0 on the boundary, on one region; `solution` stands for what a solver returns:

    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(3).with_subdomains({"chip": lambda x: x[0] < 0.5, "board": lambda x: x[0] > 0.5})
    >>> solution = np.zeros(mesh.nvertices)
    >>> rim = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
    >>> ritz = ka.Ritz(values=solution, fixed=rim, coefficient=1.0, source=1.0)

    Materials by subdomain, of conductivity 1 and 100, with heat in the chip:

    >>> number = np.isin(np.arange(mesh.nelements), mesh.subdomains["chip"]).astype(int)
    >>> ritz = ka.Ritz(solution, rim, coefficient=[1.0, 100.0], source=[0.0, 1e4], region=number)

    Convection to air of temperature 20 on the boundary "right" by 5 W/(m^2 K), a Robin condition:

    >>> mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})
    >>> left = np.isin(np.arange(mesh.nvertices), mesh.nodes_satisfying(lambda x: x[0] == 0.0))
    >>> ritz = ka.Ritz(solution, left, 1.0, robin={"right": (5.0, 5.0 * 20.0)})

    A source that varies, -lap u = f(x):

    >>> ritz = ka.Ritz(solution, rim, 1.0, source=lambda x, region: np.exp(-np.sum(x**2, axis=0)))
    """

    values: ArrayLike
    fixed: ArrayLike
    coefficient: ArrayLike
    source: Source = 0.0
    flux: Flux = 0.0
    region: ArrayLike | None = None
    laws: Sequence[EnergyLaw | None] = ()
    order: int = 1
    axisymmetric: bool = False
    robin: Robin = field(default_factory=dict)
    dual: "Ritz | None" = None
    share: float = 1.0
    comparable: bool = True
    shapes_only: bool = False
    signs: Mapping[tuple[str, str], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.order, bool) or self.order not in (1, 2, 3):
            raise ValueError(f"order of Ritz must be the degree of the elements, 1, 2 or 3; got {self.order!r}.")
        if not isinstance(self.axisymmetric, bool):
            raise ValueError(f"axisymmetric of Ritz must be True or False; got {self.axisymmetric!r}.")
        region = None if self.region is None else numbers(self.region)
        values, fixed = floats("values", self.values), np.array(self.fixed)
        if values.ndim != 1:
            raise ValueError(f"values of Ritz must have shape (nunknowns,); got {values.shape}.")
        if fixed.dtype != np.bool_ or fixed.shape != values.shape:
            raise ValueError(
                f"fixed of Ritz must be bool of shape (nunknowns,) = {values.shape}; got {fixed.dtype} of shape "
                f"{fixed.shape}. From numbers: numpy.isin(numpy.arange(nunknowns), numbers)."
            )
        coefficient = constants("coefficient", self.coefficient, (), region)
        if not np.all(coefficient > 0.0):
            raise ValueError(f"coefficient of Ritz must be > 0; got {coefficient.min()}.")
        source = self.source if callable(self.source) else constants("source", self.source, (), region)
        flux = self.flux if callable(self.flux) else checked_flux(self.flux, region)
        # Copies: what the caller does to his arrays later must not change a functional in use.
        names = ("values", "fixed", "coefficient", "source", "flux", "region", "laws")
        laws = checked_laws(self.laws, region)
        for name, own in zip(names, (values, fixed, coefficient, source, flux, region, laws), strict=True):
            object.__setattr__(self, name, own)
        object.__setattr__(self, "robin", checked_conditions(self.robin))
        object.__setattr__(self, "signs", checked_signs(self.signs))
        _check_dual(self)


Ritz.__init__ = with_nearest_names(SYNONYMS)(Ritz.__init__)  # type: ignore[method-assign]


def _check_dual(ritz: Ritz) -> None:
    """Refuse a dual that is none, and a share that says nothing."""
    if not is_number(ritz.share) or not 0.0 < ritz.share < np.inf:
        raise ValueError(f"share of Ritz must be a finite number > 0; got {ritz.share!r}.")
    if not isinstance(ritz.comparable, bool):
        raise ValueError(f"comparable of Ritz must be True or False; got {ritz.comparable!r}.")
    if not isinstance(ritz.shapes_only, bool) or (ritz.shapes_only and ritz.comparable):
        raise ValueError(
            f"shapes_only of Ritz must be False, or True with comparable=False; got {ritz.shapes_only!r} with "
            f"comparable={ritz.comparable}."
        )
    if ritz.dual is None:
        return
    if not isinstance(ritz.dual, Ritz) or ritz.dual.dual is not None:
        raise ValueError(f"dual of Ritz must be a Ritz without a dual, or None; got {ritz.dual!r}.")
    if ritz.laws or ritz.dual.laws:
        raise ValueError("a Ritz with a dual must have no laws; the dual of a nonlinear problem has none either.")
    if ritz.axisymmetric or ritz.dual.axisymmetric:
        raise ValueError("a Ritz with a dual must be that of a plane, both; one is axisymmetric.")
    if ritz.order != ritz.dual.order:
        raise ValueError(f"a Ritz and its dual must be of the same order; got {ritz.order} and {ritz.dual.order}.")
    if not np.array_equal(np.asarray(ritz.dual.fixed), np.asarray(ritz.fixed)):
        counts = [np.count_nonzero(one.fixed) for one in (ritz, ritz.dual)]
        raise ValueError(
            f"fixed of the dual of a Ritz must be that of the Ritz, with {counts[0]} given; got {counts[1]} or others."
        )


def parts_of(ritz: Ritz) -> tuple[Ritz, ...]:
    """The functionals that are added up, with the share of each in its constants."""
    if ritz.dual is None:
        return (ritz,)
    return _times(ritz.share, replace(ritz, dual=None)), _times(1.0 / ritz.share, replace(ritz.dual, signs=ritz.signs))


def _times(factor: float, ritz: Ritz) -> Ritz:
    """A functional without laws, multiplied."""

    def scaled(given: Any) -> Any:
        return (lambda *at: factor * np.asarray(given(*at))) if callable(given) else factor * np.asarray(given)

    constants = {name: scaled(getattr(ritz, name)) for name in ("coefficient", "source", "flux")}
    robin = {name: (factor * kappa, scaled(load)) for name, (kappa, load) in ritz.robin.items()}
    return replace(ritz, robin=robin, **constants)


def check_fits(ritz: Ritz, mesh: Mesh) -> None:
    """Refuse a functional of another mesh."""
    unknowns, elements = count_unknowns(mesh, ritz.order), mesh.t.shape[1]
    if np.shape(ritz.values) != (unknowns,):
        wanted = "nnodes" if ritz.order == 1 else f"nunknowns of order {ritz.order}"
        several = np.size(ritz.values) in (2 * unknowns, 3 * unknowns)
        raise ValueError(
            f"values of Ritz must have shape ({wanted},) = ({unknowns},); got {np.shape(ritz.values)}."
            + f" A Ritz is of one unknown per node: {VECTORS}." * several
        )
    if ritz.region is not None and np.shape(ritz.region) != (elements,):
        raise ValueError(f"region of Ritz must have shape (nelements,) = ({elements},); got {np.shape(ritz.region)}.")
    if not callable(ritz.flux):
        flux_table(np.asarray(ritz.flux), mesh.dim())
    if ritz.axisymmetric:
        check_axis(np.asarray(ritz.values), np.asarray(ritz.fixed), mesh)
    for name in ritz.robin:
        sides_of_boundary(mesh, name)
    for name in (name for names in ritz.signs for name in names):
        named(mesh.boundaries, name, "boundary")


def unknown_in_space(ritz: Ritz) -> str:
    """What of a functional is for the plane only, as the end of a sentence; empty where it holds on tetrahedra."""
    has = {
        f"its Ritz is of order {ritz.order}": ritz.order > 1,
        "its Ritz is axisymmetric": ritz.axisymmetric,
        "its Ritz has Robin conditions": bool(ritz.robin),
        "its Ritz has a dual": ritz.dual is not None,
        "its Ritz has signs of pairs": bool(ritz.signs),
        "the flux of its Ritz is a function": callable(ritz.flux),
    }
    return next((f"{reason}, and that is for the plane only" for reason, found in has.items() if found), "")
