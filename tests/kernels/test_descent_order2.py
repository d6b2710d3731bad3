"""Energy descent of tetrahedra at order 2: derivatives by differences, sweeps against the functional."""

import numpy as np
import pytest
from helpers.boxes import jittered, opened, qualities, triangulations
from helpers.diffusion_solids import Rising
from helpers.functions_in_space import plain
from helpers.quadratic_solids import PAIRS, functional

from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    POSITION,
    Constraints,
    Quadratic,
    Queue,
    Star,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, fill_star
from kohonen_adapt.kernels.tetrahedron.polish.descend import descend_nodes
from kohonen_adapt.kernels.tetrahedron.polish.star import derivatives_order2, number_star
from kohonen_adapt.kernels.tetrahedron.swap import remove_edge
from kohonen_adapt.polishing.energy_tables import tabulated
from kohonen_adapt.polishing.space.curved_sides import CurvedEdges

number_star, remove_edge = interpreted(number_star), interpreted(remove_edge)
derivatives = interpreted(derivatives_order2)

FLOOR = 0.2
STRAIGHT = CurvedEdges(
    np.zeros(1, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
)
SLOPE = np.array([0.0, 1.5, -0.5])  # of the values along the face x = 0
LAWS = [None, (None, Rising(0.3)), (Rising(3.0), Rising())]  # of the two regions


class Setting:
    """A box of two regions with a random function and functional of each, and the arrays of the kernels."""

    def __init__(self, seed, cells=(4, 3, 2), load=1.0, laws=None, curves=STRAIGHT):
        rng = np.random.default_rng(seed)
        position, self.node = jittered(cells, 0.3, seed)
        region = (position[self.node, 0].mean(axis=1) > 0.5).astype(np.int32)
        self.mesh, self.nodes = opened(position, self.node, region), len(position)
        rows, room, m = len(self.mesh.position), len(self.mesh.elements.node), len(self.node)
        constants = [10.0 ** rng.uniform(-1, 1, 2), load * rng.normal(size=(2, 4))]
        constants = np.column_stack([*constants, np.random.default_rng(seed + 1).normal(size=(2, 3))])
        self.constants, self.laws = constants[region], None if laws is None else [laws[k] for k in region]
        self.pairs = np.sort(self.node[:, PAIRS], axis=2)
        edges, self.edge = np.unique(self.pairs.reshape(-1, 2), axis=0, return_inverse=True)
        self.edge, value, fixed = self.edge.reshape(m, 6), rng.normal(size=rows), np.zeros(rows, dtype=bool)
        fixed[: self.nodes] = position[:, 0] == 0.0
        value[fixed] = (self.mesh.position @ SLOPE)[fixed]
        dirichlet = fixed[edges].all(axis=1)
        side, on = np.zeros((room, 6, 1)), np.zeros((room, 6), dtype=bool)
        side[:m, :, 0] = np.where(dirichlet, 0.0, rng.normal(size=len(edges)))[self.edge]
        on[:m] = dirichlet[self.edge]
        surfaces = self.mesh.surfaces
        rate = np.tile(SLOPE, (len(surfaces.shape) + len(surfaces.ridge_shape), 1))
        known = [law for law in laws or () if law is not None]
        number = np.array([-1 if law is None else known.index(law) for law in laws or (None, None)], dtype=np.int32)
        laws = Laws(number, *tabulated(known, 2000.0))
        data = constants / np.array([12.0, 24.0, 6.0, 6.0, 6.0, 1.0, 1.0, 1.0])
        trial = Trial(value, fixed, data, laws, rate, *plain(self.mesh), np.zeros((0, 2)), np.zeros((0, 2)))
        given = np.zeros(len(surfaces.shape), dtype=bool)
        block = curves.block()
        self.quadratic = Quadratic(trial, Modes(side, np.zeros(room), on), given, block)
        star, number = Star.of(rows, room), self.mesh.freedom.number
        fill_star(self.mesh.elements.node, star)
        constraints = Constraints(self.mesh.freedom, surfaces, number == INSIDE)
        self.arrays = KernelMesh(self.mesh.position, self.mesh.elements, star, constraints)

    @property
    def modes(self):
        return self.quadratic.modes.side[: len(self.node), :, 0]

    def value(self, rows=slice(None)):
        local = np.hstack([self.quadratic.trial.value[self.node], self.modes])
        laws = None if self.laws is None else [self.laws[e] for e in np.arange(len(self.node))[rows]]
        return functional(self.mesh.position, self.node[rows], local[rows], self.constants[rows], laws)

    def star_value(self, v, ends, d):
        """The functional of the star of v, moved by d[:3], its value and its edges to `ends` changed by the rest."""
        position, value, modes = (a.copy() for a in (self.mesh.position, self.quadratic.trial.value, self.modes))
        self.mesh.position[v] += d[:3]
        self.quadratic.trial.value[v] += d[3]
        for end, change in zip(ends, d[4:], strict=True):
            self.modes[np.all(self.pairs == np.sort([v, end]), axis=2)] += change
        total = self.value(np.flatnonzero((self.node == v).any(axis=1)))
        self.mesh.position[:], self.quadratic.trial.value[:], self.modes[:] = position, value, modes
        return total

    def sweep(self):
        return descend_nodes(
            self.arrays, self.quadratic.trial, self.quadratic, np.arange(self.nodes, dtype=np.int32), FLOOR**3
        )


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("laws", LAWS)
def test_the_block_of_a_node_equals_differences(row, laws):
    at, step = Setting(0, laws=laws), 1e-3 if laws is None else 3e-4
    v = np.flatnonzero(at.mesh.freedom.number == INSIDE)[row]
    assert number_star(at.arrays, at.quadratic, v)
    _, _, slope, (xx, xy, xz, yy, yz, zz) = derivatives(at.arrays, at.quadratic, v, POSITION)
    block, n = at.quadratic.block, at.quadratic.block.unknowns[0]
    gradient, lower = np.append(slope, block.rest[:n]), np.tril(block.stiffness[:n, :n])
    ends, unit = block.end[1:n, 0].copy(), step * np.eye(3 + n)
    hessian = np.block(
        [
            [np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), block.mixed[:n].T],
            [block.mixed[:n], lower + np.tril(lower, -1).T],
        ]
    )
    value = {(i, s): at.star_value(v, ends, s * unit[i]) for i in range(3 + n) for s in (-2, -1, 1, 2)}
    by = [(8 * (value[i, 1] - value[i, -1]) - value[i, 2] + value[i, -2]) / (12 * step) for i in range(3 + n)]
    np.testing.assert_allclose(gradient, by, atol=(1e-7 if laws is None else 1e-6) * np.abs(gradient).max())
    for i in range(3 + n):
        for j in range(i + 1):
            signs = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
            four = [s * t * at.star_value(v, ends, s * unit[i] + t * unit[j]) for s, t in signs]
            assert hessian[i, j] == pytest.approx(sum(four) / (4 * step**2), abs=2e-4 * np.abs(hessian).max())


