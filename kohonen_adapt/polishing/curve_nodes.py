"""Energy descent of nodes on curves, with the slivers between chords and curves.

Nodes on curves are few, so no compiled loop is needed. Nodes without a common element move at the same time,
each by Newton's method in the curve parameter, with derivatives by finite differences and the nodal value
eliminated.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask, counted
from kohonen_adapt.geometry.plane.chains import on_chains, parameters_of, signed_distances, wrapped
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.triangle.geometry import FLAT
from kohonen_adapt.kernels.triangle.polish.descend import OVERSTEP, ROUNDING
from kohonen_adapt.mesh.cells import determinants
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.chords import CENTROID, Slivers, segment_areas
from kohonen_adapt.polishing.functional import Functional

__all__ = ["descend_curves"]

SHORT = 1e-3  # finite difference step, relative to the parameter distance to the next node
FARTHEST = 0.4  # largest move relative to the same distance, below 0.5 because both nodes may move


def descend_curves(movable: MovableMesh, functional: Functional, trial: TrialFunction) -> float:
    triangulation, gain = movable.triangulation, 0.0
    nodes = np.flatnonzero(functional.chords.moving(triangulation))
    if not len(nodes):
        return 0.0
    number = np.full(triangulation.nnodes, -1)
    number[nodes] = np.arange(len(nodes))
    slivers, near = functional.chords.slivers(triangulation), nearest_on_curves(movable, functional.chords.counted)
    for rows in independent(number[triangulation.elements.node], len(nodes)):
        gain += move_nodes(Stars.of(movable, functional, trial, nodes[rows], slivers), near[nodes[rows]])
    return gain


def independent(of_corners: Ints, count: int) -> list[Ints]:
    """Return groups of nodes, no two of one group in the same element.

    `of_corners` (m, 3) holds the index of a node or -1. Nodes that an element has twice are in no group.
    """
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        both = (of_corners[:, a] >= 0) & (of_corners[:, b] >= 0)
        for i, j in zip(of_corners[both, a].tolist(), of_corners[both, b].tolist(), strict=True):
            beside[i].add(j)
            beside[j].add(i)
    groups: list[list[int]] = []
    group = [-1] * len(beside)
    for i, others in enumerate(beside):
        if i in others:
            continue
        taken = {group[j] for j in others}
        group[i] = next(g for g in range(len(groups) + 1) if g not in taken)
        groups += [[]] if group[i] == len(groups) else []
        groups[group[i]].append(i)
    return [np.array(rows) for rows in groups]


def nearest_on_curves(movable: MovableMesh, curves: Mask) -> Floats:
    elements, constraints = movable.triangulation.elements, movable.constraints
    e, k = np.nonzero(on_chains(elements.chain, curves))
    chain = elements.chain[e, k]
    ends = elements.ends(e, k)
    start, end = (parameters_of(movable.triangulation.position, constraints, chain, node) for node in ends)
    near = np.full(movable.nnodes, np.inf)
    for node in ends:
        np.minimum.at(near, node, np.abs(signed_distances(constraints.chains, chain, start, end)))
    return near


class Part(NamedTuple):
    values: Floats
    constants: Floats  # (r, 4)
    change: Floats  # (s, 4)


class Stars(NamedTuple):
    movable: MovableMesh
    parts: list[Part]
    node: Ints  # (k,)
    dirichlet: Mask  # (k,): True for Dirichlet values
    owner: Ints  # (r,): index of the node among the k
    ahead: Ints  # (r,)
    behind: Ints  # (r,)
    reach: Floats  # (r, 2): maximum lengths of the facets to `ahead` and `behind`, inf if not on a curve
    holder: Ints  # (s,): row of the element with the sliver
    ends: Ints  # (s, 2): end nodes of the chord
    chain: Ints  # (s,)
    parameter: Floats  # (s, 2): curve parameters of the end nodes

    @classmethod
    def of(
        cls, movable: MovableMesh, functional: Functional, trial: TrialFunction, node: Ints, slivers: Slivers
    ) -> "Stars":
        triangulation, constraints = movable.triangulation, movable.constraints
        star, elements, position = triangulation.star, triangulation.elements, triangulation.position
        count = star.start[node + 1] - star.start[node]
        owner = np.repeat(np.arange(len(node)), count)
        row = counted(count) + star.start[node][owner]
        e, ahead, behind = star.element[row], star.ahead[row], star.behind[row]
        first, last = np.searchsorted(slivers.element, e), np.searchsorted(slivers.element, e, side="right")
        holder = np.repeat(np.arange(len(e)), last - first)
        which = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)]).astype(np.int64)
        at, corner = slivers.element[which], slivers.corner[which]
        chain = elements.chain[at, corner]
        ends = np.stack(elements.ends(at, corner), axis=1)
        parameter = np.stack([parameters_of(position, constraints, chain, ends[:, i]) for i in range(2)], axis=1)
        parts = list[Part]()
        for part, function in functional.parts(trial):
            change = (slivers if part is functional else part.chords.slivers(triangulation)).change[which]
            parts.append(Part(function.values, part.constants[elements.region[e]], change))
        k = np.argmax(elements.node[e] == node[owner][:, None], axis=1)
        lengths = np.append(constraints.chains.reach, np.inf)
        reach = np.stack([lengths[elements.chain[e, (k + side) % 3]] for side in (2, 1)], axis=1)
        dirichlet = functional.chords.dirichlet[constraints.own_chain[node]]
        return cls(movable, parts, node, dirichlet, owner, ahead, behind, reach, holder, ends, chain, parameter)

    def points(self, parameter: Floats) -> Floats:
        return self.movable.outline.points_on(self.movable.constraints.own_chain[self.node], parameter)

    def sides(self, x: Floats) -> FloatsPair:
        position = self.movable.triangulation.position
        return position[self.ahead] - x[self.owner], position[self.behind] - x[self.owner]

    def worst(self, x: Floats) -> Floats:
        a, b = self.sides(x)
        quality = 2.0 * np.sqrt(3.0) * determinants((a.T, b.T)) / (np.sum(a**2 + b**2 + (b - a) ** 2, axis=1))
        least = np.full(len(self.node), np.inf)
        np.minimum.at(least, self.owner, quality)
        return least

    def is_allowed(self, x: Floats, before: Floats) -> Mask:
        after, now = self.worst(x), self.worst(before)
        lengths = (np.hypot(*np.stack(self.sides(place)).T) for place in (x, before))
        new, old = lengths
        too_long = np.bincount(self.owner, np.any((new > self.reach) & (new > old), axis=1), len(self.node))
        valid = (after > FLAT) & (after >= np.minimum(self.movable.polish_floor, now))
        return valid & (too_long == 0)

    def evaluated(self, parameter: Floats) -> tuple[Floats, Floats, list[Floats]]:
        # `parameter` (k,) places the nodes. The nodal values minimise the functional unless they are Dirichlet
        # values.
        x = self.points(parameter)
        own = self.ends == self.node[self.owner[self.holder]][:, None]
        at = np.where(own, parameter[self.owner[self.holder]][:, None], self.parameter)
        chains, position = self.movable.constraints.chains, self.movable.triangulation.position
        middle = at[:, 0] + 0.5 * signed_distances(chains, self.chain, at[:, 0], at[:, 1])
        start, end = (
            np.where(own[:, i : i + 1], x[self.owner[self.holder]], position[self.ends[:, i]]) for i in range(2)
        )
        offset = self.movable.outline.points_on(self.chain, middle) - 0.5 * (start + end)
        area = segment_areas(end - start, offset)
        touches = 0.5 * own.any(axis=1)
        total, size = np.zeros(len(self.node)), np.zeros(len(self.node))
        changes = []
        for part in self.parts:
            value, magnitude, slope, stiffness = self._of_part(part, x, area, offset, touches)
            change = np.where(self.dirichlet, 0.0, -slope / stiffness)
            total += value + (slope + 0.5 * stiffness * change) * change
            size += magnitude
            changes.append(change)
        return total, size, changes

    def _of_part(self, part: Part, x: Floats, area: Floats, offset: Floats, touches: Floats) -> list[Floats]:
        # `area`, `offset` and `touches` (s,) belong to the slivers. `touches` is the value of the node's shape
        # function at the midpoint of the chord. Energies of elements precede energies of slivers.
        (a, b), own = self.sides(x), part.values[self.node][self.owner]
        doubled = determinants((a.T, b.T))
        ua, ub = part.values[self.ahead], part.values[self.behind]
        holder = np.append(np.arange(len(doubled)), self.holder)
        hat = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1) / doubled[:, None]
        turned = (ua - own)[:, None] * b - (ub - own)[:, None] * a
        slope = np.stack([turned[:, 1], -turned[:, 0]], axis=1) / doubled[:, None]
        mean = 0.5 * part.values[self.ends].sum(axis=1) + CENTROID * np.sum(slope[self.holder] * offset, axis=1)
        share = touches + CENTROID * np.sum(hat[self.holder] * offset, axis=1)
        mean, share = np.append((own + ua + ub) / 3.0, mean), np.append(np.full(len(doubled), 1.0 / 3.0), share)
        constants, weight = np.concatenate([part.constants, part.change]), np.append(0.5 * doubled, area)
        coefficient, source, flux = constants[:, 0], constants[:, 1], constants[:, 2:]
        slope, hat = slope[holder], hat[holder]
        stored, pulled = 0.5 * coefficient * np.sum(slope**2, axis=1), source * mean
        pushed = np.sum(flux * slope, axis=1)
        first = np.sum((coefficient[:, None] * slope - flux) * hat, axis=1) - source * share
        magnitude = np.abs(stored) + np.abs(pulled) + np.abs(pushed)
        second = coefficient * np.sum(hat**2, axis=1)
        terms = (weight * each for each in (stored - pulled - pushed, magnitude, first, second))
        return [np.bincount(self.owner[holder], rows, len(self.node)).astype(np.float64) for rows in terms]


def move_nodes(stars: Stars, near: Floats) -> float:
    movable, node = stars.movable, stars.node
    start = movable.constraints.parameter[node]
    short = SHORT * near
    now, size, changes_before = stars.evaluated(start)
    above, below = stars.evaluated(start + short)[0], stars.evaluated(start - short)[0]
    slope, second = (above - below) / (2.0 * short), np.abs(above - 2.0 * now + below) / short**2
    second = np.maximum(second, np.abs(slope) / near)
    change = np.divide(-OVERSTEP * slope, second, out=np.zeros_like(slope), where=second > 0.0)
    change = np.clip(change, -FARTHEST * near, FARTHEST * near)
    before = movable.triangulation.position[node]
    done = np.abs(change * slope) <= ROUNDING * size
    total = 0.0
    for _ in range(HALVINGS + 1):
        x = stars.points(start + change)
        value, _, changes_after = stars.evaluated(start + change)
        gain = now - value
        accepted = ~done & stars.is_allowed(x, before) & (gain > ROUNDING * size)
        if accepted.any():
            settled = wrapped(movable.constraints.chains, movable.constraints.own_chain[node], start + change)
            movable.constraints.parameter[node[accepted]] = settled[accepted]
            movable.triangulation.position[node[accepted]] = x[accepted]
            for old, new in zip(changes_before, changes_after, strict=True):
                old[accepted] = new[accepted]
            total += float(gain[accepted].sum())
        done, change = done | accepted, 0.5 * change
        if done.all():
            break
    for part, each in zip(stars.parts, changes_before, strict=True):
        part.values[node] += each
    return total
