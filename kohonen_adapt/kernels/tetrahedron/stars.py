"""Quality guard of moved nodes, and partition of nodes."""

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, star_quality

ACROSS, UNUSED = -1, -2  # parts of elements with mixed nodes, and of unused rows


@inner_kernel
def star_tolerable(position, star, v, x, y, z, floor):
    """Return True if no element of the star is below `floor` with v at (x, y, z).

    Equivalent to `star_quality` without a division. UNGUARDED disables the check.
    """
    if floor == UNGUARDED:
        return True
    bound = max(floor * floor * floor, FLAT) / 432.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b, c = star.link[k, 0], star.link[k, 1], star.link[k, 2]
        ax, ay, az = position[a, 0] - x, position[a, 1] - y, position[a, 2] - z
        bx, by, bz = position[b, 0] - x, position[b, 1] - y, position[b, 2] - z
        cx, cy, cz = position[c, 0] - x, position[c, 1] - y, position[c, 2] - z
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        lengths = ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz + cx * cx + cy * cy + cz * cz
        mixed = ax * bx + ay * by + az * bz + bx * cx + by * cy + bz * cz + cx * ax + cy * ay + cz * az
        squares = 3.0 * lengths - 2.0 * mixed
        if not (volume > 0.0 and volume * volume > bound * squares * squares * squares):
            return False
    return True


@inner_kernel
def may_move(position, star, v, x, y, z, floor):
    if star_tolerable(position, star, v, x, y, z, floor):
        return True
    if star_tolerable(position, star, v, position[v, 0], position[v, 1], position[v, 2], floor):
        return False
    before = star_quality(position, star, v, position[v, 0], position[v, 1], position[v, 2], -2.0)
    after = star_quality(position, star, v, x, y, z, before)
    return after > FLAT and after >= before


@kernel
def mark_valid(position, star, floor, first, last, is_valid):
    """Mark nodes `first` to `last` whose stars are tolerable.

    If all stars are tolerable, guarded moves keep them tolerable. Otherwise a neighbour may worsen a marked star
    as far as its own rule allows, and the guard is stricter than the rule up to the next marking.
    """
    for v in range(first, last):
        is_valid[v] = star_tolerable(position, star, v, position[v, 0], position[v, 1], position[v, 2], floor)


@kernel
def mark_interior(star, part, rings, interior, queue):
    """Mark the nodes that have only nodes of their own part within `rings` rings.

    `part` (n,) is the index of the part, `queue` (n,) scratch.
    """
    last = 0
    for v in range(part.shape[0]):
        interior[v] = True
        for k in range(star.start[v], star.start[v + 1]):
            for j in range(3):
                if part[star.link[k, j]] != part[v]:
                    interior[v] = False
        if not interior[v]:
            queue[last] = v
            last += 1
    first = 0
    for _ in range(rings - 1):
        end = last
        for i in range(first, last):
            v = queue[i]
            for k in range(star.start[v], star.start[v + 1]):
                for j in range(3):
                    other = star.link[k, j]
                    if interior[other]:
                        interior[other] = False
                        queue[end] = other
                        end += 1
        first, last = last, end


@kernel
def find_parts(node, part, of_element):
    for e in range(node.shape[0]):
        own = UNUSED if node[e, 0] < 0 else part[node[e, 0]]
        for k in range(1, 4):
            if own >= 0 and part[node[e, k]] != own:
                own = ACROSS
        of_element[e] = own
