"""Work of an applied field on flat faces of iron and magnets, whose nodes slide.

Outside iron the function is the reduced potential phi = u - chi with Hs = -grad chi, and faces do the work mu int Hs .
n phi dS. A node that moves by d changes its offset chi by -(Hs + G d / 2) . d, G = grad Hs. On a face Hs is quadratic,
with values and derivatives at the corners that give the values at the midpoints of edges.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    AT_X,
    AT_Y,
    AT_Z,
    FIELD_X,
    FIELD_Y,
    FIELD_Z,
    FOLLOWS,
    GRADIENT_XX,
    GRADIENT_XY,
    GRADIENT_XZ,
    GRADIENT_YY,
    GRADIENT_YZ,
    GRADIENT_ZZ,
    REDUCED,
    TWELFTH_COEFFICIENT,
)
from kohonen_adapt.kernels.tetrahedron.geometry import OPPOSITE
from kohonen_adapt.kernels.tetrahedron.polish.energy import value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import UNMOVED, position_of


@inner_kernel
def follows_field(trial, v):
    return trial.applied.shape[0] > 0 and trial.applied[v, FOLLOWS] != 0.0


@inner_kernel
def times_gradient(applied, v, x, y, z):
    return (
        applied[v, GRADIENT_XX] * x + applied[v, GRADIENT_XY] * y + applied[v, GRADIENT_XZ] * z,
        applied[v, GRADIENT_XY] * x + applied[v, GRADIENT_YY] * y + applied[v, GRADIENT_YZ] * z,
        applied[v, GRADIENT_XZ] * x + applied[v, GRADIENT_YZ] * y + applied[v, GRADIENT_ZZ] * z,
    )


@inner_kernel
def integral_to(applied, v, x, y, z):
    dx, dy, dz = x - applied[v, AT_X], y - applied[v, AT_Y], z - applied[v, AT_Z]
    gx, gy, gz = times_gradient(applied, v, dx, dy, dz)
    hx, hy, hz = applied[v, FIELD_X] + 0.5 * gx, applied[v, FIELD_Y] + 0.5 * gy, applied[v, FIELD_Z] + 0.5 * gz
    return hx * dx + hy * dy + hz * dz


@inner_kernel
def rise_at(mesh, trial, v, x, y, z):
    # the decrease of the offset of v, if the node moves to (x, y, z)
    if not follows_field(trial, v):
        return 0.0
    px, py, pz = mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2]
    return integral_to(trial.applied, v, x, y, z) - integral_to(trial.applied, v, px, py, pz)


@inner_kernel
def across_face(applied, node, at, normal):
    # the flux of Hs at a node through a face, and its derivatives by the place
    dx, dy, dz = at[0] - applied[node, AT_X], at[1] - applied[node, AT_Y], at[2] - applied[node, AT_Z]
    gx, gy, gz = times_gradient(applied, node, dx, dy, dz)
    hx, hy, hz = applied[node, FIELD_X] + gx, applied[node, FIELD_Y] + gy, applied[node, FIELD_Z] + gz
    slope = times_gradient(applied, node, normal[0], normal[1], normal[2])
    return hx * normal[0] + hy * normal[1] + hz * normal[2], slope


@inner_kernel
def midway(one, other, slope, far_slope, start, end):
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    change = (slope[0] - far_slope[0]) * x + (slope[1] - far_slope[1]) * y + (slope[2] - far_slope[2]) * z
    return 0.5 * (one + other) + 0.125 * change


@inner_kernel
def loads_of_face(mesh, trial, e, k, moved):
    # mu int Hs . n v dS on face k of e, with n out of e, for the functions v of the corners
    node, position, applied = mesh.elements.node, mesh.position, trial.applied
    first, second, third = node[e, OPPOSITE[k, 0]], node[e, OPPOSITE[k, 1]], node[e, OPPOSITE[k, 2]]
    a, b, c = (
        position_of(position, first, moved),
        position_of(position, second, moved),
        position_of(position, third, moved),
    )
    top = position_of(position, node[e, k], moved)
    ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    mu = 12.0 * trial.data[mesh.elements.region[e], TWELFTH_COEFFICIENT]
    half = -0.5 * mu if nx * (top[0] - a[0]) + ny * (top[1] - a[1]) + nz * (top[2] - a[2]) > 0.0 else 0.5 * mu
    normal = half * nx, half * ny, half * nz
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
def work_around(mesh, trial, v, x, y, z, change):
    # The work on faces around v, and the derivative by the value of v. Node v is at (x, y, z), with `change` added to
    # the value outside iron.
    total = by_w = 0.0
    node, moved = mesh.elements.node, (v, x, y, z, 0.0)
    for row in range(mesh.star.start[v], mesh.star.start[v + 1]):
        e = mesh.star.element[row]
        for k in range(4):
            if node[e, k] != v and is_loaded(mesh, trial, e, k):
                region, loads = mesh.elements.region[e], loads_of_face(mesh, trial, e, k, moved)
                for corner in range(3):
                    there = node[e, OPPOSITE[k, corner]]
                    total += loads[corner] * value_at(trial, region, there)
                    if there == v:
                        total, by_w = total + loads[corner] * change, by_w + loads[corner]
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
