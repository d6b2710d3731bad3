"""Functionals of elements by quadrature.

Elements of nonlinear material, with curved sides or around an axis have no closed form.

The formulas are those of `patch`, except that the columns of the Jacobian of the quadratic map replace the edge vectors
a - x_v and b - x_v at every point of a curved element. The columns depend on x_v in the same way as the edge vectors,
because the midside offsets of curved sides stay constant.

A nonlinear material has an energy density W(|grad u|^2) in place of c/2 |grad u|^2, and second derivatives by the
coefficients of functions with the gradients g and h on the reference triangle are g T h, with a matrix T of the point.

Around the axis x = 0 the coefficient is divided by x, and a law depends on |grad u| / x. The energy therefore has
x D in place of the doubled area D, while the source and the flux keep D. The radius x of a point depends linearly
on x_v, so x D also has second derivatives.
"""

from kohonen_adapt.kernels.arrays import NEAR_AXIS
from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    COARSE_BLOCK,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    POSITION,
    SIXTH_SOURCE,
    STRAIGHT_SIDED,
    VALUE,
)
from kohonen_adapt.kernels.vectors import (
    ZERO,
    cross,
    dot,
    minus,
    plus,
    plus_dot,
    plus_square,
    plus_times,
    times,
    turned,
    weighted,
    xy,
)

# Minimum Bernstein coefficient of the Jacobian determinant of a curved element, as a fraction of the determinant with
# straight sides, for accurate quadrature and well-conditioned quadratic elements. On facets of 15 degrees every element
# of quality 0.3, the default floor, satisfies the bound, on facets of 30 degrees every element of quality 0.6.
MIN_JACOBIAN = 0.25
SAFETY = 1.0 + 1e-9  # safety factor of `MIN_JACOBIAN` for rounding, so that an accepted element passes a later check


@inner_kernel
def add_by_points(descent, j, x, a, b, wanted):
    trial, block, points, around = descent.trial, descent.block, descent.points, descent.shapes.around
    e, special = block.element[j], block.special[j]
    local = block.local[j]
    added, dof = block.added, block.dof
    offset = block.offset[j]
    law, half = trial.laws.number[e], trial.data[e, HALF_COEFFICIENT]
    load = 3.0 * trial.data[e, SIXTH_SOURCE]
    flux = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    magnitude = total = 0.0
    gradient = (0.0, 0.0)
    hessian = ZERO
    functions = points.slope.shape[2]
    kind = STRAIGHT_SIDED
    if special:
        kind = axis_kind(x[0], a[0], b[0]) if around else 0
    for i in range(functions if wanted > VALUE else 0):
        for other in range(functions + 3):
            added[i, other] = 0.0
    few = law < 0 or wanted == COARSE_BLOCK
    for q in range(0 if few else points.last[kind, 0], points.last[kind, 0 if few else 1]):
        w, slope, value = points.weight[kind, q], points.slope[kind, q], points.value[kind, q]
        p, r = a, b
        radius, lead = 1.0, 0.0
        if special:
            side = points.side[kind, q]
            for k in range(3):
                p, r = plus_times(p, side[k, 1], xy(offset, k)), plus_times(r, side[k, 2], xy(offset, k))
            if around:
                lead = points.share[kind, q, 0]
                radius = x[0] + points.share[kind, q, 1] * a[0] + points.share[kind, q, 2] * b[0]
                for k in range(3):
                    radius += side[k, 0] * offset[k, 0]
        slope_1 = slope_2 = 0.0
        for i in range(functions):
            slope_1 += local[i] * slope[i, 0]
            slope_2 += local[i] * slope[i, 1]
        doubled, edge = cross(p, r), minus(r, p)
        inverse = 1.0 / (radius * doubled)
        n = weighted(slope_2, p, -slope_1, r)
        g = times(inverse, n)
        square = dot(g, g)
        density = half * square
        rate = half
        curve = 0.0
        if law >= 0:
            density, rate, curve = energy_density(trial.laws, law, square)
        energy, push = 0.5 * w * density / inverse, w * cross(n, flux)
        pull = w * load
        magnitude += energy + abs(push)
        total += energy - push
        if load != 0.0:
            level = 0.0
            for i in range(functions):
                level += local[i] * value[i]
            magnitude += abs(pull * level * doubled)
            total -= pull * level * doubled
            gradient = plus_times(gradient, -pull * level, turned(edge))
        if wanted == VALUE:
            continue
        weight, curve_weight = w * rate * inverse, 2.0 * w * curve * inverse
        f = weighted(weight, n, w, turned(flux))
        on_p, on_r = dot(g, p), dot(g, r)
        t11 = weight * dot(r, r) + curve_weight * on_r * on_r
        t12 = -weight * dot(p, r) - curve_weight * on_p * on_r
        t22 = weight * dot(p, p) + curve_weight * on_p * on_p
        rest_1 = -dot(f, r)
        rest_2 = dot(f, p)
        for i in range(functions):
            if dof[j, i] < 0:
                continue
            g1, g2 = slope[i, 0], slope[i, 1]
            added[i, functions] += g1 * rest_1 + g2 * rest_2 - pull * doubled * value[i]
            h1, h2 = t11 * g1 + t12 * g2, t12 * g1 + t22 * g2
            for other in range(i + 1):
                added[i, other] += h1 * slope[other, 0] + h2 * slope[other, 1]
        if wanted < POSITION:
            continue
        difference = slope_1 - slope_2
        rise = lead * doubled - radius * edge[1], radius * edge[0]  # derivatives of x D, in the plane of D
        # dn/dx - g d(x D)/dx and dn/dy - g d(x D)/dy
        n_x, n_y = plus_times((difference, 0.0), -rise[0], g), plus_times((0.0, difference), -rise[1], g)
        along_x, along_y = dot(g, n_x), dot(g, n_y)
        area_factor = w * (0.5 * density - rate * square)
        change = weighted(weight * difference, n, area_factor, rise)
        gradient = plus(gradient, plus_times(change, w * difference, turned(flux)))
        products = times(weight, (dot(n_x, n_x), dot(n_x, n_y), dot(n_y, n_y)))
        products = plus_square(products, curve_weight, (along_x, along_y))
        hessian = plus(hessian, plus_times(products, area_factor * lead, (-2.0 * edge[1], edge[0], 0.0)))
        by_x, by_y = weighted(weight, n_x, curve_weight * along_x, g), weighted(weight, n_y, curve_weight * along_y, g)
        mixed_x_1 = plus_dot(f[0], times(-1.0, by_x), r)
        mixed_x_2 = dot(by_x, p) - f[0]
        mixed_y_1 = plus_dot(f[1], times(-1.0, by_y), r)
        mixed_y_2 = dot(by_y, p) - f[1]
        for i in range(functions):
            pulled = pull * value[i]
            added[i, functions + 1] += slope[i, 0] * mixed_x_1 + slope[i, 1] * mixed_x_2 + pulled * edge[1]
            added[i, functions + 2] += slope[i, 0] * mixed_y_1 + slope[i, 1] * mixed_y_2 - pulled * edge[0]
    if wanted > VALUE:
        put_added(block, j, functions)
    return magnitude, total, gradient, hessian