def curved_around(at, v):
    """Some edges of the elements around a node, curved."""
    rows = np.flatnonzero((at.node == v).any(axis=1))
    ends = np.unique(at.pairs[rows][:, :4].reshape(-1, 2), axis=0)[::2]
    both, size = np.vstack([ends, ends[:, ::-1]]), 0.03 * np.ptp(at.mesh.position[at.node[rows]], axis=1).min()
    offset = np.tile(np.random.default_rng(0).uniform(-size, size, (len(ends), 3)), (2, 1))
    order = np.lexsort(both.T[::-1])
    start = np.searchsorted(both[order, 0], np.arange(len(at.mesh.position) + 1)).astype(np.int32)
    return CurvedEdges(start, both[order, 1].astype(np.int32), offset[order], np.full(len(order), -1, dtype=np.int32))


@pytest.mark.parametrize("laws", LAWS[::2])
def test_the_block_of_a_node_beside_curved_edges_equals_differences(laws):
    at = Setting(0, laws=laws)
    v = np.flatnonzero(at.mesh.freedom.number == INSIDE)[0]
    at = Setting(0, laws=laws, curves=curved_around(at, v))

    def found(d, change, wanted):
        at.mesh.position[v] += d
        assert number_star(at.arrays, at.quadratic, v)
        block = at.quadratic.block
        local, dof = block.local[: len(block.dof)], block.dof
        for j in range(at.arrays.star.start[v + 1] - at.arrays.star.start[v]):
            for i in range(10):
                local[j, i] += change[dof[j, i]] if dof[j, i] >= 0 else 0.0
        result = derivatives(at.arrays, at.quadratic, v, wanted)
        at.mesh.position[v] -= d
        return result

    number_star(at.arrays, at.quadratic, v)
    block, n = at.quadratic.block, at.quadratic.block.unknowns[0]
    _, _, slope, (xx, xy, xz, yy, yz, zz) = found(np.zeros(3), np.zeros(n), POSITION)
    gradient, mixed = np.append(slope, block.rest[:n]), block.mixed[:n].copy()
    lower = np.tril(block.stiffness[:n, :n])
    hessian = np.block(
        [[np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), mixed.T], [mixed, lower + np.tril(lower, -1).T]]
    )
    random = np.random.default_rng(1).normal(size=(4, 3 + n))
    step, directions = 1e-4, np.vstack([np.eye(3, 3 + n), random / np.linalg.norm(random, axis=1, keepdims=True)])
    by, second = np.zeros(len(directions)), np.zeros((len(directions), 3 + n))
    for i, change in enumerate(step * directions):
        ends = []
        for sign in (1.0, -1.0):
            _, total, slope, _ = found(sign * change[:3], sign * change[3:], POSITION)
            ends.append(np.concatenate([[total], slope, block.rest[:n]]))
        by[i] = (ends[0][0] - ends[1][0]) / (2.0 * step)
        second[i] = (ends[0][1:] - ends[1][1:]) / (2.0 * step)
    np.testing.assert_allclose(directions @ gradient, by, atol=1e-5 * np.abs(gradient).max())
    np.testing.assert_allclose(directions @ hessian, second, atol=1e-4 * np.abs(hessian).max())


