"""Recycling by energy on tetrahedra, with splits and collapses in pairs.

As in `kernels/triangle/polish/exchange.py`, the gain of a split is the decrease of the functional at the best
value of the new node, and the cost of a collapse is the increase of the functional around the node, with all
other values fixed. On tetrahedra every pair is evaluated again before the exchange, because almost every
exchange changes the gains of other pairs.
"""

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, MOST, TWELFTH_COEFFICIENT
from kohonen_adapt.kernels.tetrahedron.geometry import (
    EDGES,
    FLAT,
    OPPOSITE,
    allowed,
    corner_of,
    cubed_quality,
    cubed_quality_at,
    element_quality,
    face_of,
    gather_around,
)
from kohonen_adapt.kernels.tetrahedron.polish.energy import (
    ROUNDING,
    element_energy,
    shifted,
    sixth_flux,
    source_along,
    source_around,
    value_at,
)
from kohonen_adapt.kernels.tetrahedron.polish.slivers import UNMOVED, filled_by_split, sliver, slivers_of
from kohonen_adapt.kernels.tetrahedron.recycle import holds_edge
from kohonen_adapt.kernels.tetrahedron.surgery import (
    NOWHERE,
    UNLIMITED,
    collapse,
    prepare_collapse,
    prepare_split,
    split,
)
from kohonen_adapt.kernels.tetrahedron.swap import energy_of
from kohonen_adapt.kernels.tetrahedron.waiting import enter_made
from kohonen_adapt.kernels.vectors import between, cofactors, combined, dot, midpoint, minus, plus, point

SHRUNK = 0.8  # smallest gain of a split, relative to its first evaluation
DRIFT, AT = 0, 1  # columns of `state`: unknowns added so far, and position in the list of collapses


@inner_kernel
def offer_is_left(offers, nodes, state, margin, gain):
    # Return True if a collapse costs less than the largest gain that is left, by the factor `margin`.
    while state[AT] < len(nodes) and not offers.removable[nodes[state[AT]]]:
        state[AT] += 1
    return state[AT] < len(nodes) and margin * offers.cost[nodes[state[AT]]] < gain


@inner_kernel
def set_new(trial, offers, p, a, b, value, given):
    trial.value[p], trial.fixed[p], offers.is_new[p] = value, given, True
    for region in range(trial.source.shape[1] if trial.source.shape[0] > 0 else 0):
        trial.source[p, region] = source_along(trial, region, a, b)


@inner_kernel
def halves_parabola(position, trial, region, a, b, c, d, w):
    """Return the functional of an element with edge ab split at its midpoint.

    The value at the midpoint is the mean in the region plus w. With the gradient G and the gradients S_i / D of the
    shape functions, the half at a has the gradient G + 2 w S_b / D, and the half at b has G + 2 w S_a / D. Returned
    are (sum of magnitudes, value, first and second derivative by w).
    """
    at_a, at_b = value_at(trial, region, a), value_at(trial, region, b)
    at_c, at_d = value_at(trial, region, c), value_at(trial, region, d)
    x, y, z = between(position, a, b), between(position, a, c), between(position, a, d)
    p, q, r = cofactors(x, y, z)
    six, n = dot(x, p), combined(at_b - at_a, p, at_c - at_a, q, at_d - at_a, r)
    o = plus(plus(p, q), r)  # o = -S_a, p = S_b
    step, m = 2.0 * w, shifted(trial, region, six, n)
    square, on_p, on_o = dot(m, m), dot(m, p), dot(m, o)
    p_p, o_o = dot(p, p), dot(o, o)
    one = square + step * (2.0 * on_p + step * p_p)
    one, by_one, by_ww_one = half_energy(trial, region, six, one, on_p + step * p_p, p_p)
    two = square - step * (2.0 * on_o - step * o_o)
    two, by_two, by_ww_two = half_energy(trial, region, six, two, step * o_o - on_o, o_o)
    pull, flux = source_along(trial, region, a, b) * six, sixth_flux(trial, region)
    lift = dot(flux, minus(p, o))
    push, down = dot(flux, n) + w * lift, pull * (at_a + at_b + at_c + at_d + w)
    energy = one + two
    return energy + abs(down) + abs(push), energy - down - push, by_one + by_two - pull - lift, by_ww_one + by_ww_two