@inner_kernel
def put_added(block, j, functions):
    dof, sign, added = block.dof, block.sign, block.added
    for i in range(functions):
        row = dof[j, i]
        if row < 0:
            continue
        block.rest[row] += sign[j, i] * added[i, functions]
        block.mixed[row, 0] += sign[j, i] * added[i, functions + 1]
        block.mixed[row, 1] += sign[j, i] * added[i, functions + 2]
        for other in range(i + 1):
            column = dof[j, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += sign[j, i] * sign[j, other] * added[i, other]


@inner_kernel
def axis_kind(x, ax, bx):
    near = NEAR_AXIS * max(x, x + ax, x + bx)
    first, second, third = x <= near, x + ax <= near, x + bx <= near
    count = (1 if first else 0) + (1 if second else 0) + (1 if third else 0)
    if count == 0:
        return 0
    if count == 1:
        return 1 if first else 2 if second else 3
    return 4 if not first else 5 if not second else 6


@inner_kernel
def is_curved(offset):
    for i in range(3):
        if offset[i, 0] != 0.0 or offset[i, 1] != 0.0:
            return True
    return False


@inner_kernel
def is_valid(offset, a, b):
    """Return True if the Jacobian determinant of an element is surely positive.

    The columns of the Jacobian are affine, so the determinant is quadratic. Its six Bernstein coefficients must exceed
    `MIN_JACOBIAN` times the determinant of the element with straight sides. Elements without curved sides are accepted.
    """
    if not is_curved(offset):
        return True
    least = SAFETY * MIN_JACOBIAN * cross(a, b)
    for c in range(3):
        p, r = jacobian_at(offset, c, a, b)
        if not cross(p, r) > least:
            return False
        u, w = jacobian_at(offset, (c + 1) % 3, a, b)
        if not 0.5 * plus_dot(cross(p, w), times(-1.0, turned(r)), u) > least:
            return False
    return True


@inner_kernel
def jacobian_at(offset, c, a, b):
    first, second, third = xy(offset, 0), xy(offset, 1), xy(offset, 2)
    sign = 4.0 if c == 0 else -4.0
    p = plus_times(a, 4.0, minus(first, second)) if c == 2 else plus_times(a, sign, third)
    return p, plus_times(b, 4.0, minus(first, third)) if c == 1 else plus_times(b, sign, second)
