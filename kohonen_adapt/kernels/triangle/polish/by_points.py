"""Functionals of elements with curved sides, or around an axis, by quadrature.

The formulas are those of `descend_higher`, except that the columns of the Jacobian of the quadratic map replace
the edge vectors a - x_v and b - x_v at every point. The columns depend on x_v in the same way as the edge vectors,
because the midside offsets of curved sides stay constant.

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
    VALUE,
)
from kohonen_adapt.kernels.vectors import (
    ZERO,
    add_to,
    cross,
    dot,
    from_to,
    minus,
    plus,
    plus_dot,
    plus_square,
    plus_times,
    put,
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
def add_by_law(trial, reference, block, e, j, local, a, b, wanted):
    slope, added, dof = reference.slope, block.added, block.dof
    law = trial.laws.number[e]
    magnitude = total = 0.0
    gradient, hessian = (0.0, 0.0), ZERO
    functions, inwards = slope.shape[1], turned(minus(b, a))  # the derivative of the doubled area
    doubled = cross(a, b)
    inverse = 1.0 / doubled
    flux = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    for i in range(functions if wanted > VALUE else 0):
        for other in range(functions + 3):
            added[i, other] = 0.0
    coarse = wanted == COARSE_BLOCK
    for q in range(0 if coarse else reference.plain, reference.plain if coarse else slope.shape[0]):
        w = reference.weight[q]
        slope_1 = slope_2 = 0.0
        for i in range(functions):
            slope_1 += local[i] * slope[q, i, 0]
            slope_2 += local[i] * slope[q, i, 1]
        n = weighted(slope_2, a, -slope_1, b)
        g = times(inverse, n)
        density, rate, curve = energy_density(trial.laws, law, dot(g, g))
        energy, push = 0.5 * w * doubled * density, w * cross(n, flux)
        magnitude += energy + abs(push)
        total += energy - push
        if wanted == VALUE:
            continue
        weight, curve_weight = w * rate * inverse, 2.0 * w * curve * inverse
        f = weighted(weight, n, w, turned(flux))
        on_a, on_b = dot(g, a), dot(g, b)
        t11 = weight * dot(b, b) + curve_weight * on_b * on_b
        t12 = -weight * dot(a, b) - curve_weight * on_a * on_b
        t22 = weight * dot(a, a) + curve_weight * on_a * on_a
        rest_1, rest_2 = -dot(f, b), dot(f, a)
        for i in range(functions):
            if dof[j, i] < 0:
                continue
            g1, g2 = slope[q, i, 0], slope[q, i, 1]
            added[i, functions] += g1 * rest_1 + g2 * rest_2
            h1, h2 = t11 * g1 + t12 * g2, t12 * g1 + t22 * g2
            for other in range(i + 1):
                added[i, other] += h1 * slope[q, other, 0] + h2 * slope[q, other, 1]
        if wanted < POSITION:
            continue
        difference = slope_1 - slope_2
        # dn/dx - g dD/dx and dn/dy - g dD/dy with the doubled area D
        n_x, n_y = plus_times((difference, 0.0), -inwards[0], g), plus_times((0.0, difference), -inwards[1], g)
        square_x, square_y = dot(g, n_x), dot(g, n_y)
        area_factor = w * (rate * dot(g, g) - 0.5 * density)
        change = weighted(weight * difference, n, -area_factor, inwards)
        gradient = plus(gradient, plus_times(change, w * difference, turned(flux)))
        products = times(weight, (dot(n_x, n_x), dot(n_x, n_y), dot(n_y, n_y)))
        hessian = plus(hessian, plus_square(products, curve_weight, (square_x, square_y)))
        x, y = weighted(weight, n_x, curve_weight * square_x, g), weighted(weight, n_y, curve_weight * square_y, g)
        mixed_x_1, mixed_x_2 = plus_dot(f[0], times(-1.0, x), b), dot(x, a) - f[0]
        mixed_y_1, mixed_y_2 = plus_dot(f[1], times(-1.0, y), b), dot(y, a) - f[1]
        for i in range(functions):
            added[i, functions + 1] += slope[q, i, 0] * mixed_x_1 + slope[q, i, 1] * mixed_x_2
            added[i, functions + 2] += slope[q, i, 0] * mixed_y_1 + slope[q, i, 1] * mixed_y_2
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
def gather_offsets(shapes, e, k, offset):
    for i in range(3):
        put(offset, i, xy(shapes.offset[e], (k + i) % 3))


@inner_kernel
def put_offsets(shapes, e, k, offset):
    for i in range(3):
        put(shapes.offset[e], (k + i) % 3, xy(offset, i))
    shapes.special[e] = shapes.around or is_curved(offset)


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
def valid_at(position, offset, v, a, b):
    x = xy(position, v)
    return is_valid(offset, from_to(x, position, a), from_to(x, position, b))


@inner_kernel
def jacobian_at(offset, c, a, b):
    first, second, third = xy(offset, 0), xy(offset, 1), xy(offset, 2)
    sign = 4.0 if c == 0 else -4.0
    p = plus_times(a, 4.0, minus(first, second)) if c == 2 else plus_times(a, sign, third)
    return p, plus_times(b, 4.0, minus(first, third)) if c == 1 else plus_times(b, sign, second)


@inner_kernel
def add_by_points(descent, e, j, local, offset, x, a, b, wanted):
    trial, block, points, around = descent.trial, descent.block, descent.points, descent.shapes.around
    dof, sign, across = block.dof, block.sign, block.across
    magnitude = total = 0.0
    gradient, hessian = (0.0, 0.0), ZERO
    kind, functions = axis_kind(x[0], a[0], b[0]) if around else 0, points.slope.shape[2]
    law, load = trial.laws.number[e], 3.0 * trial.data[e, SIXTH_SOURCE]
    half = trial.data[e, HALF_COEFFICIENT]
    flux = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    few = law < 0 or wanted == COARSE_BLOCK
    for q in range(0 if few else points.plain, points.plain if few else points.weight.shape[1]):
        w, side, slope = points.weight[kind, q], points.side[kind, q], points.slope[kind, q]
        slope_1 = slope_2 = level = lead = 0.0
        p, r = a, b
        radius = 1.0
        for k in range(3):
            p, r = plus_times(p, side[k, 1], xy(offset, k)), plus_times(r, side[k, 2], xy(offset, k))
        if around:
            lead = points.share[kind, q, 0]
            radius = x[0] + points.share[kind, q, 1] * a[0] + points.share[kind, q, 2] * b[0]
            for k in range(3):
                radius += side[k, 0] * offset[k, 0]
        for i in range(functions):
            slope_1 += local[i] * slope[i, 0]
            slope_2 += local[i] * slope[i, 1]
            level += local[i] * points.value[kind, q, i]
        doubled, edge = cross(p, r), minus(r, p)
        difference = slope_1 - slope_2
        inverse = 1.0 / (radius * doubled)
        rise = lead * doubled - radius * edge[1], radius * edge[0]  # derivatives of x D
        n = weighted(slope_2, p, -slope_1, r)
        g = times(inverse, n)
        half_square = 0.5 * dot(g, n)
        weight = w * half * inverse
        curve_weight = rest = 0.0
        energy = weight * half_square / inverse
        n_x, n_y = plus_times((difference, 0.0), -rise[0], g), plus_times((0.0, difference), -rise[1], g)
        if law >= 0:
            density, rate, curve = energy_density(trial.laws, law, dot(g, g))
            weight, energy = w * rate * inverse, 0.5 * w * density / inverse
            curve_weight = 2.0 * w * curve * inverse
            rest = 0.5 * w * (density - rate * dot(g, g))
        square = dot(g, n_x), dot(g, n_y)
        push, pull, area_factor = w * cross(n, flux), load * w * level, rest - weight * half_square
        magnitude += energy + abs(push) + abs(pull * doubled)
        total += energy - push - pull * doubled
        change = weighted(weight * difference, n, area_factor, rise)
        change = plus_times(change, w * difference, turned(flux))
        gradient = plus(gradient, plus_times(change, -pull, turned(edge)))
        products = times(weight, (dot(n_x, n_x), dot(n_x, n_y), dot(n_y, n_y)))
        products = plus_square(products, curve_weight, square)
        hessian = plus(hessian, plus_times(products, area_factor * lead, (-2.0 * edge[1], edge[0], 0.0)))
        for i in range(functions if wanted > VALUE else 0):
            row = dof[j, i]
            if row < 0:
                continue
            g1, g2 = sign[j, i] * slope[i, 0], sign[j, i] * slope[i, 1]
            e_i, turn = weighted(g2, p, -g1, r), g1 - g2
            pulled = load * w * points.value[kind, q, i]
            pulled *= sign[j, i]
            put(across, i, e_i)
            along = dot(g, e_i)
            block.rest[row] += weight * dot(e_i, n) - w * cross(e_i, flux) - pulled * doubled
            mixed = times(weight, plus_times((dot(n_x, e_i), dot(n_y, e_i)), turn, n))
            add_to(block.mixed, row, plus_times(mixed, along, times(curve_weight, square)))
            add_to(block.mixed, row, weighted(-pulled, turned(edge), turn, times(w, turned(flux))))
            for other in range(i + 1):
                column = dof[j, other]
                if column >= 0:
                    product = weight * dot(e_i, xy(across, other))
                    product += curve_weight * along * dot(g, xy(across, other))
                    block.stiffness[max(row, column), min(row, column)] += product
    return magnitude, total, gradient, hessian