def test_sweeps_end_at_the_solution_if_all_nodes_are_held():
    at = Setting(5)
    at.mesh.freedom.number[:] = HELD
    for _ in range(400):
        fall = at.sweep()
    assert fall < 1e-12 * abs(at.value())
    size = np.abs(at.quadratic.trial.value).max()
    for v in range(at.nodes):
        number_star(at.arrays, at.quadratic, v)
        derivatives(at.arrays, at.quadratic, v, POSITION)
        block, first = at.quadratic.block, int(at.quadratic.trial.fixed[v])
        assert np.abs(block.rest[first : block.unknowns[0]]).max(initial=0.0) < 1e-5 * size


def least(at, elements, constants, free):
    """The functional of elements, with coefficients of edges `free` at their best; edges of the mesh have theirs."""
    known = dict(zip(map(tuple, at.pairs.reshape(-1, 2).tolist()), at.modes.ravel(), strict=True))

    def value(change):
        modes = known | dict(zip(free, change, strict=True))
        pairs = np.sort(elements[:, PAIRS], axis=2).tolist()
        local = [
            [*at.quadratic.trial.value[e], *(modes[tuple(p)] for p in own)]
            for e, own in zip(elements, pairs, strict=True)
        ]
        return functional(at.mesh.position, elements, np.array(local), np.tile(constants, (len(elements), 1)))

    unit, zero = np.eye(len(free)), value(np.zeros(len(free)))
    if not free:
        return zero
    one = [value(e) for e in unit]
    second = np.array([[value(e + f) - one[i] - one[j] + zero for j, f in enumerate(unit)] for i, e in enumerate(unit)])
    slope = np.array(one) - zero - 0.5 * np.diag(second)
    return zero - 0.5 * slope @ np.linalg.solve(second, slope)


def removal_by_hand(at, e, edge, charge):
    """Fall of the functional by the removal of an inner edge: 0 if it should stay, None if that is not asked here."""
    a, b, first, _ = at.node[e, EDGES[edge]].tolist()
    shell = np.flatnonzero((at.node == a).any(axis=1) & (at.node == b).any(axis=1))
    ahead = {}
    for row in at.node[shell].tolist():
        k, j = row.index(a), row.index(b)
        number = next(i for i, (p, q, *_) in enumerate(EDGES.tolist()) if {p, q} == {k, j})
        p, q = (row[c] for c in EDGES[number, 2:])
        ahead.update({p: q} if k < j else {q: p})
    ring = [first]
    while ahead.get(ring[-1], first) != first:
        ring.append(ahead[ring[-1]])
    if ahead.get(ring[-1]) != first or len(ring) > 5 or np.ptp(at.constants[shell], axis=0).any():
        return None
    now = least(at, at.node[shell], at.constants[e], [])
    best = least(at, at.node[shell], at.constants[e], [tuple(sorted((a, b)))]) - 1e-12 * abs(now)
    floor, fall = min(FLOOR, qualities(at.mesh.position, at.node[shell]).min()), 0.0
    known = set(map(tuple, at.pairs.reshape(-1, 2).tolist()))
    for triangles in triangulations(0, len(ring) - 1):
        corners = [[ring[c] for c in triangle] for triangle in triangles]
        new = np.array([row for i, j, k in corners for row in ((i, j, k, b), (i, k, j, a))])
        if qualities(at.mesh.position, new).min() < floor:
            continue
        free = sorted({tuple(sorted(p)) for row in new[:, PAIRS].tolist() for p in row} - known)
        energy = least(at, new, at.constants[e], free)
        if energy + charge * (len(free) - 1) < best:
            best, fall = energy + charge * (len(free) - 1), now - energy
    return fall


@pytest.mark.parametrize("seed, charge", [(0, 0.0), (1, 0.0), (2, 0.5), (3, 5.0)])
def test_the_removal_of_an_edge_is_the_best_of_all_triangulations(seed, charge):
    at, removed = Setting(seed, cells=(4, 2, 2)), 0
    queue, closed = Queue.of(len(at.mesh.elements.node)), np.zeros(len(at.mesh.surfaces.shape), dtype=bool)
    for e in range(len(at.node)):
        for edge in range(6):
            expected = removal_by_hand(at, e, edge, charge)
            if expected is None:
                continue
            rule = np.inf, FLOOR**3, charge
            made, gain = remove_edge(at.mesh, at.quadratic.trial, at.quadratic, queue, closed, rule, e, edge)
            assert (made > 0) == (expected != 0.0)
            if made:
                assert gain == pytest.approx(expected, rel=1e-8)
                removed, at = removed + 1, Setting(seed, cells=(4, 2, 2))
        if removed > 6:
            break
    assert removed > 3
