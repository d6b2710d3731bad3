"""Hand corners of outlines from one node to its neighbour, so that nodes travel from chain to chain.

Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", Fig. 3.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import HELD, JUNCTION, OTHER, OWN, SLIDING
from kohonen_adapt.kernels.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.chains import distance_to_chain, parameter_of, point_at, within_reach
from kohonen_adapt.kernels.triangle.connectivity import corner_of
from kohonen_adapt.kernels.triangle.geometry import allowed, worst_in_star


@inner_kernel
def follower(elements, star, constraints, corner, chain):
    """The sliding node next to a corner on a chain, or -1; -1 as well where the corner would leave a flat ear."""
    found = np.int64(-1)
    for k in range(star.start[corner], star.start[corner + 1]):
        e, outlines = star.element[k], 0
        for j in range(3):
            if elements.node[e, j] == corner:
                continue
            if elements.chain[e, j] >= 0:
                outlines += 1
            if elements.chain[e, j] == chain:
                found = star.ahead[k] + star.behind[k] - elements.node[e, j]
        if outlines == 2:
            return -1
    if found >= 0 and constraints.kind[found] == SLIDING and constraints.chain[found, OWN] == chain:
        return found
    return -1


@inner_kernel
def relabel_edge(elements, star, a, b, chain):
    """Hand the edge ab to another chain, in the elements on both sides of it."""
    for k in range(star.start[a], star.start[a + 1]):
        e = star.element[k]
        if star.ahead[k] != b and star.behind[k] != b:
            continue
        for j in range(3):
            if elements.node[e, j] != a and elements.node[e, j] != b:
                elements.chain[e, j] = chain


@inner_kernel
def jump(position, elements, star, constraints, v, x, y, step, floor):
    """Let v leave a corner for the nearer chain, and its follower take over (the paper's Fig. 3)."""
    chains, onto, away = constraints.chains, np.int64(constraints.chain[v, OWN]), np.int64(constraints.chain[v, OTHER])
    corner_x, corner_y = position[v, 0], position[v, 1]
    corner, corner_away = parameter_of(position, constraints, onto, v), parameter_of(position, constraints, away, v)
    distance, target = distance_to_chain(chains, onto, x, y, corner)
    distance_away, target_away = distance_to_chain(chains, away, x, y, corner_away)
    if distance_away < distance:
        onto, away, corner, target = away, onto, corner_away, target_away
    next_node = follower(elements, star, constraints, v, away)
    parameter = corner + step * (target - corner)
    if next_node < 0 or parameter == corner or elements.level[next_node] != elements.level[v]:
        return
    if not within_reach(position, elements, star, chains, away, next_node, corner_x, corner_y):
        return
    if not swapped(position, star, constraints, v, next_node, onto, parameter, floor):
        return
    hand_over(constraints, v, next_node, onto, away, parameter)
    relabel_edge(elements, star, v, next_node, onto)


@inner_kernel
def jump_at_junction(position, elements, star, constraints, v, x, y, step, floor):
    """Let v leave a junction of three chains along one; its neighbour on another takes over, and the third's end.

    That it can where one element is all that lies between the neighbour's chain and the third: its edge from v to the
    third chain's next node becomes free, that from the neighbour becomes the chain's end, and the element changes
    sides.
    """
    chains, onto, least, target = constraints.chains, np.int64(-1), np.inf, 0.0
    for k in range(star.start[v], star.start[v + 1]):
        for j in range(3):
            c = np.int64(elements.chain[star.element[k], j])
            if c < 0 or elements.node[star.element[k], j] == v:
                continue
            distance, parameter = distance_to_chain(chains, c, x, y, parameter_of(position, constraints, c, v))
            if distance < least:
                onto, least, target = c, distance, parameter
    corner = parameter_of(position, constraints, onto, v)
    parameter = corner + step * (target - corner)
    if parameter == corner:
        return
    for k in range(star.start[v], star.start[v + 1]):
        e = star.element[k]
        ahead, behind = np.int64(star.ahead[k]), np.int64(star.behind[k])
        for next_node, other in ((ahead, behind), (behind, ahead)):
            if not may_follow(position, elements, star, constraints, e, v, next_node, other, onto):
                continue
            if swapped(position, star, constraints, v, next_node, onto, parameter, floor):
                third = np.int64(chain_of_edge(elements, e, next_node))
                hand_over(constraints, v, next_node, np.int64(JUNCTION), np.int64(-1), parameter)
                constraints.chain[v, OWN] = onto
                elements.region[e] = elements.region[elements.neighbour[e, corner_of(elements.node, e, next_node)]]
                relabel_edge(elements, star, v, next_node, onto)
                relabel_edge(elements, star, v, other, np.int64(-1))
                relabel_edge(elements, star, next_node, other, third)
                return


@inner_kernel
def may_follow(position, elements, star, constraints, e, v, next_node, other, onto):
    """Whether e, with v at a junction, lies between the chains of its two other nodes, and the next may take over."""
    chains, away, third = constraints.chains, chain_of_edge(elements, e, other), chain_of_edge(elements, e, next_node)
    if away < 0 or third < 0 or onto == away or onto == third or away == third:  # noqa: SIM109 (numba knows no such in)
        return False
    if chain_of_edge(elements, e, v) >= 0:
        return False
    if constraints.kind[next_node] != SLIDING or constraints.chain[next_node, OWN] != away:
        return False
    if elements.level[next_node] != elements.level[v]:
        return False
    if elements.neighbour[e, corner_of(elements.node, e, next_node)] < 0:
        return False
    return within_reach(position, elements, star, chains, away, next_node, position[v, 0], position[v, 1])


@inner_kernel
def chain_of_edge(elements, e, v):
    """Chain of the edge of e opposite to its node v, -1 for none."""
    return elements.chain[e, corner_of(elements.node, e, v)]


@inner_kernel
def swapped(position, star, constraints, v, next_node, onto, parameter, floor):
    """Move v to a parameter of a chain and its follower into the corner; returns whether the quality rule allows it."""
    before = worst_of_two(position, star, v, next_node)
    corner_x, corner_y = position[v, 0], position[v, 1]
    next_x, next_y = position[next_node, 0], position[next_node, 1]
    position[v, 0], position[v, 1] = point_at(constraints.chains, onto, parameter)
    position[next_node, 0], position[next_node, 1] = corner_x, corner_y
    if allowed(worst_of_two(position, star, v, next_node), before, floor):
        return True
    position[v, 0], position[v, 1] = corner_x, corner_y
    position[next_node, 0], position[next_node, 1] = next_x, next_y
    return False


@inner_kernel
def worst_of_two(position, star, v, w):
    """Worst signed quality of the stars of two nodes."""
    return min(
        worst_in_star(position, star, v, position[v, 0], position[v, 1]),
        worst_in_star(position, star, w, position[w, 0], position[w, 1]),
    )


@inner_kernel
def hand_over(constraints, v, next_node, onto, away, parameter):
    """Give the corner's constraint to the follower; v slides from now on."""
    constraints.kind[next_node], constraints.kind[v] = HELD, SLIDING
    constraints.chain[next_node, OWN], constraints.chain[next_node, OTHER] = onto, away
    constraints.chain[v, OWN], constraints.chain[v, OTHER] = onto, -1
    constraints.parameter[v] = parameter
