"""On tetrahedra: what a step says is what the functional falls by, and stars know their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import driven_solids
from helpers.descents import descent_of
from helpers.diffusion_solids import PAIRS, Diffusion, QuadraticDiffusion, Rising
from helpers.magnet_solids import nested_balls
from helpers.solids import box, cut, halved_cube, l_shape, two_regions

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron import swap
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, POSITION, Constraints, Queue
from kohonen_adapt.kernels.tetrahedron.polish import swap_order2
from kohonen_adapt.kernels.tetrahedron.polish.exchange_order1 import split_parabola
from kohonen_adapt.kernels.tetrahedron.polish.star import derivatives_order2, number_star, star_of_order_1
from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.problem.functional_value import functional_value

EXACT, TABLE = 1e-11, 1e-8  # of the functional: rounding, and what tables of laws leave out
LAWS = [(None, Rising(0.3)), (Rising(3.0), Rising())]
SHIFT = np.array([[1.0, 0.0], [-0.5, 0.3], [0.0, 2.0]])
FLOOR = 0.2


class Varying(Diffusion):
    """With a source that varies inside regions."""

    def ritz(self, mesh, solution):
        return replace(super().ritz(mesh, solution), source=lambda x, region: (1.0 + region) * (x[0] * x[1] - 3.0))


def slope(x):
    return x[1] - 2.0 * x[2]


def constants(kind=Diffusion, order=1, laws=(), shift=0.0):
    """A random function with constants of two regions, given linearly on one side where the mesh has that."""

    def ritz(mesh, rng):
        side = {"side0": slope} if "side0" in (mesh.boundaries or {}) else {}
        problem = kind(10.0 ** rng.uniform(-1, 1, 2), rng.normal(size=2), rng.normal(size=(3, 2)), side)
        values, fixed = problem.ends(mesh)
        bumps = np.exp(-20.0 * np.sum((mesh.p[:, : mesh.nvertices] - rng.random((3, 1)) * mesh.p.max()) ** 2, axis=0))
        free, rough = ~fixed, 0.02 * rng.normal(size=count_unknowns(mesh, order))
        values[free] = np.append(bumps, rough[len(bumps) :])[free]
        return replace(problem.ritz(mesh, values), laws=laws, shift=SHIFT if laws and shift else 0.0)

    return ritz


def solved(problem):
    return lambda mesh, rng: problem.ritz(mesh, problem.solve(mesh))


def cube(seed):
    return halved_cube((4, 3, 3), 0, seed)


def driven(seed):
    return driven_solids.block_mesh(seed, 4)


def bent_balls(seed):
    problem = MagneticScalarPotential({"ball": Material(5.0), "air": Material()}, {"outer": 0.0}, order=2)
    return ka.adapt(nested_balls(2), problem, passes=0).mesh


CASES = {  # name: mesh, functional, and what this is known to
    "linear 1": (cube, constants(), EXACT),
    "laws 1": (cube, constants(laws=LAWS[0], shift=1.0), TABLE),
    "varying 1": (cube, constants(Varying), 1e-3),
    "wall 1": (lambda seed: two_regions(3), constants(laws=LAWS[1]), TABLE),
    "sheet 1": (lambda seed: cut(4), constants(), EXACT),
    "corner 1": (lambda seed: l_shape(2), constants(), EXACT),
    "curved 1": (lambda seed: nested_balls(2), constants(), EXACT),
    "curved laws 1": (lambda seed: nested_balls(2), constants(laws=LAWS[0], shift=1.0), TABLE),
    "driven 1": (driven, solved(replace(driven_solids.random_problem(0), order=1)), TABLE),
    "driven 2": (driven, solved(driven_solids.random_problem(0)), TABLE),
    "linear 2": (cube, constants(QuadraticDiffusion, 2), EXACT),
    "laws 2": (cube, constants(QuadraticDiffusion, 2, LAWS[0]), TABLE),
    "shifted laws 2": (cube, constants(QuadraticDiffusion, 2, LAWS[1], 1.0), TABLE),
    "curved 2": (bent_balls, constants(QuadraticDiffusion, 2), 1e-7),
    "curved laws 2": (bent_balls, constants(QuadraticDiffusion, 2, LAWS[0], 1.0), 1e-7),
}


class Start:
    """A function on a mesh, as a descent has it."""

    def __init__(self, mesh, ritz, **rules):
        self.movable = MovableSolid.of(mesh, Rules("recycle", FLOOR, **rules))
        self.functional = SolidFunctional.of(ritz, self.movable, mesh)
        self.descent = descent_of(self.movable, self.functional)
        self.mesh, self.trial = self.descent.opened.mesh, self.descent.trial

    def value(self):
        return self.descent.value()

    def freedom(self):
        return self.functional.freedom(self.mesh.freedom, self.trial.fixed, self.trial.surface)

    def swap(self):
        return self.descent.swap(self.descent.opened.parts())

    def recycle(self):
        return self.descent.recycle()[1]

    def sweep(self):
        return self.descent.sweep(self.descent.opened.parts(), self.freedom())

    def handed_back(self):
        """The mesh, and which values are given there."""
        rows = self.descent.opened.write_back(self.movable)
        return self.movable.mesh(), self.trial.value[rows], self.trial.fixed[rows]


def started(name, seed=0):
    build, ritz, _ = CASES[name]
    mesh, rng = build(seed), np.random.default_rng(seed)
    at = Start(mesh, ritz(mesh, rng))
    rough = 0.02 * np.ptp(at.trial.value) * rng.normal(size=len(at.trial.value))
    at.trial.value[:] += np.where(at.trial.fixed, 0.0, rough)
    return mesh, at


def is_continuous(descent):
    """Every edge has one coefficient and one Dirichlet mask in all of its elements."""
    node = descent.opened.mesh.elements.node
    rows = np.flatnonzero(node[:, 0] >= 0)
    key = np.unique(np.sort(node[rows][:, PAIRS], axis=2).reshape(-1, 2), axis=0, return_inverse=True)[1].ravel()
    pairs = descent.modes.side[rows, :, 0].ravel(), descent.modes.dirichlet[rows].ravel().astype(float)
    for values in pairs:
        low, high = np.full(key.max() + 1, np.inf), np.full(key.max() + 1, -np.inf)
        np.minimum.at(low, key, values)
        np.maximum.at(high, key, values)
        if not np.array_equal(low, high):
            return False
    return True


@pytest.mark.parametrize(
    ("name", "seed"), [(name, seed) for name in CASES for seed in range(1 if "curved" in name else 2)]
)
def test_every_step_takes_off_what_it_says(name, seed):
    mesh, at = started(name, seed)
    near, gains, before = CASES[name][2], [], at.value()
    for step in (at.swap, at.recycle, at.sweep) * (1 if name.startswith("curved laws") else 2):
        gains.append(step())
        now = at.value()
        fall = before - now
        assert gains[-1] >= 0.0 or step == at.recycle
        if step != at.sweep or not name.startswith("curved") or name.endswith("2"):
            assert gains[-1] == pytest.approx(fall, rel=1e-6, abs=near * (abs(before) + 1.0))
        before = now
        assert name.endswith("1") or name.startswith("driven") or is_continuous(at.descent)  # offsets jump
    assert max(gains[::3]) > 0.0 and gains[1] > 0.0 and gains[2] > 0.0
    found = at.handed_back()[0]
    assert ka.quality(found).min() >= min(FLOOR, ka.quality(mesh).min()) * (1.0 - 1e-9)


def told(at, v):
    """The gradient of the functional by place, value and edges of a node, and its second derivatives."""
    quadratic = at.descent.function()[1]
    if quadratic is None:
        place = tuple(at.mesh.position[v]), 0.0, POSITION, False
        _, slope, by_value, second, mixed, twice = interpreted(star_of_order_1)(at.arrays, at.trial, v, *place)
        rest, mixed, stiffness = [by_value], np.array([mixed]), np.array([[twice]])
    else:
        assert interpreted(number_star)(at.arrays, quadratic, v)
        _, _, slope, second = interpreted(derivatives_order2)(at.arrays, quadratic, v, POSITION)
        block, n = quadratic.block, quadratic.block.unknowns[0]
        rest, mixed, lower = block.rest[:n].copy(), block.mixed[:n].copy(), np.tril(block.stiffness[:n, :n])
        stiffness, at.ends = lower + np.tril(lower, -1).T, block.end[1:n, 0].copy()
    square = np.array(second)[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])]
    return np.append(slope, rest), np.block([[square, mixed.T], [mixed, stiffness]])


def change(at, v, step):
    """Move a node, and change its value and those of its edges."""
    at.mesh.position[v] += step[:3]
    at.trial.value[v] += step[3]
    pairs = np.sort(at.mesh.elements.node[:, PAIRS], axis=2)
    for end, more in zip(at.ends, step[4:], strict=True):
        at.descent.modes.side[np.all(pairs == np.sort([v, end]), axis=2), 0] += more


SAME_STARS = "varying", "wall", "corner", "curved"  # where free nodes have the stars of other cases


@pytest.mark.parametrize("name", [name for name in CASES if not name.startswith(SAME_STARS)])
def test_derivatives_are_those_of_the_functional(name):
    _, at = started(name)
    number, laws = at.freedom().number, "laws" in name or CASES[name][2] == TABLE
    at.arrays = KernelMesh(
        at.mesh.position,
        at.mesh.elements,
        at.descent.opened.star(),
        Constraints(at.freedom(), at.mesh.surfaces, number == INSIDE),
    )
    at.ends, free = (), np.flatnonzero((number == INSIDE) & (at.mesh.pool.anchor >= 0))
    for v in free[[0, len(free) // 2] if name.endswith("1") else [len(free) // 2]]:
        gradient, hessian = told(at, v)
        ways = np.vstack([np.eye(4, len(gradient)), np.random.default_rng(v).normal(size=(3, len(gradient)))])
        size = np.abs(at.mesh.position[at.mesh.elements.node[:, 0]]).max() * 1e-5
        for way in ways / np.linalg.norm(ways, axis=1)[:, None]:
            values, slopes = [], []
            for step in (size, -2.0 * size):
                change(at, v, step * way)
                values.append(at.value())
                slopes.append(told(at, v)[0])
            change(at, v, size * way)
            by = (values[0] - values[1]) / (2.0 * size)
            assert way @ gradient == pytest.approx(by, abs=1e-5 * np.abs(gradient).max())
            second = (slopes[0] - slopes[1]) / (2.0 * size)
            assert hessian @ way == pytest.approx(second, abs=(2e-3 if laws else 1e-5) * np.abs(hessian).max())


def at_corner(mesh, width, place):
    return np.exp(-width * ((mesh.p - place) ** 2).sum(axis=0))


@pytest.mark.parametrize("curved", [False, True], ids=["linear", "not linear"])
def test_given_values_stay_what_they_are(curved):
    """Where they are linear along a face of the cube nodes may leave it; where they are not, all of it stays."""
    mesh = box(5)
    left = mesh.p[0] == 0.0
    given = 2.0 * mesh.p[1] - mesh.p[2] + curved * mesh.p[1] ** 2
    at = Start(mesh, ka.Ritz(given + np.where(left, 0.0, at_corner(mesh, 60.0, 0.75)), left, 1.0))
    for _ in range(3):
        at.swap()
        at.recycle()
    found, values, fixed = at.handed_back()
    assert np.array_equal(fixed, found.p[0] == 0.0)
    y, z = found.p[1:, fixed]
    assert values[fixed] == pytest.approx(2.0 * y - z + curved * y**2, abs=1e-14)
    faces = [
        {tuple(sorted(map(tuple, m.p[1:, f].T.tolist()))) for f in m.facets.T if np.all(m.p[0, f] == 0.0)}
        for m in (mesh, found)
    ]
    assert (faces[0] == faces[1]) == curved


@pytest.mark.parametrize("price", [0.0, 2.0], ids=["free", "dear"])
@pytest.mark.parametrize("between", [False, True], ids=["inside", "between regions"])
def test_the_removal_of_an_edge_makes_the_best_of_all_triangulations(between, price):
    """At order 2: of those that leave good elements, each with its edges at their best, and edges more at a price."""
    _, at = started("linear 2", 3)
    at.recycle()
    noise = np.random.default_rng(1).normal(size=len(at.trial.value))
    at.trial.value[:] += 0.5 * np.ptp(at.trial.value) * np.where(at.trial.fixed, 0.0, noise)
    mesh, (trial, quadratic), seconds = at.mesh, at.descent.function(), []
    for e, edge in np.ndindex(len(mesh.elements.node), 6):
        queue = Queue.of(len(mesh.elements.node))
        a, b, rings = interpreted(swap.shells_around)(mesh, queue, e, edge)
        longest = max(rings[0], rings[2])
        if not 3 < longest <= swap_order2.LONGEST or (rings[2] > 0) != between or (rings[4] >= 0) != between:
            continue
        floor, found = min(FLOOR**3, interpreted(swap.add_shells)(mesh, rings)), []
        count = rings[1] + rings[3]
        _, now, _ = interpreted(swap_order2.energy_of_old)(mesh, quadratic, mesh.cavity.old, count, a, b)
        for first, second in np.ndindex(swap_order2.COUNTS[rings[0]], swap_order2.COUNTS[rings[2]]):
            new = interpreted(swap_order2.write_rings)(mesh, a, b, rings, first, second)
            if interpreted(swap_order2.are_above)(mesh, new, floor):
                known = interpreted(swap_order2.list_edges)(mesh, quadratic, count)
                energy, edges = interpreted(swap_order2.energy_of_rings)(mesh, quadratic, known, new, a, b, rings)
                found.append((now - energy, edges - known - 1, second))
        charge = price * max((abs(fall) for fall, *_ in found), default=0.0)
        is_open, rule = np.ones(len(mesh.surfaces.shape), dtype=bool), (np.inf, FLOOR**3, charge)
        made, gain = interpreted(swap.remove_edge)(mesh, trial, quadratic, queue, is_open, rule, e, edge)
        if made:
            fall, added, second = max(found, key=lambda each: each[0] - charge * each[1])
            assert gain == pytest.approx(fall, rel=1e-9) and fall > charge * added
            seconds.append(second)
        if len(seconds) > 8:
            break
    assert any(seconds) == between if price == 0.0 else bool(seconds) != between  # of two rings at least an edge more


@pytest.mark.parametrize("name", ["linear 1", "laws 1"])
def test_a_split_has_the_derivatives_of_its_functional(name):
    _, at = started(name)
    node, step = at.mesh.elements.node, 1e-5 * np.ptp(at.trial.value)
    for a, b in node[5:100:19, :2]:
        shell = np.flatnonzero(np.isin(node, [a, b]).sum(axis=1) == 2)

        def split(w, shell=shell, a=a, b=b):
            return interpreted(split_parabola)(at.mesh, at.trial, shell, len(shell), a, b, w)[1:4]

        _, slope, stiffness = split(100.0 * step)
        ends = [split((100.0 + side) * step) for side in (-1.0, 1.0)]
        by_value, by_slope = (np.diff(each)[0] / (2.0 * step) for each in list(zip(*ends, strict=True))[:2])
        assert (slope, stiffness) == (pytest.approx(by_value, rel=1e-5), pytest.approx(by_slope, rel=2e-3))


@pytest.mark.parametrize("name", [name for name in CASES if not name.startswith(("driven 2", "curved"))])
def test_the_value_is_that_of_the_functional(name):
    """Which `tests/problem/test_functional_value.py` compares with closed forms."""
    build, ritz_on, _ = CASES[name]
    mesh = build(1)
    ritz = ritz_on(mesh, np.random.default_rng(1))
    assert Start(mesh, ritz).value() == pytest.approx(functional_value(mesh, ritz), rel=1e-8)
