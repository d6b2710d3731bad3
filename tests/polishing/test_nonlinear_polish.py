"""The polish of nonlinear material: tables of laws, stars against slow twins, and a functional that never rises."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.alternatives import functional, size_of_functional, slow_descent, star_derivatives
from helpers.examples import examples
from helpers.meshes import areas_of, generic_square, inset, junction, perturbed, square
from helpers.steel import STEEL
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.functionals import Laws, energy_density
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, SLIDING, WITH, WITHOUT
from kohonen_adapt.kernels.triangle.flip import flip_edge
from kohonen_adapt.kernels.triangle.polish import affine
from kohonen_adapt.kernels.triangle.polish.descend import LEAST_CURVATURE, OVERSTEP
from kohonen_adapt.kernels.triangle.polish.flips import gain_of_flip
from kohonen_adapt.kernels.triangle.polish.linear import around, derivatives
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Magnetostatics, Material, Table, radial
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.energy_tables import tabulated
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value

derivatives, flip_edge, gain_of_flip, around, energy_density = (
    interpreted(loop) for loop in (derivatives, flip_edge, gain_of_flip, around, energy_density)
)

LAWS = {
    "Brauer": Brauer(100.0, 10.0, 1.8),
    "Froehlich": Froehlich(4000.0, 2.1),
    "Arctan": Arctan(2000.0, 1.9),
    "Table": Table(STEEL),
}
each_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
FLOOR, TABLE = 0.3, 1e-10  # of an energy: what tables leave out


class Straight:
    """H = c b: linear material that is given as a law."""

    def __init__(self, coefficient):
        self.coefficient = coefficient

    def field_strength(self, b):
        return self.coefficient * b

    def slope(self, b):
        return self.coefficient + 0.0 * b

    def energy(self, b):
        return 0.5 * self.coefficient * b**2


class Cubic(Straight):
    """H = c (b + b^3): W is quadratic in b^2, so that the table leaves nothing out."""

    def field_strength(self, b):
        return self.coefficient * (b + b**3)

    def slope(self, b):
        return self.coefficient * (1.0 + 3.0 * b**2)

    def energy(self, b):
        return self.coefficient * (0.5 * b**2 + 0.25 * b**4)


# --- tables ----------------------------------------------------------------------------------------------------


@each_law
@pytest.mark.parametrize("largest", [1e-3, 1.0, 2.0, 5.0])
def test_tables_hold_energies_and_their_rates(law, largest):
    tables = tabulated([law], largest)
    laws = Laws(np.zeros(1, dtype=np.int32), tables.first, tables.energy)
    b = largest * np.concatenate([np.geomspace(1e-8, 1.0, 300), np.linspace(0.1, 1.5, 3001)])
    energy, rate, bend = np.array([energy_density(laws, 0, s) for s in b**2]).T
    whole = float(law.energy(np.float64(largest)))
    # a step that a table of points bends in is the exception; what counts is what they sum up to
    np.testing.assert_allclose(energy, law.energy(b), rtol=100 * TABLE, atol=TABLE * whole)
    assert abs(np.sum(energy - law.energy(b))) < TABLE * np.sum(law.energy(b))
    np.testing.assert_allclose(rate, law.field_strength(b) / (2 * b), rtol=1e-4)
    assert np.all(rate + 2 * b**2 * bend > 0.0)  # the field strength rises


def test_beyond_a_table_the_energy_is_smooth_and_convex():
    tables = tabulated([LAWS["Brauer"]], 1.0)
    laws = Laws(np.zeros(1, dtype=np.int32), tables.first, tables.energy)
    for end in (2.0 ** (tables.first - 1), 2.0 ** (tables.first + 35)):
        below, above = (energy_density(laws, 0, end * (1 + side)) for side in (-1e-12, 1e-12))
        assert below[0] == pytest.approx(above[0], rel=1e-10) and below[1] == pytest.approx(above[1], rel=1e-9)
    assert energy_density(laws, 0, 0.0)[0] == 0.0
    s = 2.0 ** np.arange(tables.first - 20.0, tables.first + 80.0)
    assert np.all(np.diff([energy_density(laws, 0, each)[1] for each in s]) >= 0.0)


class Falling(Straight):
    """Beyond 1 / 2 of what the solution has."""

    def field_strength(self, b):
        return b * np.where(b < 0.5, 1.0, 0.3)

    def energy(self, b):
        return np.where(b < 0.5, 0.5 * b**2, 0.15 * b**2 + 0.0875)


class Halved(Straight):
    """An energy that somebody forgot the half of."""

    def energy(self, b):
        return 2.0 * super().energy(b)


class Single(Straight):
    """One number for all b."""

    def energy(self, b):
        return 1.0


class Coarse(Cubic):
    """An energy from a table of a hundred points."""

    def energy(self, b):
        ticks = np.linspace(0.0, 2.0, 101)
        return np.interp(b, ticks, super().energy(ticks))


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Falling(1.0), r"a field strength that increases with b, and an energy .*; .* violates this near b = 0\.49"),
        (
            Halved(1.0),
            "laws of Ritz must have a field strength that increases with b, and an energy that is the integral of",
        ),
        (Straight(-1.0), "must have a field strength that increases with b"),
        (Straight(np.nan), "laws of Ritz must be finite up to b = "),
        (
            Single(1.0),
            r"must return arrays of the shape of b, .*; .* returned \(\d+,\) as field strength and \(\) as energy\.",
        ),
    ],
)
def test_wrong_laws_are_refused(law, message):
    with pytest.raises(ValueError, match=message):
        tabulated([law], 1.0)


def test_an_energy_may_come_from_a_coarser_table():
    law = Coarse(1.0)
    tables = tabulated([law], 1.0)
    laws = Laws(np.zeros(1, dtype=np.int32), tables.first, tables.energy)
    assert energy_density(laws, 0, 0.7)[0] == pytest.approx(law.energy(np.sqrt(0.7)), rel=1e-3)


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        (Straight(1.0), "laws of Ritz must be a sequence with None or a law per region number; got <"),
        ([None], "laws of Ritz must have None or a law for each of 2 region numbers; got 1"),
        (
            [None, 1000.0],
            r"laws\[1\] of Ritz must be None or have the methods field_strength\(b\) and energy",
        ),
    ],
)
def test_what_is_no_law_is_refused(laws, message):
    with pytest.raises(ValueError, match=message):
        ka.Ritz(np.zeros(4), np.zeros(4, dtype=bool), 1.0, region=[0, 1], laws=laws)


# --- stars -----------------------------------------------------------------------------------------------------


class Setting:
    """A mesh with saturated laws in some regions, and the arrays of the kernels; unit coefficients elsewhere."""

    def __init__(self, mesh, seed, law, fixed=None, values=None, load=1.0):
        rng = np.random.default_rng(seed)
        movable = MovableMesh.of(mesh, Rules())
        self.tri, self.outline = movable.triangulation, movable.outline
        n, region = self.tri.nnodes, self.tri.elements.region
        count = region.max() + 1
        laws = [law if number == 0 or rng.random() < 0.4 else None for number in range(count)]
        self.ritz = ka.Ritz(
            rng.normal(size=n) / 3.0 if values is None else values,
            np.isin(np.arange(n), mesh.boundary_nodes()) if fixed is None else fixed,
            1e3 * 10.0 ** rng.uniform(-1.0, 1.0, count),
            1e3 * load * rng.normal(size=count),
            1e3 * load * rng.normal(size=(2, count)),
            region,
            laws,
        )
        self.data = np.column_stack([self.ritz.coefficient, self.ritz.source, self.ritz.flux.T])[region]
        self.laws = np.array(laws, dtype=object)[region]
        self.values, self.fixed = self.ritz.values.copy(), self.ritz.fixed.copy()
        self.functional = Functional.of(self.ritz, movable)
        self.constraints = self.outline.constraints._replace(kind=self.functional.kinds(self.outline, self.fixed))
        mesh = movable.kernel_mesh()._replace(constraints=self.constraints)
        loops = self.functional.loops(movable, TrialFunction(self.values, self.fixed, None), mesh)
        self.descents = loops.scratch(0)
        self.trial = self.descents.primal.trial

    @property
    def arrays(self):
        return self.tri.position, self.tri.elements.node, self.data, self.values

    def exact(self):
        return functional(*self.arrays, self.laws)

    def size(self):
        return size_of_functional(*self.arrays, self.laws)

    def sweep(self):
        order = np.arange(self.tri.nnodes)
        return affine.descend_nodes(self.descents, order, FLOOR)

    def flips(self):
        every = np.ones(len(self.tri.elements.node), dtype=np.bool_)
        decrease, count = affine.descend_flips(self.descents, FLOOR, every, 0, len(every), False)
        self.tri.refill_star()
        return decrease, count


MESHES = {
    "generic": lambda: generic_square(6),
    "regions": lambda: perturbed(inset(8), 1),
    "junction": lambda: perturbed(junction(6), 2),
}
each_mesh = pytest.mark.parametrize("build", MESHES.values(), ids=MESHES)


@each_law
def test_the_functional_equals_the_sum_over_the_elements(law):
    mesh = MESHES["regions"]()
    at = Setting(mesh, 0, law)
    assert functional_value(mesh, at.ritz) == pytest.approx(at.exact(), rel=1e-12)


@each_mesh
@pytest.mark.parametrize("law", [*LAWS.values(), Straight(2e3), Cubic(2e3)], ids=[*LAWS, "straight", "cubic"])
def test_derivatives_equal_the_chain_rule(build, law):
    at = Setting(build(), 1, law)
    for v in np.flatnonzero(at.outline.constraints.kind == FREE):
        _, _, (bx, by), bw, (xx, xy, yy), (xw, yw), ww = derivatives(at.tri.position, at.tri.star, at.trial, v)
        gradient, hessian = star_derivatives(*at.arrays, v, at.laws)
        np.testing.assert_allclose([bx, by, bw], gradient, atol=1e-6 * np.abs(gradient).max())
        # the curvature along the gradient is that of a step of the table, which may be a bend
        near = 1e-9 if isinstance(law, Straight) else 0.2
        near *= np.abs(hessian).max()
        np.testing.assert_allclose([[xx, xy, xw], [xy, yy, yw], [xw, yw, ww]], hessian, atol=near)


def test_the_chain_rule_equals_differences():
    at = Setting(generic_square(4), 2, LAWS["Brauer"])
    position, node, data, values = at.arrays
    v = np.flatnonzero(at.outline.constraints.kind == FREE)[0]

    def moved(z):
        p, u = position.copy(), values.copy()
        p[v] += z[:2]
        u[v] += z[2]
        return p, node, data, u

    gradient, hessian = star_derivatives(*at.arrays, v, at.laws)
    for k in range(3):
        h = 1e-6 * np.eye(3)[k]
        difference = functional(*moved(h), at.laws) - functional(*moved(-h), at.laws)
        assert difference / 2e-6 == pytest.approx(gradient[k], rel=1e-5, abs=1e-6 * np.abs(gradient).max())
        change = star_derivatives(*moved(h), v, at.laws)[0] - star_derivatives(*moved(-h), v, at.laws)[0]
        np.testing.assert_allclose(change / 2e-6, hessian[k], rtol=1e-4, atol=1e-6 * np.abs(hessian).max())


@each_mesh
@each_law
def test_a_star_knows_what_a_move_and_a_value_do_to_the_whole(build, law):
    at, rng = Setting(build(), 3, law), np.random.default_rng(3)
    constraints = at.outline.constraints
    for v in np.flatnonzero(constraints.kind != HELD):
        way = 1e-3 * rng.normal(size=2)
        if constraints.kind[v] == SLIDING:
            way = 1e-3 * constraints.chains.direction[constraints.own_chain[v]]
        before = at.exact()
        star, w = (at.tri.position, at.tri.star, at.trial, v), 0.1 * rng.normal()
        now = around(*star[:3], WITH, v, at.tri.position[v], 0.0)[1]
        assert now == pytest.approx(derivatives(*star)[1], rel=1e-10, abs=1e-12 * abs(before))
        there = *star[:3], WITH, v, at.tri.position[v] + way
        _, c, r, k = around(*there, w)
        low, high = (around(*there, w + d)[1] for d in (-1e-5, 1e-5))
        assert (high - low) / 2e-5 == pytest.approx(r, rel=1e-3, abs=1e-5 * k)
        at.tri.position[v] += way
        at.values[v] += w
        assert at.exact() - before == pytest.approx(c - now, rel=1e-9, abs=TABLE * abs(before))
        at.tri.position[v] -= way
        at.values[v] -= w


@each_mesh
@pytest.mark.parametrize("load", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("law", [Straight(2e3), Cubic(500.0)], ids=["straight", "cubic"])
def test_a_sweep_equals_its_slow_twin(build, load, law):
    mesh = build()
    x, y = mesh.p
    fixed, smooth = (x == 0) | (x == 1), x + y - 3 * x * y + 0.2 * np.sin(9 * x * y)
    at = Setting(mesh, 4, law, values=np.where(fixed, np.where(x == 0, y, 1 - 2 * y), smooth), fixed=fixed, load=load)
    constraints, chain = at.constraints, at.constraints.own_chain
    axes, rates = [None] * at.tri.nnodes, [None] * at.tri.nnodes
    for v in range(at.tri.nnodes):
        if constraints.kind[v] == FREE:
            axes[v] = np.eye(2)
        elif constraints.kind[v] == SLIDING:
            axes[v] = constraints.chains.direction[chain[v]][:, None]
            rates[v] = at.functional.on_chain[chain[v], 1] if at.fixed[v] else None
        elif not at.fixed[v]:
            axes[v] = np.zeros((2, 0))
    twin = slow_descent(*at.arrays, axes, rates, FLOOR, OVERSTEP, LEAST_CURVATURE, at.laws)
    assert at.sweep() == pytest.approx(twin[2], rel=1e-7)
    assert twin[2] > 0
    np.testing.assert_allclose(at.tri.position, twin[0], atol=1e-8)
    np.testing.assert_allclose(at.values, twin[1], atol=1e-8)


@given(
    seed=st.integers(0, 10**6),
    load=st.floats(0, 100),
    name=st.sampled_from(sorted(MESHES)),
    law=st.sampled_from(sorted(LAWS)),
)
@examples(40)
def test_every_sweep_and_every_flip_lowers_the_functional_by_what_it_says_or_more(seed, load, name, law):
    at = Setting(MESHES[name](), seed, LAWS[law], load=load)
    for _ in range(2):
        before, size = at.exact(), at.size()
        gain = at.sweep()
        after = at.exact()
        rounding = TABLE * (size + at.size())
        assert gain >= 0.0
        assert after <= before - gain + rounding
        decrease, flips = at.flips()
        assert at.exact() == pytest.approx(after - decrease, abs=rounding)
        assert (decrease > 0.0) == (flips > 0)


@each_law
def test_a_uniform_field_moves_nothing(law):
    mesh = perturbed(generic_square(6), 1)
    at = Setting(mesh, 0, law, values=1.5 * mesh.p[0] - mesh.p[1], load=0.0)
    before = at.tri.position.copy()
    assert at.sweep() == 0.0 and at.flips() == (0.0, 0)
    np.testing.assert_array_equal(at.tri.position, before)


@each_law
def test_a_flip_gains_what_the_functional_loses(law):
    at = Setting(perturbed(inset(8), 5), 5, law)
    elements, gained = at.tri.elements, 0
    for e, k in zip(*np.nonzero((elements.neighbour >= 0) & (elements.chain < 0)), strict=True):
        with np.errstate(divide="ignore"):  # a flip may leave no area
            gain = gain_of_flip(at.descents, WITHOUT, e, k, elements.neighbour[e, k])
        saved = [array.copy() for array in elements]
        before = at.exact()
        flip_edge(elements, e, k)
        if areas_of(at.tri).min() > 0:
            assert max(0.0, before - at.exact()) == pytest.approx(gain, rel=1e-7, abs=TABLE * abs(before))
            gained += gain > 0
        else:
            assert gain == 0.0
        for array, old in zip(elements, saved, strict=True):
            array[:] = old
    assert gained > 5


# --- magnetostatics --------------------------------------------------------------------------------------------


def blocks(n, seed=None):
    """A block of iron beside a conductor in a square of air; their sides are among those of 16 n squares."""
    mesh = square(n)
    mesh = mesh.with_subdomains(
        {
            "iron": lambda x: (np.abs(x[0] - 0.375) < 0.125) & (np.abs(x[1] - 0.5) < 0.25),
            "coil": lambda x: (np.abs(x[0] - 0.6875) < 0.0625) & (np.abs(x[1] - 0.5) < 0.125),
        }
    )
    rest = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    mesh = mesh.with_subdomains({"air": rest}).with_boundaries({"outer": lambda x: x[0] > -1})
    return mesh if seed is None else perturbed(mesh, seed)


def problem_of(iron, current_density=3e7):
    coil = Material(current_density=current_density)
    return Magnetostatics({"iron": iron, "coil": coil, "air": Material()}, {"outer": 0.0}, order=1)


def functional_of(problem, mesh):
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


@given(
    law=st.sampled_from(sorted(LAWS)),
    n=st.sampled_from([16, 24]),
    seed=st.sampled_from([None, 0, 1, 2]),
    current_density=st.sampled_from([1e3, 1e6, 1e7, 3e7, 1e9]),
    topology=st.sampled_from(["flip", "fixed"]),
    sweeps=st.integers(1, 12),
)
@examples(25)
def test_the_functional_of_the_next_solution_has_not_grown(law, n, seed, current_density, topology, sweeps):
    mesh, problem = blocks(n, seed), problem_of(Material(bh=LAWS[law]), current_density)
    result = ka.polish(mesh, problem, topology=topology, sweeps=sweeps)
    before, after = functional_of(problem, mesh), functional_of(problem, result)
    assert after < before + TABLE * abs(before)
    assert ka.quality(result).min() >= min(0.3, ka.quality(mesh).min()) - 1e-12


def test_magnetostatics_says_what_nonlinear_material_minimises():
    """The solution is where it is least, magnets with curves included."""
    mesh = blocks(16, 0)
    magnet = Material(bh=Table([(0.5, 3.58e5), (1.0, 7.4e5), (1.4, 10.5e5)]), remanence=(0.3, 1.1))
    for iron in (Material(bh=STEEL), magnet):
        problem = problem_of(iron)
        field = problem.solve(mesh)
        ritz = problem.ritz(mesh, field)
        least = functional_value(mesh, ritz)
        assert ritz.laws.count(None) == 2
        way = np.where(ritz.fixed, 0.0, np.random.default_rng(0).normal(size=mesh.p.shape[1]))
        way *= 1e-4 * np.abs(field.potential).max()
        up, down = (functional_value(mesh, replace(ritz, values=field.potential + sign * way)) for sign in (1, -1))
        assert up > least and down > least
        assert up - least == pytest.approx(down - least, rel=1e-2)


def test_a_linear_law_is_polished_like_linear_material():
    mesh = blocks(16, 3)
    problem = problem_of(Material(1000.0))

    class ByLaw:
        def solve(self, mesh):
            return problem.solve(mesh)

        def ritz(self, mesh, field):
            given = problem.ritz(mesh, field)
            laws = [Straight(c) for c in given.coefficient]
            return ka.Ritz(given.values, given.fixed, 1.0, given.source, given.flux, given.region, laws)

    for topology in ("flip", "fixed"):
        one, other = (ka.polish(mesh, each, topology=topology) for each in (problem, ByLaw()))
        assert np.abs(one.p - mesh.p).max() > 0.01
        np.testing.assert_allclose(other.p, one.p, atol=1e-8)
        np.testing.assert_array_equal(other.t, one.t)


def test_nonlinear_material_compiles_nothing_that_linear_has_not():
    mesh, compiled = blocks(16), (affine.descend_nodes, affine.descend_flips)
    ka.polish(mesh, problem_of(Material(1000.0)), sweeps=1)
    before = [len(kernel.signatures) for kernel in compiled]
    ka.polish(mesh, problem_of(Material(bh=STEEL)), sweeps=1)
    assert [len(kernel.signatures) for kernel in compiled] == before


def test_magnets_that_turn_inside_nonlinear_material_are_polished():
    law = Table([(0.5, 3.58e5), (1.0, 7.4e5), (1.4, 10.5e5)])
    problem = problem_of(Material(bh=law, remanence=radial(1.0)))
    result = ka.adapt(blocks(8), problem, passes=1)
    assert "polish" not in result.message
    assert 0.0 < result.history[1].polish_gain < result.history[0].functional - result.history[1].functional


# --- the loop --------------------------------------------------------------------------------------------------


def c_core(n):
    """A quarter of a frame of iron with two gaps and a coil inside; flux crosses the lower side at a right angle."""
    ticks = np.linspace(0.0, 1.0, n + 1)
    mesh = MeshTri.init_tensor(ticks, ticks)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    frame = (np.maximum(x, y) < 0.75) & (np.maximum(x, y) > 0.5) & ~((x > 0.5) & (y < 0.125))
    coil = (x > 0.25) & (x < 0.5) & (y < 0.375)
    parts = {"iron": frame, "coil": coil, "air": ~frame & ~coil}
    mesh = mesh.with_subdomains({name: np.flatnonzero(inside) for name, inside in parts.items()})
    return mesh.with_boundaries({"outer": lambda x: (x[0] == 1) | (x[1] == 1) | (x[0] == 0)})


def test_the_polish_lowers_the_error_of_a_saturated_core_more_than_the_map_alone():
    problem, mesh = problem_of(Material(bh=STEEL), 2e7), c_core(24)
    with_polish, without = (ka.adapt(mesh, problem, passes=3, polish=polish) for polish in (True, False))
    iron = mesh.subdomains["iron"]
    assert np.median(np.hypot(*problem.solve(mesh).flux_density[:, iron])) > 1.6
    least = functional_of(problem, with_polish.mesh.refined(3))
    start, polished, moved = (functional_of(problem, each) - least for each in (mesh, with_polish.mesh, without.mesh))
    assert polished < 0.8 * moved and moved < 0.5 * start
    assert with_polish.history[-1].functional is not None and "No polish" not in with_polish.message
    values = [step.functional for step in with_polish.history]
    assert with_polish.mesh is with_polish.history[int(np.argmin(values))].mesh
