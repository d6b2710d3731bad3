"""Energy descent of nodes on periodic boundaries.

The solution satisfies u(R x + t) = s u(x) on a pair of boundaries. The elements around the partner of a node
are moved back to the node, and their values are multiplied by s. The kernels then see one whole star. The
node slides along its curve segment, and its partner moves with the node.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Int8s, Ints, IntsPair, Mask, counted
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.pairs import sliding_pairs
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CONSTANTS,
    HALF_FLUX_X,
    HELD,
    RATES_X,
    RATES_Y,
    SIXTH_SOURCE,
    SOURCE_TERMS,
    X_BY_X,
    Shapes,
    Star,
    Trial,
    Trials,
)
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.loops import Function, Loops

__all__ = ["Freedom", "descend_pairs", "independent", "set_partners"]


class Freedom(NamedTuple):
    kind: Int8s  # (n,)
    fixed: Mask  # (n,)
    sign: Floats  # (c,): `Functional.sign`


class Couples(NamedTuple):
    """Periodic pairs of nodes, with the motions x -> A x + b from node to partner."""

    node: Ints
    partner: Ints
    turn: Floats  # (k, 2, 2)
    shift: Floats  # (k, 2)
    sign: Floats  # (k,)

    @classmethod
    def of(cls, movable: MovableMesh, sign: Floats) -> "Couples":
        constraints = movable.constraints
        node, partner = sliding_pairs(constraints)
        has_sign = sign[constraints.own_chain[node]] != 0.0
        node, partner = node[has_sign], partner[has_sign]
        motion = constraints.periodic.motions[constraints.periodic.motion[node]]
        return cls(node, partner, motion[:, :, :2], motion[:, :, 2], sign[constraints.own_chain[node]])

    def some(self, rows: Ints) -> "Couples":
        return Couples(self.node[rows], self.partner[rows], self.turn[rows], self.shift[rows], self.sign[rows])


def set_partners(movable: MovableMesh, trial: TrialFunction, sign: Floats) -> None:
    # After interpolation onto a moved mesh both sides differ by rounding, on arcs by more.
    couples = Couples.of(movable, sign)
    for function in filter(None, (trial, trial.dual)):
        function.values[couples.partner] = couples.sign * function.values[couples.node]
    if trial.modes is None or not len(couples.node):
        return
    stars, degrees = Gathered.of(movable, couples), trial.modes.side.shape[2]
    (own, a), (at_partner, b) = stars.end_corners(movable, couples)
    # odd coefficients change sign unless the pair folds the mesh, because both elements are counter-clockwise
    against = np.where((a == b)[:, None], 1.0, [1.0, -1.0])[:, :degrees]
    times = against * stars.side_factors(degrees, stars.signs(couples))[at_partner, 0]
    for modes in trial.all_modes:
        coefficients = modes.side[stars.element[own], stars.corner[own, 3 - a]]
        modes.side[stars.element[at_partner], stars.corner[at_partner, 3 - b]] = times * coefficients


def descend_pairs(movable: MovableMesh, loops: Loops, freedom: Freedom) -> float:
    if not len(movable.constraints.periodic.motions):
        return 0.0
    couples, gain = Couples.of(movable, freedom.sign), 0.0
    number = np.full(movable.nnodes, -1)
    number[couples.node] = number[couples.partner] = np.arange(len(couples.node))
    for rows in independent(number[movable.triangulation.elements.node], len(couples.node)):
        some = couples.some(rows)
        stars = Gathered.of(movable, some)
        patch = stars.patch(movable, loops, some, freedom)
        gain += loops.descend_patch(patch, np.arange(len(rows), dtype=np.int32))
        stars.write_back(movable, loops, some, patch)
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


class Gathered(NamedTuple):
    """Elements around pairs, one per row, sorted by pair, with the node first."""

    owner: Ints  # (r,): index of the pair
    element: Ints  # (r,)
    corner: Ints  # (r, 3): corners of the element in the order of the patch
    at_partner: Mask  # (r,): True around the partner
    mirrored: Mask  # (r,): True if the motion reverses the orientation

    @classmethod
    def of(cls, movable: MovableMesh, couples: Couples) -> "Gathered":
        tri, centres = movable.triangulation, np.concatenate([couples.node, couples.partner])
        start = tri.star.start[centres]
        count = tri.star.start[centres + 1] - start
        which = np.repeat(np.arange(len(centres)), count)
        row = counted(count) + start[which]
        element = tri.star.element[row]
        owner = which % len(couples.node)
        at_partner = which >= len(couples.node)
        order = np.argsort(owner, kind="stable")
        element, owner, at_partner = element[order], owner[order], at_partner[order]
        mirrored = at_partner & (np.linalg.det(couples.turn) < 0.0)[owner]
        k = np.argmax(tri.elements.node[element] == centres[which[order]][:, None], axis=1)
        step = np.where(mirrored[:, None], [0, 2, 1], [0, 1, 2])
        return cls(owner, element, (k[:, None] + step) % 3, at_partner, mirrored)

    def nodes(self, movable: MovableMesh) -> Ints:
        return movable.triangulation.elements.node[self.element[:, None], self.corner]

    def positions(self, movable: MovableMesh, couples: Couples) -> Floats:
        """Return the corners, (r, 3, 2), moved back where they belong to a partner."""
        position = movable.triangulation.position[self.nodes(movable)]
        turn, shift = couples.turn[self.owner], couples.shift[self.owner]
        back = np.einsum("rkj,rji->rki", position - shift[:, None], turn)
        return np.where(self.at_partner[:, None, None], back, position)

    def end_corners(self, movable: MovableMesh, couples: Couples) -> tuple[IntsPair, IntsPair]:
        # Corners are rows and columns (2 k,). The first corner here is the last at the partner, except for pairs that
        # fold the mesh (Kelvin discs).
        node, star = self.nodes(movable), (2 * self.owner + self.at_partner) * movable.nnodes
        ahead, behind = star + node[:, 1], star + node[:, 2]
        first, last = np.flatnonzero(~np.isin(ahead, behind)), np.flatnonzero(~np.isin(behind, ahead))
        (first, first_at_partner), (last, last_at_partner) = (
            (rows[~self.at_partner[rows]], rows[self.at_partner[rows]]) for rows in (first, last)
        )
        x = self.positions(movable, couples)
        distance = [np.sum((x[first_at_partner, 1] - end) ** 2, axis=1) for end in (x[first, 1], x[last, 2])]
        folds = distance[0] < distance[1]
        to_first, to_last = np.where(folds, 1, 2), np.where(folds, 2, 1)
        at_partner = (
            np.where(folds, first_at_partner, last_at_partner),
            np.where(folds, last_at_partner, first_at_partner),
        )
        here = np.concatenate([first, last]), np.repeat([1, 2], len(first))
        return here, (np.concatenate(at_partner), np.concatenate([to_first, to_last]))

    def numbers(self, movable: MovableMesh, couples: Couples) -> IntsPair:
        """Return the patch node of every corner, (r, 3), and a corner 3 r + k of each.

        The first patch nodes are those of the pairs.
        """
        node, count = self.nodes(movable), len(couples.node)
        key = (self.owner[:, None] * 2 + self.at_partner[:, None]) * movable.nnodes + node
        here, at_partner = self.end_corners(movable, couples)
        key[at_partner] = key[here]
        key[:, 0] = self.owner - count  # smallest keys, so that pairs have the first rows
        _, found, number = np.unique(key, return_index=True, return_inverse=True)
        return number.reshape(key.shape), found

    def patch(self, movable: MovableMesh, loops: Loops, couples: Couples, freedom: Freedom) -> Function:
        tri, constraints = movable.triangulation, movable.constraints
        count = len(couples.node)
        number, found = self.numbers(movable, couples)
        node, times = self.nodes(movable), self.signs(couples)
        position = self.positions(movable, couples).reshape(-1, 2)[found]
        rows = np.ravel(node)[found]
        start = np.full(len(rows) + 1, len(node), np.int32)
        start[: count + 1] = np.searchsorted(self.owner, np.arange(count + 1))
        ends = number.astype(np.int32)
        star = Star(start, np.arange(len(node), dtype=np.int32), *np.ascontiguousarray(ends[:, 1:].T))
        primal, dual = loops.function.trials
        general = loops.function.shapes is not None
        trials = Trials(*(self.trial(each, couples, freedom, ends, found, node, general) for each in (primal, dual)))
        kind = np.where(np.arange(len(rows)) < count, freedom.kind[rows], HELD).astype(np.int8)
        of_nodes = {name: getattr(constraints, name)[rows] for name in ("chain", "parameter", "inner")}
        modes = tuple(self.modes(movable, own, times, freedom.sign) for own in loops.function.modes)
        shapes = loops.function.shapes and self.shapes(loops.function.shapes, couples)
        elements = tri.elements._replace(node=ends)
        mesh = KernelMesh(position, elements, star, constraints._replace(kind=kind, **of_nodes))
        return Function(mesh, trials, modes, shapes)

    def trial(
        self, trial: Trial, couples: Couples, freedom: Freedom, ends: Ints, found: Ints, node: Ints, general: bool
    ) -> Trial:
        laws, nonlinear = (
            trial.laws._replace(number=trial.laws.number[self.element]),
            np.zeros(len(found), bool),
        )
        nonlinear[ends[laws.number >= 0]] = True
        values = trial.value
        if len(values):
            values = (self.signs(couples)[:, None] * values[node]).ravel()[found]
        fixed, data = freedom.fixed[np.ravel(node)[found]], self.data(trial.data, couples, general)
        return trial._replace(value=values, fixed=fixed, data=data, nonlinear=nonlinear, laws=laws)

    def signs(self, couples: Couples) -> Floats:
        return np.where(self.at_partner, couples.sign[self.owner], 1.0)

    def data(self, data: Floats, couples: Couples, general: bool) -> Floats:
        """Return `Trial.data` of the patch.

        `general` states that a function in `data` is a source, otherwise a flux.
        """
        moved, at_partner = data[self.element].copy(), self.at_partner
        turn, shift, sign = (array[self.owner[at_partner]] for array in (couples.turn, couples.shift, couples.sign))
        rows = moved[at_partner]
        rows[:, SIXTH_SOURCE] *= sign
        half_flux = slice(HALF_FLUX_X, HALF_FLUX_X + 2)
        rows[:, half_flux] = sign[:, None] * np.einsum("rp,rpq->rq", rows[:, half_flux], turn)
        if data.shape[1] > CONSTANTS:
            centre = slice(CENTRE_X, CENTRE_X + 2)
            rows[:, centre] = np.einsum("rj,rji->ri", rows[:, centre] - shift, turn)
        if data.shape[1] > CONSTANTS and general:
            axes = slice(X_BY_X, SOURCE_TERMS)
            rows[:, axes] = np.einsum("rpj,rji->rpi", rows[:, axes].reshape(-1, 2, 2), turn).reshape(-1, 4)
            rows[:, SOURCE_TERMS:] *= sign[:, None]
        elif data.shape[1] > CONSTANTS:
            rates = np.stack([rows[:, at : at + 5] for at in (RATES_X, RATES_Y)], axis=1)  # by x, y, xx, xy and yy
            slope = np.einsum("r,rpq,rpj,rji->rqi", sign, turn, rates[:, :, :2], turn)
            hessian = rates[:, :, [[2, 3], [3, 4]]]
            hessian = np.einsum("r,rpq,rpij,rik,rjl->rqkl", sign, turn, hessian, turn, turn)
            parts = np.concatenate([slope, hessian[:, :, [0, 0, 1], [0, 1, 1]]], axis=2)
            for part, at in enumerate((RATES_X, RATES_Y)):
                rows[:, at : at + 5] = parts[:, part]
        moved[at_partner] = rows
        return moved

    def side_factors(self, degrees: int, times: Floats) -> Floats:
        odd = np.where(self.mirrored, -1.0, 1.0)
        return (times[:, None] * np.stack([np.ones(len(odd)), odd], axis=1)[:, :degrees])[:, None]

    def shapes(self, shapes: Shapes, couples: Couples) -> Shapes:
        offsets = shapes.offset[self.element[:, None], self.corner]
        back = np.einsum("rkj,rji->rki", offsets, couples.turn[self.owner])
        return Shapes(
            np.where(self.at_partner[:, None, None], back, offsets), shapes.special[self.element], shapes.around
        )

    def modes(self, movable: MovableMesh, modes: Modes, times: Floats, sign: Floats) -> Modes:
        at = self.element[:, None], self.corner
        chain = movable.triangulation.elements.chain[at]
        dirichlet = modes.dirichlet[at] & ~((chain >= 0) & (np.append(sign, 0.0)[chain] != 0.0))
        side = modes.side[at] * self.side_factors(modes.side.shape[2], times)
        return Modes(side, modes.bubble[self.element] * times, dirichlet)

    def write_back(self, movable: MovableMesh, loops: Loops, couples: Couples, patch: Function) -> None:
        constraints, count = movable.constraints, len(couples.node)
        parameter = patch.mesh.constraints.parameter[:count]
        for nodes, times in ((couples.node, np.ones(count)), (couples.partner, couples.sign)):
            moved = parameter != constraints.parameter[nodes]
            constraints.parameter[nodes] = parameter
            points = movable.outline.points_on(constraints.own_chain[nodes[moved]], parameter[moved])
            movable.triangulation.position[nodes[moved]] = points
            for function, now in zip(loops.function.trials, patch.trials, strict=True):
                if len(function.value):
                    function.value[nodes] = times * now.value[:count]
        signs = self.signs(couples)
        for modes, own in zip(loops.function.modes, patch.modes, strict=True):
            modes.side[self.element[:, None], self.corner] = own.side * self.side_factors(modes.side.shape[2], signs)
            modes.bubble[self.element] = own.bubble * signs
