"""Ritz functional of a problem, with its finite element solution."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import is_number, with_nearest_names
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.names import named
from kohonen_adapt.problem.boundary_terms import (
    Robin,
    SurfaceTerms,
    checked_conditions,
    checked_surface,
    sides_of_boundary,
)
from kohonen_adapt.problem.tables import (
    EnergyLaw,
    check_axis,
    checked_constants,
    checked_floats,
    checked_flux,
    checked_laws,
    checked_regions,
    checked_signs,
    flux_table,
)

__all__ = ["VECTORS", "Flux", "Ritz", "Source", "check_matches", "parts_of", "plane_only_term"]

Source = ArrayLike | Callable[[Floats, Ints], ArrayLike]
Flux = ArrayLike | Callable[[Floats, Ints], ArrayLike]

VECTORS = "vector problems (several unknowns per node) cannot be polished"
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
    """Ritz functional of a problem, with its finite element solution of order 1 to 3.

    The functional is ``Pi(u) = int coefficient / 2 |grad u|^2 - source u - flux . grad u``. Its Euler equation is
    ``-div(coefficient grad u - flux) = source``, with the natural boundary condition wherever no value is fixed. For a
    nonlinear material with the law H, ``W(|grad u|)`` with ``W(b) = int_0^b H db`` replaces ``coefficient / 2 |grad
    u|^2``. A problem's method ``ritz(mesh, solution)`` returns a `Ritz`.

    Around an axis x = 0, with u = x A for a field A in azimuthal direction, the functional is ``Pi(u) = int coefficient
    / (2 x) |grad u|^2 - source u - flux . grad u``, with laws ``x W(|grad u| / x)``. There u is 0 on the axis and
    decreases like x^2. Hence in an element with corners on the axis the functions are multiplied by s, which is 1 minus
    the sum of the barycentric coordinates of these corners. The factor is 1 at the opposite side or corner and, on a
    side that ends at the axis, equal in both elements. Functions that vanish on all sides ending at the axis are not
    multiplied if only a corner is on the axis, because they decrease like x^2 already. The integrals are finite and u
    is admissible, so the functional is an upper bound of the exact one.

    On tetrahedra the order is 1 or 2. Axis, Robin conditions, dual and signs are for triangles only. Shifts of laws,
    ``W(|grad u - shift|)``, and discontinuities on surfaces are for tetrahedra only.

    Parameters
    ----------
    values
        Values of the solution, shape (nunknowns,), in the order of scikit-fem's `ElementTriP1`, `ElementTriP2` or
        `ElementTriP3` on the mesh, or of `ElementTetP1` or `ElementTetP2`. At order 1 these are the values at the
        nodes, shape (nnodes,).
    fixed
        Mask of the Dirichlet values, shape (nunknowns,).
    coefficient
        Positive constant, or one value per region number, shape (nregions,). Required also with laws, where the value
        of a region with a law has no effect.
    source
        Constant, or one value per region number, shape (nregions,). A source that varies inside regions is a function
        of x, shape (2, n) or (3, n), and of the region numbers there, shape (n,), that returns shape (n,) and is smooth
        in each region. The quadrature rule inside elements has degree 2 order + 4, on tetrahedra degree 7. On
        tetrahedra the polish uses one weighted mean around each node in each region, and accepts a sweep or a recycling
        by the functional with the full rule; a source function is treated as ending at every curved surface. On
        triangles the polish does not accept functions for both source and flux.
    flux
        0.0 for none, a constant, shape (2,), or one per region number, shape (2, nregions). The flux of a magnet is
        ``nu (-Br_y, Br_x)``. On tetrahedra there are three components. On triangles, a flux that varies inside regions
        is a function of x, shape (2, n), and of the region numbers there, shape (n,), that returns shape (2, n) and is
        smooth in each region. Elements use the mean over three points, half-way between centre and corners.
    region
        Integers >= 0 by which elements look up their constants, shape (nelements,). None without tables. The constants
        must not change inside a region of the mesh, which is a connected set of elements with the same subdomain names;
        a flux that changes there is a function.
    laws
        None or a law per region number. A law is an object with the methods ``field_strength(b)``, increasing from 0,
        and ``energy(b)``, its integral, for arrays b >= 0. A law replaces the coefficient. Empty for a linear problem.
    order
        Degree of the elements, 1, 2 or 3.
    axisymmetric
        True for the functional around the axis x = 0. The values are the values of u at the unknowns, fixed to 0 on the
        axis.
    robin
        Pairs (kappa, load) by boundary name. Each pair adds ``int kappa / 2 u^2 - load u`` over the facets of the
        boundary, all on the outer boundary, so that ``(coefficient grad u - flux) . n + kappa u = load`` is the natural
        condition there (Robin, for convection or an open boundary; Neumann with kappa = 0). kappa >= 0 is a constant,
        the load a constant or a function of x, shape (2, n), that returns shape (n,) and is interpolated at the
        unknowns. The polish improves the values on these boundaries, but does not move their nodes. Around an axis both
        integrals have the factor 1 / x.
    dual
        Functional of the dual solution z of a goal J, if the mesh is adapted to the goal: the same coefficient, J as
        the load, and zeros as Dirichlet values. The polish lowers ``share Pi(u) + Pi_dual(z) / share``. With e and d,
        the errors of u and z in the energy norm, the sum exceeds its minimum by ``(share |e|^2 + |d|^2 / share) / 2 >=
        |e| |d| >= |J(u) - J(u_h)|``. Both functionals have the same order and signs, are in the plane and have no laws.
    share
        Weight > 0 of the primal functional, optimal at ``|d| / |e|`` as estimated. `adapt` keeps the weight of the
        first mesh, so that passes compare.
    comparable
        True if values of the functional on different meshes can be compared. False for a functional that is linearised
        at a solution, such as the dual of a nonlinear goal.
    shapes_only
        True if the functional only shapes elements, because the mesh has another purpose, such as a goal without a
        dual. Then all passes of `adapt` recycle nodes by the indicators, and the polish only moves nodes and flips
        edges. Needs ``comparable=False``.
    signs
        1 (periodic: equal values) or -1 (antiperiodic: opposite values) by pair of boundary names, see
        `Rules.periodic`. Fixed values are exempt. On pairs of the mesh without a sign here, values and nodes are
        unchanged.
    shift
        Vector subtracted from ``grad u`` in the laws, as the coercivity of a nonlinear magnet for a scalar potential.
        0.0 for none, a constant, shape (3,), or one per region number, shape (3, nregions). Regions without a law
        ignore it.
    surface
        None, or the offsets and loads of `kohonen_adapt.problem.boundary_terms.SurfaceTerms`. The polish holds
        nodes of surfaces with offsets or loads.

    Notes
    -----
    `adapt` and `polish` raise ValueError for a solution at which the functional is not stationary: a residual at a free
    unknown of more than 1 % of the terms there and 0.1 % of the largest terms. For sources and fluxes that are
    functions the limit includes the differences between quadrature rules. On a mesh that does not resolve the data,
    where quadrature rules disagree in much of the whole load, `adapt` leaves out the polish with a message, and adds
    the data oscillation to the estimate that compares passes.

    Raises
    ------
    ValueError
        If a shape is wrong, if a value is not finite, if the coefficient is not positive, if a region number has no
        entry in a table, or if a law lacks a method. With a dual, if one of both has laws or an axis, or if the dual
        has another order, other fixed unknowns or a dual itself.

    Examples
    --------
    -lap u = 1 with u = 0 on the boundary, on one region; `solution` stands for the result of a solver:

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
    coefficient: ArrayLike = ()
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
    shift: ArrayLike = 0.0
    surface: SurfaceTerms | None = None

    def __post_init__(self) -> None:
        if isinstance(self.order, bool) or self.order not in (1, 2, 3):
            raise ValueError(f"order of Ritz must be the degree of the elements, 1, 2 or 3; got {self.order!r}.")
        if not isinstance(self.axisymmetric, bool):
            raise ValueError(f"axisymmetric of Ritz must be True or False; got {self.axisymmetric!r}.")
        region = None if self.region is None else checked_regions(self.region)
        values, fixed = checked_floats("values", self.values), np.array(self.fixed)
        if values.ndim != 1:
            raise ValueError(f"values of Ritz must have shape (nunknowns,); got {values.shape}.")
        if fixed.dtype != np.bool_ or fixed.shape != values.shape:
            raise ValueError(
                f"fixed of Ritz must be bool of shape (nunknowns,) = {values.shape}; got {fixed.dtype} of shape "
                f"{fixed.shape}. To convert indices, use numpy.isin(numpy.arange(nunknowns), indices)."
            )
        if np.shape(self.coefficient) == (0,):
            raise ValueError(
                "coefficient of Ritz is missing: a positive constant, or one value per region number. A law replaces "
                "the value of its region; if every region has a law, give coefficient=1.0."
            )
        coefficient = checked_constants("coefficient", self.coefficient, (), region)
        if not np.all(coefficient > 0.0):
            raise ValueError(f"coefficient of Ritz must be > 0; got {coefficient.min()}.")
        # Copies, so that later changes of the caller's arrays do not change the functional.
        own = {
            "values": values,
            "fixed": fixed,
            "coefficient": coefficient,
            "source": self.source if callable(self.source) else checked_constants("source", self.source, (), region),
            "flux": self.flux if callable(self.flux) else checked_flux(self.flux, region),
            "region": region,
            "laws": checked_laws(self.laws, region),
            "shift": checked_flux(self.shift, region, "shift"),
            "robin": checked_conditions(self.robin),
            "signs": checked_signs(self.signs),
        }
        for name, value in own.items():
            object.__setattr__(self, name, value)
        checked_surface(self.surface, len(values), region)
        _check_dual(self)


