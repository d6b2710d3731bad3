"""Slivers between faces of tetrahedra and curved surfaces, with a P1 function.

A face inscribed in a sphere, cylinder or cone is a chord. An element outside the surface covers the sliver,
which has the material of the element inside, or none. An element inside an outer boundary is extended into
the sliver, with a linear Dirichlet function if there is one. The functional of the function in the true
domain is that of the mesh plus, for every sliver, S = volume times change of the density at one gradient. The
descent lowers the functional plus S + |S|, an upper bound for both domains. With S alone the longest faces
would be at places without a jump of the field, and results on the mesh would suffer from the missing volume.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.geometry import OPPOSITE, corners_of, face_of
from kohonen_adapt.kernels.tetrahedron.polish.energy import density_at, less_shift, value_at
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_patch, signed_distance
from kohonen_adapt.kernels.vectors import (
    ZERO,
    cofactors,
    combined,
    cross,
    divided,
    dot,
    minus,
    norm,
    plus,
    plus_times,
    point,
    times,
)

UNMOVED = (-1, ZERO, 0.0)  # `moved` without a node: (node, position, change of value)


@inner_kernel
def position_of(position, node, moved):
    return moved[1] if node == moved[0] else point(position, node)


@inner_kernel
def face_corners(position, node, e, k, moved):
    a, b, c = face_of(node, e, k)
    return position_of(position, a, moved), position_of(position, b, moved), position_of(position, c, moved)


@inner_kernel
def midpoint_depth(surfaces, p, a, b):
    return -signed_distance(surfaces, p, times(0.5, plus(a, b)))[0]


@inner_kernel
def sliver_volume(surfaces, p, a, b, c):
    height = midpoint_depth(surfaces, p, a, b) + midpoint_depth(surfaces, p, b, c) + midpoint_depth(surfaces, p, c, a)
    return norm(cross(minus(b, a), minus(c, a))) * height / 6.0


@inner_kernel
def density(trial, region, slope, hat):
    """Return the functional per volume, and two derivatives by a nodal value.

    `hat` is the gradient of the shape function of the node.
    """
    g, flux = less_shift(trial, region, slope), times(6.0, point(trial.sixth_flux, region))
    held, rate, curve = density_at(trial, region, g)
    along = dot(g, hat)
    first = 2.0 * rate * along - dot(flux, hat)
    second = 2.0 * rate * dot(hat, hat) + 4.0 * curve * along * along
    return held - dot(flux, slope), first, second


@inner_kernel
def gradients(position, elements, trial, e, moved):
    """Return gradient, gradient of the shape function, and six times the volume.

    The shape function is that of the node in `moved`.
    """
    node = elements.node
    region = elements.region[e]
    v, _, w = moved
    i, j, k, last = corners_of(node, e)
    origin, at_last = position_of(position, last, moved), value_at(trial, region, last)
    a, b = minus(position_of(position, i, moved), origin), minus(position_of(position, j, moved), origin)
    p, q, r = cofactors(a, b, minus(position_of(position, k, moved), origin))
    six = dot(a, p)
    alpha, beta = value_at(trial, region, i) - at_last, value_at(trial, region, j) - at_last
    gamma = value_at(trial, region, k) - at_last
    one, two, three = (1.0 if i == v else 0.0), (1.0 if j == v else 0.0), (1.0 if k == v else 0.0)
    if last == v:
        one, two, three = -1.0, -1.0, -1.0
    hat = divided(combined(one, p, two, q, three, r), six)
    return plus_times(divided(combined(alpha, p, beta, q, gamma, r), six), w, hat), hat, six


@inner_kernel
def is_outside(surfaces, p, a, b, c, top):
    normal = cross(minus(b, a), minus(c, a))
    outwards = signed_distance(surfaces, p, divided(plus(plus(a, b), c), 3.0))[1]
    return dot(normal, minus(top, a)) * dot(normal, outwards) > 0.0


@inner_kernel
def sliver(position, elements, surfaces, trial, e, k, moved):
    """Return S + abs(S) at face k of e, and two derivatives by the value in `moved`.

    The volume of a covered sliver is at most that of the element.
    """
    p, across = elements.patch[e, k], elements.neighbour[e, k]
    a, b, c = face_corners(position, elements.node, e, k, moved)
    outer = is_outside(surfaces, p, a, b, c, position_of(position, elements.node[e, k], moved))
    if across >= 0 and not outer:
        return ZERO  # counted in the element outside
    volume = sliver_volume(surfaces, p, a, b, c)
    slope, hat, six = gradients(position, elements, trial, e, moved)
    if not outer and trial.follows[p]:
        slope = point(trial.rate, p)
        hat = ZERO
    there = density(trial, elements.region[e], slope, hat)
    if outer:
        there, volume = times(-1.0, there), min(volume, abs(six) / 6.0)
        if across >= 0:
            there = plus(there, density(trial, elements.region[across], slope, hat))
    return ZERO if there[0] < 0.0 else times(2.0 * volume, there)


@inner_kernel
def slivers_of(position, elements, surfaces, trial, e, moved):
    total = ZERO
    for k in range(4):
        p = elements.patch[e, k]
        if p >= 0 and trial.counted[p]:
            total = plus(total, sliver(position, elements, surfaces, trial, e, k, moved))
    return total


@inner_kernel
def has_slivers(mesh, trial, v):
    for j in rows_of(mesh.star, v):
        for k in range(4):
            p = mesh.elements.patch[mesh.star.element[j], k]
            if p >= 0 and trial.counted[p]:
                return True
    return False


@inner_kernel
def slivers_around(mesh, trial, v, x, w):
    total = ZERO
    moved = (v, x, w)
    for j in rows_of(mesh.star, v):
        e = mesh.star.element[j]
        total = plus(total, slivers_of(mesh.position, mesh.elements, mesh.constraints.surfaces, trial, e, moved))
    return total


@inner_kernel
def energy_error(position, elements, trial, e, k):
    """Return the energy error per volume of a sliver with the wrong gradient.

    The error is half the coefficient times the squared difference between the gradients on both sides of the
    face, 0 on an outer boundary without Dirichlet values.
    """
    across, p = elements.neighbour[e, k], elements.patch[e, k]
    slope, _, _ = gradients(position, elements, trial, e, UNMOVED)
    if across >= 0:
        there, own = gradients(position, elements, trial, across, UNMOVED)[0], elements.region[across]
    elif trial.follows[p]:
        there = slope
        own = elements.region[e]
        slope = point(trial.rate, p)
    else:
        return 0.0
    rate = density_at(trial, own, less_shift(trial, own, there))[1]
    change = minus(slope, there)
    return rate * dot(change, change)


@inner_kernel
def filled_by_split(mesh, trial, e, k, a, b):
    """Return the gain of a new node on the surface half-way along ab.

    The sliver shrinks. In the volume between the old and new faces the wrong gradient is replaced by the right
    gradient, and |S| decreases.
    """
    position, elements, surfaces = mesh.position, mesh.elements, mesh.surfaces
    p = mesh.elements.patch[e, k]
    corners = OPPOSITE[k]
    c = elements.node[e, corners[0]]
    for i in range(1, 3):
        if c in (a, b):
            c = elements.node[e, corners[i]]
    start, end, third = point(position, a), point(position, b), point(position, c)
    top = point(position, elements.node[e, k])
    if elements.neighbour[e, k] >= 0 and not is_outside(surfaces, p, start, end, third, top):
        return 0.0
    middle = onto_patch(surfaces, p, times(0.5, plus(start, end)))
    before = sliver_volume(surfaces, p, start, end, third)
    after = sliver_volume(surfaces, p, start, middle, third) + sliver_volume(surfaces, p, middle, end, third)
    own = sliver(position, elements, surfaces, trial, e, k, UNMOVED)[0]
    return (before - after) * energy_error(position, elements, trial, e, k) + (1.0 - after / before) * 0.5 * own