@inner_kernel
def half_energy(trial, region, six, square, along, across):
    """Return the stored energy of half an element, and two derivatives by a value.

    The gradient is n / D, and the shape function of the value has the gradient 2 s / D. Arguments are |n|^2, n .
    s and |s|^2.
    """
    law = trial.laws.number[region]
    if law < 0:
        twelfth = trial.data[region, TWELFTH_COEFFICIENT]
        return 0.5 * twelfth * square / six, 2.0 * twelfth * along / six, 4.0 * twelfth * across / six
    density, rate, curve = energy_density(trial.laws, law, square / (six * six))
    by_ww = (4.0 * curve * along * along / (six * six) + 2.0 * rate * across) / (3.0 * six)
    return six * density / 12.0, rate * along / (3.0 * six), by_ww


@inner_kernel
def split_parabola(mesh, trial, shell, count, a, b, w):
    magnitude = total = slope = stiffness = 0.0
    nonlinear, node = False, mesh.elements.node
    for i in range(count):
        e = np.int64(shell[i])
        region = mesh.elements.region[e]
        k, j = corner_of(node, e, a), corner_of(node, e, b)
        c, d = other_corners(node, e, k, j)
        more, value, by_w, by_ww = halves_parabola(mesh.position, trial, region, a, b, c, d, w)
        magnitude, total, slope, stiffness = magnitude + more, total + value, slope + by_w, stiffness + by_ww
        nonlinear = nonlinear or trial.laws.number[region] >= 0
    return magnitude, total, slope, stiffness, nonlinear


@inner_kernel
def other_corners(node, e, k, j):
    for i in range(3):
        if OPPOSITE[k, i] == j:
            return np.int64(node[e, OPPOSITE[k, (i + 1) % 3]]), np.int64(node[e, OPPOSITE[k, (i + 2) % 3]])
    return NOWHERE, NOWHERE


@inner_kernel
def gain_of_split(mesh, trial, shell, count, a, b):
    """Return the gain of a split at the midpoint of ab, and the value of the node.

    The gain is 0 if below rounding errors. For nonlinear material the value is that of one Newton step.
    """
    magnitude, before, slope, stiffness, nonlinear = split_parabola(mesh, trial, shell, count, a, b, 0.0)
    gain, w = 0.5 * slope * slope / stiffness, -slope / stiffness
    if nonlinear:
        gain = before - split_parabola(mesh, trial, shell, count, a, b, w)[1]
    gain += filled_slivers(mesh, trial, shell, count, a, b)
    region = mesh.elements.region[np.int64(shell[0])]  # the edge is not on a surface with offsets, which holds edges
    middle = 0.5 * (value_at(trial, region, a) + value_at(trial, region, b))
    return gain if gain > ROUNDING * magnitude else 0.0, middle + w


@inner_kernel
def filled_slivers(mesh, trial, shell, count, a, b):
    gain, elements = 0.0, mesh.elements
    for i in range(count):
        e = np.int64(shell[i])
        for k in range(4):
            p = elements.patch[e, k]
            if p >= 0 and trial.counted[p] and elements.node[e, k] not in (a, b):
                gain += filled_by_split(mesh, trial, e, k, a, b)
    return gain


@inner_kernel
def list_neighbours(mesh, v, count):
    """List the neighbours of v in `cavity.made`, and return their count.

    The elements around v must be in `cavity.old`.
    """
    node, cavity = mesh.elements.node, mesh.cavity
    found = 0
    cavity.counter[0] += 1
    cavity.node_stamp[v] = cavity.counter[0]
    for i in range(count):
        for k in range(4):
            w = node[cavity.old[i], k]
            if cavity.node_stamp[w] != cavity.counter[0]:
                cavity.node_stamp[w] = cavity.counter[0]
                cavity.made[found] = w
                found += 1
    return found