Ritz.__init__ = with_nearest_names(SYNONYMS)(Ritz.__init__)  # type: ignore[method-assign]


def _check_dual(ritz: Ritz) -> None:
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
        raise ValueError("a Ritz with a dual must have no laws, nor must the dual.")
    if ritz.axisymmetric or ritz.dual.axisymmetric:
        raise ValueError("a Ritz with a dual must not be axisymmetric, nor must the dual.")
    if ritz.order != ritz.dual.order:
        raise ValueError(f"a Ritz and its dual must have the same order; got {ritz.order} and {ritz.dual.order}.")
    if not np.array_equal(np.asarray(ritz.dual.fixed), np.asarray(ritz.fixed)):
        counts = [np.count_nonzero(one.fixed) for one in (ritz, ritz.dual)]
        raise ValueError(
            f"fixed of the dual must equal fixed of Ritz, with {counts[0]} fixed unknowns; got {counts[1]}, or others."
        )


def parts_of(ritz: Ritz) -> tuple[Ritz, ...]:
    if ritz.dual is None:
        return (ritz,)

    def scaled(factor: float, given: Any) -> Any:
        return (lambda *at: factor * np.asarray(given(*at))) if callable(given) else factor * np.asarray(given)

    primal, dual = replace(ritz, dual=None), replace(ritz.dual, signs=ritz.signs)
    found = []
    for factor, part in ((ritz.share, primal), (1.0 / ritz.share, dual)):
        constants = {name: scaled(factor, getattr(part, name)) for name in ("coefficient", "source", "flux")}
        robin = {name: (factor * kappa, scaled(factor, load)) for name, (kappa, load) in part.robin.items()}
        found.append(replace(part, robin=robin, **constants))
    return tuple(found)


