"""Estimate the error of a magnetic field: of its energy as that of a scalar problem, of a goal by the dual one."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators import (
    duality_gap,
    equilibrated,
    equilibrated_flux,
    goal_oriented,
    recovery,
    residual,
)
from kohonen_adapt.magnetostatics.equations.around_axis import AroundAxis
from kohonen_adapt.magnetostatics.equations.conditions import (
    Boundaries,
    Conditions,
    conditions_of,
    fixed_values,
    ties_of,
)
from kohonen_adapt.magnetostatics.equations.higher import facet_products
from kohonen_adapt.magnetostatics.equations.newton import Newton, Scalar, scalar_problem
from kohonen_adapt.magnetostatics.materials.coefficients import coercivity_at
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.solution import quadratic_solution, tangent_solution
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients, inner_points, signed_area
from kohonen_adapt.outline.rounding import refined_on_arcs
from kohonen_adapt.problem.outputs import Output

__all__ = ["RESIDUAL_SCALE", "better_values", "error_of_goal", "estimated", "goal_indicators"]

SolveFrom = Callable[[MeshTri, MeshTri, Field], Field]  # on a mesh, from the solution on another


# What the residual indicators are multiplied by, so that the root of their sum of squares is near the error.
# The ratio of that root to the true error, unscaled, measured by test_magnetostatics.py and benchmark M:
#     cylinder in a disk, rings, 817 to 12 481 nodes                  3.61 - 3.78
#     rectangle in free space, squares / Gmsh, 400 to 9 500 nodes     3.57 - 3.77 / 3.24 - 3.64
#     benchmark M, permeability 1 / 1000, squares, 441 to 25 921      3.58 - 3.78 / 3.56 - 3.59
#     the same after one to three relocations                         3.51 - 3.66
# With 1 / 3.6 all of them come within 10 %.
RESIDUAL_SCALE = 1.0 / 3.6
# The same for elements of order 2: smooth fields on squares and random meshes 5.9 - 6.4, a rectangle magnet 6.0 - 6.1,
# corners of iron 6.0 - 6.2 (test_quadratic.py). With 1 / 6.1 all of them come within 5 %. Of order 3: smooth fields 8.5
# - 10.0, a rectangle magnet 9.6, adapted 10.1 (test_cubic.py); with 1 / 9.7 within 12 %. A round magnet on curved
# elements: of order 2 5.9 - 6.0, of order 3 10.2 - 10.6 (`benchmarks curves`).
HIGHER_SCALES = {2: 1.0 / 6.1, 3: 1.0 / 9.7}
# Around an axis a coil alone and around an iron core, squares, and adapted with and without the polish (`benchmarks
# axis`): of order 1 3.4 - 4.8, of order 2 4.3 - 8.9, of order 3 6.6 - 13.9, most where the polish stretches elements.
AXIS_SCALES = HIGHER_SCALES | {1: 1.0 / 4.2}

ENDS, OPPOSITE = TRIANGLE.facets, list(TRIANGLE.opposite)  # scikit-fem's sides of a triangle

# Corners and middles of sides by barycentric coordinates.
LATTICE = np.vstack((np.eye(3), [np.eye(3)[list(ends)].mean(axis=0) for ends in ENDS]))

Facets = tuple[Ints, Ints, Floats]  # facets that are one, and the sign between them


def estimated(
    mesh: MeshTri, field: Field, estimator: str, boundaries: Boundaries, materials: Mapping[str, Material]
) -> Floats:
    """Indicators by the estimator of that name, (nelements,), unsquared."""
    joined = None
    if boundaries.periodic or boundaries.antiperiodic:
        joined = ties_of(field.elements, boundaries.periodic, boundaries.antiperiodic).facets
    turns = any(material.turns for material in materials.values())
    beyond, order = beyond_mean(field, materials) if turns and field.order == 1 else None, field.order
    if estimator == "residual" and (order > 1 or field.axisymmetric):
        scale = (AXIS_SCALES if field.axisymmetric else HIGHER_SCALES)[order]
        return scale * residual_by_points(field, joined, beyond)
    if estimator == "equilibrated":
        return bound(mesh, field, boundaries)
    given, unknown = field.coefficients, field.unknown
    plain = not given.pieces and not field.axisymmetric
    scalar = scalar_problem(field.elements, field.symmetry, given) if plain else linearised(field, estimator)
    flux = scalar.flux if beyond is None else scalar.flux.reshape(2, -1, mesh.t.shape[1]) + beyond
    if estimator == "residual":
        bare = residual(mesh, unknown, scalar.reluctivity, source=scalar.source, flux=flux, joined=joined)
        return RESIDUAL_SCALE * bare
    kind = _kinds(field, list(materials.values()))
    return recovery(mesh, unknown, scalar.reluctivity, source=scalar.source, flux=flux, region=kind)


def beyond_mean(field: Field, materials: Mapping[str, Material]) -> Floats:
    """What the flux of magnets that turn is at the corners of elements beyond its mean there, (2, 3, nelements).

    By the points that the mean is from. The means alone jump between elements where magnets do not: a Halbach cylinder
    had an estimate of 0.6 of its error by the residual, and polished of 1.6 by the recovery; so both are within 11 %.
    """
    number, x = field.coefficients.number, inner_points(field.mesh.p[:, field.mesh.t])
    inside = np.stack([coercivity_at(materials, x[:, k], number) for k in range(3)], axis=1)
    return field.symmetry.flux(2.0 * (inside - inside.mean(axis=1, keepdims=True)))


def _kinds(field: Field, materials: Sequence[Material]) -> Ints | None:
    """Number of the first material that equals an element's, (nelements,), where reluctivity or flux change inside one;
    None where these themselves tell regions apart.
    """
    alike = np.array([materials.index(material) for material in materials])
    varies = field.axisymmetric or field.coefficients.pieces or any(material.turns for material in materials)
    return alike[field.coefficients.number] if varies else None


def bound(mesh: MeshTri, field: Field, boundaries: Boundaries) -> Floats:
    """Guaranteed indicators of a planar field: the duality gap, which for linear material are the equilibrated ones."""
    fixed, _ = fixed_values(field.elements, boundaries)
    given = field.coefficients
    source, flux = given.current_density, given.flux
    if not given.pieces:
        return equilibrated(mesh, field.potential, given.reluctivity, source=source, flux=flux, fixed=fixed)
    balanced = equilibrated_flux(mesh, field.potential, field.reluctivity, source=source, flux=flux, fixed=fixed)
    return duality_gap(mesh, field.potential, balanced, given.stored, given.costored, flux=flux)


def linearised(field: Field, estimator: str) -> Scalar:
    """The scalar problem that a nonlinear solution solves, or one around an axis, and what weights its error there.

    Its flux makes ``nu grad u - flux`` the field strength of the solution, whatever the weight nu. A scalar has to
    stand for the tensor of nonlinear material, differential along B and secant across it. Where B changes along itself,
    H is off its average along B, which the differential reluctivity weights. Jumps are of any direction: the root of
    the determinant weights them. On the tube of test_nonlinear.py, iron at 1.9 to 2.0 T with a ratio of 16 of the
    two, this gives 0.85 - 0.88 of the error by recovery and 0.96 - 1.25 by the residual, which with the differential
    reluctivity has 0.55 - 0.69.
    """
    weight = field.differential_reluctivity
    if estimator == "residual":
        weight = np.sqrt(field.reluctivity * weight)
    reluctivity, slope = (
        field.symmetry.reluctivity(field.elements.middles, weight),
        gradient(field.mesh, field.unknown),
    )
    strength = field.field_strength
    if field.axisymmetric:
        slope, strength = slope[:, None], field.at_corners.field_strength.reshape(2, 3, -1)
    flux = reluctivity * slope - field.symmetry.flux(strength.reshape(2, -1)).reshape(strength.shape)
    return Scalar(reluctivity, flux, field.symmetry.source(field.current_density))


def residual_by_points(field: Field, joined: Facets | None, beyond: Floats | None = None) -> Floats:
    """``eta_K^2 = h_K^2 ||J + div q||_K^2 / nu_K + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu)``, unsquared, (nelements,).

    q is ``nu grad u - flux``, the field strength turned by a right angle: of a degree less than the potential in every
    element, for nonlinear material by its values at the corners, and of order 3 and beside curves in the middles of the
    sides. Symbols and `joined` as of `estimators.residual`.
    """
    elements, given = field.elements, field.coefficients
    shape, size = elements.shape, area(field.mesh)
    points = LATTICE if elements.order == 3 or shape.curved.any() else LATTICE[:3]
    at = field.at_each(points.T)
    symmetry, count = field.symmetry, size.size
    flux = symmetry.flux(at.field_strength).reshape(2, len(points), -1) / symmetry.turn
    if beyond is not None:
        flux = flux - beyond / symmetry.turn
    secant, differential = at.reluctivities
    weight = np.sqrt(secant * differential).reshape(len(points), -1).mean(axis=0)
    squared = np.mean((given.current_density + divergences(flux, shape)) ** 2, axis=0)
    around = symmetry.volume(elements.middles, np.ones(count))
    middle = shape.corners.p[:, shape.corners.facets].mean(axis=1)
    jumps = _jumps(shape, flux, weight, joined, symmetry.volume(middle, np.ones(middle.shape[1])))
    return np.sqrt(size**2 * around * squared / weight + jumps)


def divergences(flux: Floats, shape: Isoparametric) -> Floats:
    """Divergence of a vector (2, points, nelements) known on the `LATTICE`: in each element, or in the middles of its
    sides, which tell the mean of a squared linear function.
    """
    hats = hat_gradients(shape.corners)
    if flux.shape[1] == 3:
        return np.einsum("cik,cik->k", flux, hats)[None]
    slopes, rows = np.stack([_slopes(share) for share in LATTICE[3:]]), np.flatnonzero(shape.curved)
    found = np.einsum("cpk,spi,cik->sk", flux, slopes, hats, optimize=True)
    for divergence, share, slope in zip(found, LATTICE[3:], slopes, strict=True):
        bent = shape.hats(rows, np.repeat(share[:, None], rows.size, axis=1))
        divergence[rows] = np.einsum("cpk,pi,cik->k", flux[:, :, rows], slope, bent, optimize=True)
    return found


def _slopes(share: Floats) -> Floats:
    """Derivatives of the functions of order 2 on the `LATTICE` by barycentric coordinates, (6, 3)."""
    at_middles = [4.0 * (share[a] * np.eye(3)[b] + share[b] * np.eye(3)[a]) for a, b in ENDS]
    return np.vstack((np.diag(4.0 * share - 1.0), at_middles))


def _jumps(shape: Isoparametric, flux: Floats, weight: Floats, joined: Facets | None, around: Floats) -> Floats:
    """The facet part: a jump that is a polynomial on a facet, from its values at both ends and in the middle.

    Around an axis that is integrated over the way around it of every facet, (nfacets,).
    """
    mesh, degree = shape.corners, flux.shape[1] // 3  # 1 or 2
    nfacets, normals = mesh.facets.shape[1], outward(shape)
    outflow, largest = np.zeros((degree + 1, nfacets)), np.zeros(nfacets)
    sides, along, clockwise = np.zeros(nfacets, dtype=int), np.zeros(nfacets, dtype=bool), signed_area(mesh) < 0.0
    for side, ends in enumerate(ENDS):
        facet = mesh.t2f[side]
        first = mesh.t[ends[0]] == mesh.facets[0, facet]
        points = zip((*ends, 3 + side), normals[side], strict=True)
        at = [np.einsum("ck,ck->k", flux[:, point], normal) for point, normal in list(points)[: degree + 1]]
        np.add.at(outflow[0], facet, np.where(first, at[0], at[1]))
        np.add.at(outflow[1], facet, np.where(first, at[1], at[0]))
        if degree == 2:
            np.add.at(outflow[2], facet, at[2])
        np.maximum.at(largest, facet, weight)
        np.add.at(sides, facet, 1)
        along[facet] = first ^ (side == 2) ^ clockwise  # runs counter-clockwise in the only element of an outer facet
    jump, turned = np.where(sides == 2, outflow, 0.0), [1, 0, 2][: degree + 1]
    if joined is not None:
        one, other, sign = joined
        same = along[one] != along[other]  # partners run against one another
        beyond = np.where(same, outflow[:, other], outflow[turned][:, other])
        jump[:, one] = outflow[:, one] + sign * beyond
        jump[:, other] = sign * np.where(same, jump[:, one], jump[turned][:, one])
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = np.einsum("if,ij,jf->f", jump, facet_products(degree), jump)
    return 0.5 * np.sum((around * squared / largest)[mesh.t2f], axis=0)


def outward(shape: Isoparametric) -> Floats:
    """The tangents of sides turned outwards, at both ends and in the middle, (3 sides, 3 points, 2, nelements).

    An integral over a side is one from 0 to 1 over what has these as factors: they are as long as a straight side.
    """
    mesh = shape.corners
    straight = -2.0 * (area(mesh) * hat_gradients(mesh))[:, OPPOSITE].swapaxes(0, 1)
    (along, up), sense = shape.bent[:, OPPOSITE], np.sign(signed_area(mesh)) * [[1.0], [1.0], [-1.0]]
    bow = 4.0 * np.stack((sense * up, -sense * along), axis=1)
    return np.stack((straight + bow, straight - bow, straight), axis=1)


def goal_indicators(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton) -> Floats:
    """Indicators of a goal, (nelements,), unsquared, in the root of its unit."""
    pair = _pair(field, goal, boundaries, newton)
    if isinstance(field.elements, AroundAxis):  # there B falls like 1 / r inside elements, too
        for name, strength in zip(("flux", "dual_flux"), field.strength_at_corners(pair["dual"]), strict=True):
            turned = field.symmetry.flux(strength)
            pair[name] = pair[name][:, None] - turned + turned.mean(axis=1, keepdims=True)
    return goal_oriented(field.mesh, **pair)


def error_of_goal(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton, solve_from: SolveFrom) -> float:
    """Estimate of what the goal's value is short of, with its sign."""
    return better_values(field, {"goal": goal}, boundaries, newton, solve_from)["goal"] - goal(field)