@inner_kernel
def list_shell(mesh, count, w):
    found = 0
    for i in range(count):
        if corner_of(mesh.elements.node, mesh.cavity.old[i], w) >= 0:
            mesh.cavity.around_other[found] = mesh.cavity.old[i]
            found += 1
    return found


@inner_kernel
def is_open(mesh, offers, count, a, b):
    for i in range(count):
        e = np.int64(mesh.cavity.around_other[i])
        for k in range(4):
            p = mesh.elements.patch[e, k]
            if p >= 0 and not offers.open[p] and mesh.elements.node[e, k] not in (a, b):
                return False
    return True


@inner_kernel
def halves_allowed(mesh, count, a, b, floor):
    position, node = mesh.position, mesh.elements.node
    x = midpoint(mesh.position, a, b)
    before = after = 2.0
    for i in range(count):
        e = np.int64(mesh.cavity.around_other[i])
        c, d = other_corners(node, e, corner_of(node, e, a), corner_of(node, e, b))
        before = min(before, cubed_quality(position, a, b, c, d))
        after = min(after, cubed_quality_at(position, x, b, c, d))
        after = min(after, cubed_quality_at(position, x, a, d, c))
    return allowed(after, before, floor)


@kernel
def weigh_splits(mesh, trial, offers, _, floor, nodes):
    """Compute the gains of splits of edges from nodes.

    Each edge belongs to its node of lower number. Its gain is stored at the first element with that edge in the
    list of elements around the node, and is 0 if the split is not allowed.
    """
    node, cavity = mesh.elements.node, mesh.cavity
    for k in range(len(nodes)):
        v = np.int64(nodes[k])
        count = gather_around(mesh, v, cavity.old)
        for i in range(list_neighbours(mesh, v, count)):
            w = np.int64(cavity.made[i])
            if w < v or (trial.fixed[v] and trial.fixed[w] and (offers.lone[v] or offers.lone[w])):
                continue  # Dirichlet values between both nodes are unknown
            shell = list_shell(mesh, count, w)
            gain, _ = gain_of_split(mesh, trial, cavity.around_other, shell, v, w)
            if gain > 0.0 and is_open(mesh, offers, shell, v, w) and halves_allowed(mesh, shell, v, w, floor):
                e = np.int64(cavity.around_other[0])
                offers.gain[e, edge_between(node, e, v, w)] = gain


@inner_kernel
def edge_between(node, e, a, b):
    for edge in range(5):
        v, w = node[e, EDGES[edge, 0]], node[e, EDGES[edge, 1]]
        if (v == a and w == b) or (v == b and w == a):
            return edge
    return 5


@inner_kernel
def energy_around(mesh, trial, v, count):
    total, worst = 0.0, 2.0
    node = mesh.elements.node
    for i in range(count):
        e = np.int64(mesh.cavity.old[i])
        total += energy_of(mesh, trial, node, e, mesh.elements.region[e], v, v)[0]
        total += slivers_of(mesh.position, mesh.elements, mesh.surfaces, trial, e, UNMOVED)[0]
        worst = min(worst, element_quality(mesh.position, node, e))
    return total, worst


@inner_kernel
def energy_merged(mesh, trial, v, w, count, least):
    """Return the functional of the elements around v after merging v into w.

    The elements around v must be in `cavity.old`. Returned is inf if an element would be worse than `least`.
    """
    position, elements, node = mesh.position, mesh.elements, mesh.elements.node
    total = 0.0
    for i in range(count):
        e = np.int64(mesh.cavity.old[i])
        k = corner_of(node, e, v)
        if corner_of(node, e, w) >= 0:
            p = elements.patch[e, k]
            if p >= 0 and trial.counted[p]:  # face of the neighbour after the collapse
                total += sliver(position, elements, mesh.surfaces, trial, e, k, UNMOVED)[0]
            continue
        face = face_of(node, e, k)
        if not cubed_quality(mesh.position, w, *face) >= least:
            return np.inf
        region = mesh.elements.region[e]
        total += element_energy(position, trial, region, source_around(trial, region, v), w, *face)[0]
        change = value_at(trial, region, w) - value_at(trial, region, v)
        moved = v, point(position, w), change
        total += slivers_of(position, elements, mesh.surfaces, trial, e, moved)[0]
    return total


