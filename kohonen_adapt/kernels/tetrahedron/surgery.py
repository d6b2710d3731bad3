"""Splits and collapses of edges, by `replace` for every change of the mesh."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.search import next_stamp
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_PATCH, ON_RIDGE, PLANE, RIDGE_PATCHES
from kohonen_adapt.kernels.tetrahedron.geometry import (
    OPPOSITE,
    allowed,
    corner_of,
    element_volumes,
    face_of,
    gather_around,
    gather_edge,
    has_constrained_face,
    list_shell,
    rounded,
)
from kohonen_adapt.kernels.tetrahedron.metric import effective_quality, set_mean_shape, squared_length
from kohonen_adapt.kernels.tetrahedron.surfaces import exceeds_sagitta, onto_patch, onto_ridge, ridge_distance
from kohonen_adapt.kernels.vectors import midpoint, put

UNLIMITED = np.inf  # length of edges after a collapse
NOWHERE = -1
EQUAL = 1e-9  # relative tolerance of equal volumes


@inner_kernel
def metric_length(mesh, a, b):
    """Return the squared metric length e'Me (rho_a rho_b)^(1/3).

    M is the mean shape of the ends.
    """
    fineness = mesh.origins.fineness
    return rounded(squared_length(mesh.position, mesh.metric, a, b) * (fineness[a] * fineness[b]))


@inner_kernel
def write_face(mesh, row, e, k, across, patch):
    face, node = mesh.cavity.face, mesh.elements.node
    a, b, c = face_of(node, e, k)
    low, high = min(a, min(b, c)), max(a, max(b, c))
    face[row, 0] = low
    face[row, 1] = a + b + c - low - high
    face[row, 2] = high
    face[row, 3], face[row, 4] = across, k
    mesh.cavity.face_patch[row] = patch


@inner_kernel
def same_face(face, row, other):
    return face[row, 2] == face[other, 2] and face[row, 1] == face[other, 1] and face[row, 0] == face[other, 0]


@inner_kernel
def write_border(mesh, count):
    """List the faces between the elements to remove and the rest of the mesh.

    Each row has the element outside and the corner of that element, or -1. Returned is the number of faces.
    """
    elements, cavity = mesh.elements, mesh.cavity
    stamp = next_stamp(cavity)
    faces = 0
    for i in range(count):
        cavity.element_stamp[cavity.old[i]] = stamp
    for i in range(count):
        e = cavity.old[i]
        for k in range(4):
            across = elements.neighbour[e, k]
            if across >= 0 and cavity.element_stamp[across] == stamp:
                continue
            write_face(mesh, faces, e, k, across, elements.patch[e, k])
            if across >= 0:
                for j in range(4):
                    if elements.neighbour[across, j] == e and faces_match(mesh, faces, across, j):
                        cavity.face[faces, 4] = j
            faces += 1
    return faces


@inner_kernel
def faces_match(mesh, row, e, k):
    face, node = mesh.cavity.face, mesh.elements.node
    for j in range(3):
        v = node[e, OPPOSITE[k, j]]
        if v != face[row, 0] and v != face[row, 1] and v != face[row, 2]:
            return False
    return True


@inner_kernel
def replace(mesh, count_old, count_new):
    """Replace the elements `cavity.old` by the tetrahedra `cavity.new`.

    Faces on the border of the cavity keep their patches, inner faces have `cavity.patch`. The new elements are
    listed in `cavity.made`. Returned is False, with the mesh unchanged, if there are too few free rows.
    """
    elements, cavity, pool = mesh.elements, mesh.cavity, mesh.pool
    if pool.height[1] + count_old < count_new:
        return False
    border = write_border(mesh, count_old)
    for i in range(count_old):
        elements.node[cavity.old[i], 0] = -1
        pool.free_elements[pool.height[1]] = cavity.old[i]
        pool.height[1] += 1
    for i in range(count_new):
        pool.height[1] -= 1
        e = pool.free_elements[pool.height[1]]
        cavity.made[i], elements.region[e] = e, cavity.region[i]
        for k in range(4):
            elements.node[e, k] = cavity.new[i, k]
            elements.neighbour[e, k] = -1
            elements.patch[e, k] = cavity.patch[i, k]
            pool.anchor[cavity.new[i, k]] = e
    faces = border
    for i in range(count_new):
        for k in range(4):
            faces = join_face(mesh, cavity.made[i], k, border, faces)
    return True


@inner_kernel
def join_face(mesh, e, k, border, faces):
    elements, cavity = mesh.elements, mesh.cavity
    write_face(mesh, faces, e, k, e, elements.patch[e, k])
    for row in range(faces):
        if same_face(cavity.face, row, faces):
            across, j = cavity.face[row, 3], cavity.face[row, 4]
            elements.neighbour[e, k] = across
            if across >= 0:
                elements.neighbour[across, j] = e
            if row < border:
                elements.patch[e, k] = cavity.face_patch[row]
            return faces
    return faces + 1


@inner_kernel
def patches_at(mesh, shell, count, a, b):
    """List the patches at edge ab in `cavity.meeting`, ascending, then -1.

    Returned are the numbers of constrained faces and of patches. `shell` holds the `count` elements of the edge.
    """
    elements, meeting = mesh.elements, mesh.cavity.meeting
    faces = patches = 0
    for i in range(meeting.shape[0]):
        meeting[i] = -1
    for i in range(count):
        e = shell[i]
        for k in range(4):
            v, patch = elements.node[e, k], elements.patch[e, k]
            if v in (a, b) or patch < 0 or 0 <= elements.neighbour[e, k] < e:  # inner faces once
                continue
            faces += 1
            at = 0
            while at < patches and meeting[at] < patch:
                at += 1
            if at < patches and meeting[at] == patch:
                continue
            if patches <= RIDGE_PATCHES:
                for j in range(patches, at, -1):
                    meeting[j] = meeting[j - 1]
                meeting[at] = patch
                patches += 1
    return faces, patches


@inner_kernel
def is_ridge(mesh, r):
    for i in range(RIDGE_PATCHES):
        if mesh.surfaces.meets[r, i] != mesh.cavity.meeting[i]:
            return False
    return True


@inner_kernel
def ridge_of(mesh, x):
    found, least = NOWHERE, np.inf
    for r in range(mesh.surfaces.meets.shape[0]):
        if is_ridge(mesh, r):
            distance = ridge_distance(mesh.surfaces, r, x)
            if distance < least:
                found, least = r, distance
    return found


@inner_kernel
def place_of_edge(mesh, shell, count, a, b):
    faces, patches = patches_at(mesh, shell, count, a, b)
    if faces == 0:
        return INSIDE, NOWHERE
    p = mesh.cavity.meeting[0]
    if faces == 2 and patches == 1:
        return ON_PATCH, p
    if patches > RIDGE_PATCHES:
        return HELD, NOWHERE
    r = ridge_of(mesh, midpoint(mesh.position, a, b))
    return (ON_RIDGE, r) if r >= 0 else (HELD, NOWHERE)


@inner_kernel
def put_between(mesh, p, a, b, number, place):
    x = midpoint(mesh.position, a, b)
    if number == ON_PATCH and mesh.surfaces.shape[place] != PLANE:
        x = onto_patch(mesh.surfaces, place, x)
    if number == ON_RIDGE:
        x = onto_ridge(mesh.surfaces, place, x)
    put(mesh.position, p, x)


@inner_kernel
def prepare_split(mesh, a, b, floor):
    """Write the elements of a split of ab to `cavity`, and return their old count.

    Returned is 0 if the split is not allowed. The new node is the first free row.
    """
    elements, cavity, pool, freedom = mesh.elements, mesh.cavity, mesh.pool, mesh.freedom
    count = gather_edge(mesh, a, b, cavity.old)
    if count <= 0 or pool.height[0] == 0 or (freedom.pinned[a] and freedom.pinned[b]):
        return 0
    if mesh.origins.non_manifold[a] or mesh.origins.non_manifold[b]:
        return 0
    number, place = place_of_edge(mesh, cavity.old, count, a, b)
    if number == HELD:
        return 0
    p = pool.free_nodes[pool.height[0] - 1]
    put_between(mesh, p, a, b, number, place)
    set_mean_shape(mesh.metric, p, a, b)
    freedom.number[p], freedom.place[p] = number, place
    before, after, new = 2.0, 2.0, 0
    for i in range(count):
        e = cavity.old[i]
        before = min(before, effective_quality(mesh.position, mesh.metric, elements.node, e))
        for end, other in ((a, b), (b, a)):
            for k in range(4):
                v = elements.node[e, k]
                cavity.new[new, k] = p if v == end else v
                cavity.patch[new, k] = -1 if v == other else elements.patch[e, k]
            cavity.region[new] = elements.region[e]
            after = min(after, effective_quality(mesh.position, mesh.metric, cavity.new, new))
            new += 1
    return count if allowed(after, before, floor) else 0


@inner_kernel
def split(mesh, a, b, count):
    pool, origins = mesh.pool, mesh.origins
    pool.height[0] -= 1
    p = pool.free_nodes[pool.height[0]]
    replace(mesh, count, 2 * count)
    origins.fineness[p] = np.sqrt(origins.fineness[a] * origins.fineness[b])
    origins.old[p], origins.start_element[p] = -1, origins.start_element[a]
    mesh.freedom.pinned[p] = origins.non_manifold[p] = False
    return p


@inner_kernel
def merge_allowed(mesh, v, w, count):
    """Return True if v may merge into w along a permitted edge.

    Free nodes may merge into any neighbour, others along their own patch or ridge only. The `count` elements of
    the edge must be in `cavity.around_other`.
    """
    freedom, origins = mesh.freedom, mesh.origins
    number = freedom.number[v]
    if number == HELD or freedom.pinned[v] or origins.non_manifold[v] or origins.non_manifold[w]:
        return False
    faces, patches = patches_at(mesh, mesh.cavity.around_other, count, v, w)
    if number == INSIDE:
        return faces == 0
    if number == ON_PATCH:
        return faces == 2 and patches == 1 and mesh.cavity.meeting[0] == freedom.place[v]
    return not (faces == 2 and patches == 1) and patches <= RIDGE_PATCHES and is_ridge(mesh, freedom.place[v])


@inner_kernel
def prepare_collapse(mesh, v, w, floor, longest):
    """Write the elements of a merge of v into w to `cavity`.

    Returned are the worst cubed quality, 0 if the merge is not allowed, and the numbers of old and new elements.
    No new edge may be as long in the metric as `longest`. The link condition must hold: all common neighbours of
    v and w are nodes of the elements at their edge, and no two constrained faces coincide. Otherwise the mesh
    would be non-manifold, or a slit would close.
    """
    elements, cavity, position = mesh.elements, mesh.cavity, mesh.position
    count = gather_around(mesh, v, cavity.old)
    shell = list_shell(mesh, cavity.old, count, w, cavity.around_other)
    if shell == 0 or not merge_allowed(mesh, v, w, shell):
        return 0.0, 0, 0
    before, volume, planar = 2.0, 0.0, True
    for i in range(count):
        e = cavity.old[i]
        before = min(before, effective_quality(position, mesh.metric, elements.node, e))
        volume += element_volumes(position, elements.node, e)
        for j in range(4):
            patch = elements.patch[e, j]
            if patch >= 0 and elements.node[e, j] != v and mesh.surfaces.shape[patch] != PLANE:
                planar = False
    new, after, volume_after = 0, 2.0, 0.0
    for i in range(count):
        e = cavity.old[i]
        k, kw = corner_of(elements.node, e, v), corner_of(elements.node, e, w)
        if kw >= 0:
            if elements.patch[e, kw] >= 0:
                return 0.0, 0, 0
            continue
        for j in range(4):
            cavity.new[new, j], cavity.patch[new, j] = elements.node[e, j], elements.patch[e, j]
        cavity.new[new, k], cavity.region[new] = w, elements.region[e]
        after = min(after, effective_quality(position, mesh.metric, cavity.new, new))
        if not allowed(after, before, floor):
            return 0.0, 0, 0
        volume_after += element_volumes(position, cavity.new, new)
        for j in range(4):
            if j != k and (metric_length(mesh, w, cavity.new[new, j]) >= longest or exceeds_on_face(mesh, new, j, w)):
                return 0.0, 0, 0
        new += 1
    if new == 0 or (planar and abs(volume_after - volume) > EQUAL * volume):
        return 0.0, 0, 0
    if shared_neighbours(mesh, v, w, count) != shell_nodes(mesh, v, w, shell) or closes_slit(mesh, w, new):
        return 0.0, 0, 0
    return after, count, new


@inner_kernel
def closes_slit(mesh, w, new):
    node, patch = mesh.cavity.new, mesh.cavity.patch
    for i in range(new):
        k = corner_of(node, i, w)
        for j in range(4):
            if j != k and patch[i, j] >= 0 and has_constrained_face(mesh, *face_of(node, i, j)):
                return True
    return False


@inner_kernel
def exceeds_on_face(mesh, new, j, w):
    p = mesh.cavity.patch[new, j]
    if p < 0 or mesh.surfaces.shape[p] == PLANE:
        return False
    for i in range(4):
        v = mesh.cavity.new[new, i]
        if i != j and v != w and exceeds_sagitta(mesh, p, w, v):
            return True
    return False


@inner_kernel
def shell_nodes(mesh, v, w, count):
    node, cavity = mesh.elements.node, mesh.cavity
    found = 0
    stamp = next_stamp(cavity)
    for i in range(count):
        for k in range(4):
            a = node[cavity.around_other[i], k]
            if a != v and a != w and cavity.node_stamp[a] != stamp:
                cavity.node_stamp[a] = stamp
                found += 1
    return found


@inner_kernel
def shared_neighbours(mesh, v, w, count):
    node, cavity = mesh.elements.node, mesh.cavity
    found = 0
    around = gather_around(mesh, w, cavity.around)
    cavity.counter[0] += 2
    mark = cavity.counter[0]
    for i in range(count):
        for k in range(4):
            cavity.node_stamp[node[cavity.old[i], k]] = mark
    cavity.node_stamp[v] = cavity.node_stamp[w] = 0
    for i in range(around):
        for k in range(4):
            a = node[cavity.around[i], k]
            if cavity.node_stamp[a] == mark:
                cavity.node_stamp[a] = mark - 1
                found += 1
    return found


@inner_kernel
def collapse(mesh, v, count, new):
    replace(mesh, count, new)  # always succeeds, because elements are removed
    mesh.pool.anchor[v] = -1
    mesh.pool.free_nodes[mesh.pool.height[0]] = v
    mesh.pool.height[0] += 1