def better_values(
    field: Field, outputs: Mapping[str, Output], boundaries: Boundaries, newton: Newton, solve_from: SolveFrom
) -> dict[str, float]:
    """What outputs of a field of order 1 would be with P2 elements on its mesh, and with nothing cut off its arcs.

    Values are those of the outputs themselves: the derivative of one leaves out the part that is quadratic in the error
    and, where its weight is not constant in the elements (the arm of a torque), the variation of that. These are as
    large as what is left when the errors of the elements have cancelled, as on a mesh adapted for the output.

    What lies between chords and arcs falls to a quarter where arcs have twice the facets: on the mesh refined once, the
    difference that rounder arcs make is three quarters of that.
    """
    quadratic, pair = quadratic_solution(field, boundaries, newton), refined_on_arcs(field.mesh)
    values = {name: float(output(quadratic)) for name, output in outputs.items()}
    if pair is not None:
        chords, arcs = (solve_from(finer, field.mesh, field) for finer in pair)
        for name, output in outputs.items():
            values[name] += (output(arcs) - output(chords)) / 0.75
    return values


def _pair(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton) -> dict[str, Any]:
    """A field and its dual as two problems ``-div(nu grad u - flux) = source`` of one scalar nu, by argument.

    Of nonlinear material that scalar stands for the tensor of the linearised problem: the root of its determinant. The
    fluxes make ``nu grad u - flux`` the field strength, and of the dual its change, whatever nu is.
    """
    source, load = goal.derivative(field)
    elements, symmetry, u, at = field.elements, field.symmetry, field.unknown, field.at_quadrature
    load = load if load.shape == at.x.shape else load[:, at.element]
    dual = tangent_solution(field, boundaries, elements.loads(source, load), newton)
    weight, current = (
        np.sqrt(field.reluctivity * field.differential_reluctivity),
        symmetry.source(field.current_density),
    )
    nu = symmetry.reluctivity(elements.middles, weight)
    change = symmetry.flux(at.change_of_strength(symmetry.flux_density(at.x, elements.gradient(dual))))
    strength, change = elements.balanced(symmetry.flux(at.field_strength), current), elements.balanced(change, source)
    return {
        "potential": u,
        "dual": dual,
        "reluctivity": nu,
        "source": current,
        "flux": nu * gradient(field.mesh, u) - strength,
        "dual_source": source,
        "dual_flux": nu * gradient(field.mesh, dual) - change + elements.balanced(load, np.zeros_like(source)),
        "fixed": _given(conditions_of(elements, boundaries, symmetry)),
    }


def _given(conditions: Conditions) -> Mask:
    """Nodes whose value is given, and those of pairs and of the open boundary: there what the field lacks of
    equilibrium is no part of the estimate.
    """
    fixed = conditions.held
    beyond = conditions.open_boundary
    return fixed if beyond is None else fixed | (beyond.matrix.diagonal() > 0.0)