@inner_kernel
def cheapest_collapse(mesh, trial, v, most, floor):
    """Return the least cost below `most` of a collapse of v, and its target node.

    Returned are inf and -1 if no collapse is allowed.
    """
    freedom, least = mesh.freedom, most
    into = np.int64(NOWHERE)
    count = gather_around(mesh, v, mesh.cavity.old)
    before, worst = energy_around(mesh, trial, v, count)
    for i in range(list_neighbours(mesh, v, count)):
        w = np.int64(mesh.cavity.made[i])
        if freedom.number[w] == INSIDE and freedom.number[v] != INSIDE:
            continue
        cost = energy_merged(mesh, trial, v, w, count, max(FLAT, min(floor, worst))) - before
        # cost first, because the checks are slower
        if cost < least and prepare_collapse(mesh, v, w, floor, UNLIMITED)[0] > 0.0:
            least, into = cost, w
    return least if into >= 0 else np.inf, into


@kernel
def weigh_collapses(mesh, trial, offers, most, floor, nodes):
    for k in range(len(nodes)):
        v = np.int64(nodes[k])
        offers.cost[v] = np.inf
        if offers.removable[v]:
            offers.cost[v] = cheapest_collapse(mesh, trial, v, most, floor)[0]


@inner_kernel
def next_collapse(mesh, trial, offers, nodes, a, b, most, floor):
    """Return a node with a collapse that costs less than `most` and keeps edge ab.

    Returned are the node, -1 if there is none, its target node, and the cost. Nodes that cannot collapse are
    marked in `offers.removable`.
    """
    for i in range(len(nodes)):
        v = np.int64(nodes[i])
        if not offers.cost[v] < most:
            break
        if not offers.removable[v]:
            continue
        cost, w = cheapest_collapse(mesh, trial, v, most, floor)
        if w < 0:
            offers.removable[v] = False
            continue
        _, count, _ = prepare_collapse(mesh, v, w, floor, UNLIMITED)
        if not holds_edge(mesh, count, a, b):
            return v, w, cost
    return NOWHERE, NOWHERE, 0.0


@kernel
def exchange(mesh, trial, queue, offers, ends, gains, nodes, state, margin, floor):
    """Split edges and collapse nodes in pairs while `margin` times the cost is less.

    Edges `ends` (k, 2) are sorted by decreasing `gains`, `nodes` by increasing costs, of which `state` has the position
    reached. Rows of removed nodes are used again for new nodes, which are marked `is_new`. Values of new nodes are
    stored in the trial, new elements enter the queue. Returned are the number of pairs and the decrease of the
    functional.
    """
    pairs, decrease = 0, 0.0
    for i in range(len(ends)):
        a, b = np.int64(ends[i, 0]), np.int64(ends[i, 1])
        if mesh.pool.height[1] < MOST or not offer_is_left(offers, nodes, state, margin, gains[i]):
            break
        count = 0 if offers.is_new[a] or offers.is_new[b] else prepare_split(mesh, a, b, floor)
        if count == 0:
            continue
        gain, _ = gain_of_split(mesh, trial, mesh.cavity.old, count, a, b)
        if not gain > SHRUNK * gains[i]:
            continue
        v, w, cost = next_collapse(mesh, trial, offers, nodes[state[AT] :], a, b, gain / margin, floor)
        if v < 0:
            continue
        offers.removable[v] = False
        _, old, new = prepare_collapse(mesh, v, w, floor, UNLIMITED)
        collapse(mesh, v, old, new)
        enter_made(mesh, queue, new)
        count = prepare_split(mesh, a, b, floor)
        gain, value = gain_of_split(mesh, trial, mesh.cavity.old, count, a, b)
        p = split(mesh, a, b, count)
        enter_made(mesh, queue, 2 * count)
        set_new(trial, offers, p, a, b, value, False)
        pairs, decrease = pairs + 1, decrease + gain - cost
    return pairs, decrease