def check_matches(ritz: Ritz, mesh: Mesh) -> None:
    unknowns, elements = count_unknowns(mesh, ritz.order), mesh.nelements
    if np.shape(ritz.values) != (unknowns,):
        wanted = "nnodes" if ritz.order == 1 else f"nunknowns of order {ritz.order}"
        several = np.size(ritz.values) in (2 * unknowns, 3 * unknowns)
        raise ValueError(
            f"values of Ritz must have shape ({wanted},) = ({unknowns},); got {np.shape(ritz.values)}."
            + f" Ritz has one unknown per node; {VECTORS}." * several
        )
    if ritz.region is not None and np.shape(ritz.region) != (elements,):
        raise ValueError(f"region of Ritz must have shape (nelements,) = ({elements},); got {np.shape(ritz.region)}.")
    if not callable(ritz.flux):
        flux_table(np.asarray(ritz.flux), mesh.dim())
    if mesh.dim() == 2 and (np.any(ritz.shift) or ritz.surface is not None):
        raise ValueError("shift and surface of Ritz are for tetrahedra only.")
    if ritz.axisymmetric:
        check_axis(np.asarray(ritz.values), np.asarray(ritz.fixed), mesh)
    for name in ritz.robin:
        sides_of_boundary(mesh, name)
    for name in (name for names in ritz.signs for name in names):
        named(mesh.boundaries, name, "boundary")


def plane_only_term(ritz: Ritz) -> str:
    has = {
        f"order {ritz.order} of Ritz": ritz.order > 2,
        "axisymmetric of Ritz": ritz.axisymmetric,
        "robin of Ritz": bool(ritz.robin),
        "dual of Ritz": ritz.dual is not None,
        "signs of Ritz": bool(ritz.signs),
        "a function as flux of Ritz": callable(ritz.flux),
    }
    return next((f"{reason} is for triangles only" for reason, found in has.items() if found), "")
