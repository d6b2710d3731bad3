"""Work of an applied field on flat faces of iron and magnets, whose nodes slide.

Outside iron the function is the reduced potential phi = u - chi with Hs = -grad chi, and faces do the work mu int Hs .
n phi dS. A node that moves by d changes its offset chi by -(Hs + G d / 2) . d, G = grad Hs. On a face Hs is quadratic,
with values and derivatives at the corners that give the values at the midpoints of edges.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.arrays import (
    AT_X,
    FIELD_X,
    FOLLOWS,
    GRADIENT_XX,
    REDUCED,
    TWELFTH_COEFFICIENT,
)
from kohonen_adapt.kernels.tetrahedron.geometry import OPPOSITE, face_of
from kohonen_adapt.kernels.tetrahedron.polish.energy import value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import UNMOVED, face_corners, position_of
from kohonen_adapt.kernels.vectors import cross, dot, matrix, minus, plus, plus_times, point, product, times


@inner_kernel
def follows_field(trial, v):
    return trial.applied.shape[0] > 0 and trial.applied[v, FOLLOWS] != 0.0


@inner_kernel
def field_change(applied, v, step):
    return product(matrix(applied[:, GRADIENT_XX:], v), step)


@inner_kernel
def integral_to(applied, v, x):
    step = minus(x, point(applied[:, AT_X:], v))
    return dot(plus_times(point(applied[:, FIELD_X:], v), 0.5, field_change(applied, v, step)), step)


@inner_kernel
def rise_at(mesh, trial, v, x):
    # the decrease of the offset of v, if the node moves to x
    if not follows_field(trial, v):
        return 0.0
    return integral_to(trial.applied, v, x) - integral_to(trial.applied, v, point(mesh.position, v))


@inner_kernel
def across_face(applied, node, x, normal):
    # the flux of Hs at a node through a face, and its derivatives by the place
    change = field_change(applied, node, minus(x, point(applied[:, AT_X:], node)))
    return dot(plus(point(applied[:, FIELD_X:], node), change), normal), field_change(applied, node, normal)


@inner_kernel
def midway(one, other, slope, far_slope, start, end):
    return 0.5 * (one + other) + 0.125 * dot(minus(slope, far_slope), minus(end, start))


@inner_kernel
def loads_of_face(mesh, trial, e, k, moved):
    # mu int Hs . n v dS on face k of e, with n out of e, for the functions v of the corners
    node, applied = mesh.elements.node, trial.applied
    first, second, third = face_of(node, e, k)
    a, b, c = face_corners(mesh.position, node, e, k, moved)
    normal = cross(minus(b, a), minus(c, a))
    mu = 12.0 * trial.data[mesh.elements.region[e], TWELFTH_COEFFICIENT]
    inwards = dot(normal, minus(position_of(mesh.position, node[e, k], moved), a)) > 0.0
    normal = times(-0.5 * mu if inwards else 0.5 * mu, normal)
    at_a, slope_a = across_face(applied, first, a, normal)
    at_b, slope_b = across_face(applied, second, b, normal)
    at_c, slope_c = across_face(applied, third, c, normal)
    ab, bc = midway(at_a, at_b, slope_a, slope_b, a, b), midway(at_b, at_c, slope_b, slope_c, b, c)
    ca = midway(at_c, at_a, slope_c, slope_a, c, a)
    whole, corners = (ab + bc + ca) / 7.5, (at_a + at_b + at_c) / 60.0
    return (
        0.05 * at_a - corners + whole - bc / 15.0,
        0.05 * at_b - corners + whole - ca / 15.0,
        0.05 * at_c - corners + whole - ab / 15.0,
    )


@inner_kernel
def is_loaded(mesh, trial, e, k):
    p = mesh.elements.patch[e, k]
    return p >= 0 and trial.loaded[p] and trial.data[mesh.elements.region[e], REDUCED] != 0.0


@inner_kernel
def work_around(mesh, trial, v, x, change):
    # The work on faces around v, and the derivative by the value of v. Node v is at x, with `change` added to the value
    # outside iron.
    total = by_w = 0.0
    node, moved = mesh.elements.node, (v, x, 0.0)
    for row in rows_of(mesh.star, v):
        e = mesh.star.element[row]
        for k in range(4):
            if node[e, k] != v and is_loaded(mesh, trial, e, k):
                region, loads = mesh.elements.region[e], loads_of_face(mesh, trial, e, k, moved)
                for corner in range(3):
                    there = node[e, OPPOSITE[k, corner]]
                    total += loads[corner] * value_at(trial, region, there)
                    if there == v:
                        total += loads[corner] * change
                        by_w += loads[corner]
    return total, by_w


@kernel
def add_loads(mesh, trial, load):
    node = mesh.elements.node
    for e in range(node.shape[0]):
        if node[e, 0] >= 0:
            for k in range(4):
                if is_loaded(mesh, trial, e, k):
                    loads = loads_of_face(mesh, trial, e, k, UNMOVED)
                    for corner in range(3):
                        load[node[e, OPPOSITE[k, corner]]] += loads[corner]
