"""Exchange of corners of the geometry between nodes.

A node leaves its corner along a ridge, and its neighbour on another ridge moves into the corner (Lowther and
Mai, "On Automatic Mesh Generation using Kohonen Maps", Fig. 3, with patches and ridges instead of boundary
lines).
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, ON_RIDGE, RIDGE_PATCHES
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, face_of
from kohonen_adapt.kernels.tetrahedron.guard import effective_around, star_tolerable
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_ridge, within_reach
from kohonen_adapt.kernels.vectors import between, cross, dot, midpoint, minus, plus_times, point, put

CORNER_RIDGES = 3  # maximum number of ridges at a corner that nodes may leave


@inner_kernel
def jump(mesh, v, x, step, floor, scratch):
    """Move v from a corner onto its nearest ridge, and a neighbour into the corner.

    The neighbour is on a second ridge. At a corner of three ridges, one face may lie between the ridge of the
    neighbour and the third ridge. The face is assigned to the patch between the third ridge and the nearest
    ridge, and the edge from the neighbour to the next node of the third ridge is then the end of the third ridge.
    """
    position, constraints, ends = mesh.position, mesh.constraints, scratch.crossed
    count = ridges_at_corner(mesh, v, ends)
    if count < 2 or count > CORNER_RIDGES:
        return
    nearest = nearest_ridge(position, constraints.surfaces, ends, count, v, x)
    if nearest < 0:
        return
    onto = ends[nearest, 1]
    corner = point(position, v)
    y = onto_ridge(constraints.surfaces, onto, plus_times(corner, step, minus(x, corner)))
    if not np.isfinite(y[0] + y[1] + y[2]):
        return
    for i in range(count):
        f, away = ends[i, 0], ends[i, 1]
        if away == onto or constraints.freedom.number[f] != ON_RIDGE or constraints.freedom.place[f] != away:
            continue
        third = ends[CORNER_RIDGES - i - nearest, 0] if count == CORNER_RIDGES else -1
        patch = patch_to_take(mesh, v, f, third, ends[nearest, 0], onto)
        if patch == -2:
            continue
        if exchange_positions(mesh, v, f, y, floor):
            if third >= 0:
                relabel_face(mesh, v, f, third, patch)
            constraints.freedom.number[f], constraints.freedom.place[f] = HELD, -1
            constraints.freedom.number[v], constraints.freedom.place[v] = ON_RIDGE, onto
            return


@inner_kernel
def ridges_at_corner(mesh, v, ends):
    """List the next node and the index of every ridge at v, and return the count.

    Returned is AT_CORNER + 1 if there are more ridges, or an unknown ridge.
    """
    elements, star = mesh.elements, mesh.star
    count = 0
    for k in rows_of(star, v):
        e = star.element[k]
        for j in range(3):
            w, known = star.link[k, j], False
            for i in range(count):
                if ends[i, 0] == w:
                    known = True
            if known or not on_patch_of(elements, e, v, w):
                continue
            r = ridge_of_edge(mesh, v, w)
            if r == -2:  # edge of an unknown ridge
                return CORNER_RIDGES + 1
            if r >= 0:
                if count == CORNER_RIDGES:
                    return CORNER_RIDGES + 1
                ends[count, 0], ends[count, 1] = w, r
                count += 1
    return count


@inner_kernel
def touches(star, row, w):
    return star.link[row, 0] == w or star.link[row, 1] == w or star.link[row, 2] == w


@inner_kernel
def on_patch_of(elements, e, v, w):
    for k in range(4):
        if elements.patch[e, k] >= 0 and elements.node[e, k] != v and elements.node[e, k] != w:
            return True
    return False


@inner_kernel
def patch_at_edge(elements, star, k, j, v, w):
    """Return the patch of face j in row k of the star, -1 without edge vw."""
    e = star.element[k]
    if not touches(star, k, w) or elements.node[e, j] == v or elements.node[e, j] == w:
        return -1
    return elements.patch[e, j]


@inner_kernel
def ridge_of_edge(mesh, v, w):
    """Return the ridge of edge vw, -1 if inside a patch, -2 if unknown."""
    elements, star, freedom = mesh.elements, mesh.star, mesh.constraints.freedom
    only = -1
    sides, same = 0, True
    for k in rows_of(star, v):
        for j in range(4):
            p = patch_at_edge(elements, star, k, j, v, w)
            if p < 0:
                continue
            if only >= 0 and only != p:
                same = False
            only = p
            sides += 2 if elements.neighbour[star.element[k], j] < 0 else 1  # outer faces: both sides in one element
    if same and sides == 4:
        return -1
    if freedom.number[w] == ON_RIDGE:
        return freedom.place[w]
    return ridge_between(mesh, v, w)


@inner_kernel
def ridge_between(mesh, v, w):
    surfaces, x = mesh.constraints.surfaces, midpoint(mesh.position, v, w)
    found, least = -2, np.inf
    for r in range(surfaces.meets.shape[0]):
        if fits_edge(mesh, r, v, w):
            offset = minus(onto_ridge(surfaces, r, x), x)
            distance = dot(offset, offset)
            if distance < least:
                found, least = r, distance
    return found


@inner_kernel
def fits_edge(mesh, r, v, w):
    elements, star, meets = mesh.elements, mesh.star, mesh.constraints.surfaces.meets
    for i in range(RIDGE_PATCHES):
        if meets[r, i] >= 0 and not has_face(elements, star, v, w, meets[r, i]):
            return False
    for k in rows_of(star, v):
        for j in range(4):
            p = patch_at_edge(elements, star, k, j, v, w)
            if p >= 0 and not meets_patch(meets, r, p):
                return False
    return True


@inner_kernel
def meets_patch(meets, r, p):
    for i in range(RIDGE_PATCHES):
        if meets[r, i] == p:
            return True
    return False


@inner_kernel
def has_face(elements, star, v, w, p):
    for k in rows_of(star, v):
        for j in range(4):
            if patch_at_edge(elements, star, k, j, v, w) == p:
                return True
    return False


@inner_kernel
def nearest_ridge(position, surfaces, ends, count, v, x):
    nearest = -1
    corner = point(position, v)
    offset = minus(x, corner)
    best = dot(offset, offset)
    for i in range(count):
        w, r = ends[i, 0], ends[i, 1]
        foot = onto_ridge(surfaces, r, x)
        offset = minus(x, foot)
        distance = dot(offset, offset)
        if dot(minus(foot, corner), between(position, v, w)) > 0.0 and distance < best:
            nearest, best = i, distance
    return nearest


@inner_kernel
def patch_to_take(mesh, v, f, third, ahead, onto):
    """Return the new patch of face (v, f, other) after v leaves its corner.

    Node v leaves along ridge `onto` towards the next node `ahead`. Returned is -1 if no face changes its patch,
    and -2 if the move is not possible, because another face at v is not on patches of `onto`, or because the face
    would be between different regions.
    """
    elements, star, meets = mesh.elements, mesh.star, mesh.constraints.surfaces.meets
    found = -1
    for k in rows_of(star, v):
        e = star.element[k]
        for j in range(4):
            p = elements.patch[e, j]
            if p < 0 or elements.node[e, j] == v or meets_patch(meets, onto, p):
                continue
            if third < 0 or not is_face(elements, e, j, v, f, third):
                return -2
            found = patch_beside(mesh, e, j, v, f, third, ahead, onto)
            if found < 0:
                return -2
    return found if found >= 0 or third < 0 else -2


@inner_kernel
def is_face(elements, e, j, v, f, third):
    for i in range(4):
        w = elements.node[e, i]
        if i != j and w != v and w != f and w != third:
            return False
    return True


@inner_kernel
def patch_beside(mesh, e, j, v, f, third, ahead, onto):
    """Return a patch of ridge `onto` that fits face j of e, or -1.

    The patch has a face at the edge from v to `third`, between the same regions and with the same orientation. At
    a body that touches itself, coplanar patches may have opposite orientations.
    """
    elements, star, meets = mesh.elements, mesh.star, mesh.constraints.surfaces.meets
    for k in rows_of(star, v):
        g = star.element[k]
        for i in range(4):
            p = patch_at_edge(elements, star, k, i, v, third)
            if p < 0 or not meets_patch(meets, onto, p):
                continue
            if (
                elements.region[g] == elements.region[e]
                and region_across(elements, g, i) == region_across(elements, e, j)
                and same_orientation(mesh.position, elements.node, e, j, g, i, v, f, ahead)
            ):
                return p
    return -1


@inner_kernel
def same_orientation(position, node, e, j, g, i, v, f, ahead):
    a, b, c = face_of(node, e, j)
    a, b, c = successor(a, v, f, ahead), successor(b, v, f, ahead), successor(c, v, f, ahead)
    normal = face_normal(position, a, b, c)
    other = face_normal(position, *face_of(node, g, i))
    return dot(normal, other) > 0.0


@inner_kernel
def successor(node, v, f, ahead):
    return ahead if node == v else v if node == f else node


@inner_kernel
def face_normal(position, a, b, c):
    return cross(between(position, a, b), between(position, a, c))


@inner_kernel
def region_across(elements, e, j):
    across = elements.neighbour[e, j]
    return elements.region[across] if across >= 0 else -1


@inner_kernel
def relabel_face(mesh, v, f, third, patch):
    elements, star = mesh.elements, mesh.star
    for k in rows_of(star, v):
        e = star.element[k]
        for j in range(4):
            if elements.patch[e, j] >= 0 and is_face(elements, e, j, v, f, third):
                elements.patch[e, j] = patch


@inner_kernel
def exchange_positions(mesh, v, f, x, floor):
    position, elements, star = mesh.position, mesh.elements, mesh.star
    surfaces, metric = mesh.constraints.surfaces, mesh.constraints.metric
    corner, old = point(position, v), point(position, f)
    if not within_reach(position, elements, star, surfaces, f, corner):
        return False
    before = worst_of_two(position, star, metric, v, f)
    put(position, v, x)
    put(position, f, corner)
    both = star_tolerable(position, star, metric, v, x, floor)
    both = both and star_tolerable(position, star, metric, f, corner, floor)
    if not both:
        after = worst_of_two(position, star, metric, v, f)
        both = after > FLAT and after >= before
    if not both:
        put(position, v, corner)
        put(position, f, old)
    return both


@inner_kernel
def worst_of_two(position, star, metric, v, w):
    return min(
        effective_around(position, star, metric, v, point(position, v), -2.0),
        effective_around(position, star, metric, w, point(position, w), -2.0),
    )
