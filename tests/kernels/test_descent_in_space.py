"""Energy descent of tetrahedra, kernel by kernel: derivatives by differences, sweeps against a slow twin."""

import numpy as np
import pytest
from helpers.boxes import jittered, opened
from helpers.functions_in_space import plain
from helpers.slow_solids import functional

from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    LOAD,
    OFFSET,
    ON_PATCH,
    ON_RIDGE,
    POSITION,
    SOURCE_24TH,
    VALUE,
    Constraints,
    Star,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.geometry import fill_star
from kohonen_adapt.kernels.tetrahedron.polish.descend import (
    descend_nodes,
)
from kohonen_adapt.kernels.tetrahedron.polish.energy import element_energy
from kohonen_adapt.kernels.tetrahedron.polish.star import derivatives
from kohonen_adapt.polishing.energy_tables import tabulated

derivatives = interpreted(derivatives)

FLOOR = 0.2


class Brauer:
    """H = (100 + 50 exp(b)) b, which rises fast."""

    def field_strength(self, b):
        return (100.0 + 50.0 * np.exp(b)) * b

    def energy(self, b):
        return 50.0 * b**2 + 50.0 * ((b - 1.0) * np.exp(b) + 1.0)


class Setting:
    """A box of two regions with a functional of each, and the arrays of the kernels; values are given by `given`.

    `given` is True where values along the face x = 0 are given by a linear function. Laws have a shift. With `surface`
    the second region has an offset, and held nodes have a load.
    """

    def __init__(self, seed, cells=(4, 3, 3), laws=(None, None), given=True, load=1.0, steep=3.0, surface=False):
        rng = np.random.default_rng(seed)
        position, node = jittered(cells, 0.3, seed)
        region = (position[node, 0].mean(axis=1) > 0.5).astype(np.int32)
        self.mesh, self.node, self.nodes = opened(position, node, region), node, len(position)
        self.constants = np.column_stack([10.0 ** rng.uniform(-1, 1, 2), load * rng.normal(size=(2, 4))])
        shift = np.random.default_rng(seed + 1).normal(size=(2, 3))
        self.constants = np.hstack([self.constants, shift, [[0.0], [1.0]]])
        self.data, self.laws = self.constants[region], [laws[r] for r in region]
        self.slope, rows = np.array([0.0, 1.5, -0.5]), len(self.mesh.position)
        value, fixed = steep * rng.normal(size=rows), np.zeros(rows, dtype=bool)
        if given:
            fixed[: self.nodes] = position[:, 0] == 0.0
            value[fixed] = (self.mesh.position @ self.slope)[fixed]
        surfaces = self.mesh.surfaces
        rate = np.tile(self.slope, (len(surfaces.shape) + len(surfaces.ridge_shape), 1))
        distinct = [law for law in laws if law is not None]
        tables = tabulated(distinct, 60.0)
        number = np.array([-1 if law is None else distinct.index(law) for law in laws], dtype=np.int32)
        data = self.constants / np.array([12.0, 24.0, 6.0, 6.0, 6.0, 1.0, 1.0, 1.0, 1.0])
        laws, no_source, nodal = Laws(number, tables.first, tables.energy), np.zeros((0, 2)), np.zeros((0, 2))
        if surface:
            nodal = steep * rng.normal(size=(rows, 2))
            nodal[self.mesh.freedom.number != HELD, LOAD] = 0.0
        self.trial = Trial(value, fixed, data, laws, rate, *plain(self.mesh), no_source, nodal)
        star = Star.of(rows, len(self.mesh.elements.node))
        fill_star(self.mesh.elements.node, star)
        freedom = self.mesh.freedom
        constraints = Constraints(freedom, surfaces, freedom.number == INSIDE)
        self.neurons = KernelMesh(self.mesh.position, self.mesh.elements, star, constraints)

    @property
    def arrays(self):
        return self.mesh.position, self.node, self.data, self.trial.value

    @property
    def offset(self):
        return self.trial.surface[:, OFFSET] if len(self.trial.surface) else None

    def value(self):
        work = self.trial.surface[:, LOAD] @ self.trial.value if len(self.trial.surface) else 0.0
        return functional(*self.arrays, self.laws, self.offset) - work

    def size(self):
        """The sum of magnitudes that the functional is made of."""
        told, rows = interpreted(element_energy), zip(self.mesh.elements.region, self.node, strict=False)
        load = self.trial.data[:, SOURCE_24TH]
        return sum(told(self.mesh.position, self.trial, r, load[r], *corners)[1] for r, corners in rows)

    def sweep(self, order=None):
        order = np.arange(self.nodes) if order is None else order
        return descend_nodes(self.neurons, self.trial, None, order.astype(np.int32), FLOOR**3)

    def axes(self):
        """What every node may do, and the gradient of its value where that is given."""
        freedom, surfaces, axes, rates = self.mesh.freedom, self.mesh.surfaces, [], []
        for v in range(self.nodes):
            number, place = freedom.number[v], freedom.place[v]
            span = {HELD: np.zeros((3, 0)), INSIDE: np.eye(3)}.get(int(number))
            if number == ON_PATCH:
                span = np.eye(3)[:, surfaces.axis[place] == 0.0]
            elif number == ON_RIDGE:
                span = surfaces.ridge_axis[place][:, None]
            axes.append(span)
            rates.append(self.slope if self.trial.fixed[v] else None)
        return axes, rates


def star_value(at, v, d, laws=None):
    """The functional of the star of v, moved by d[:3], its value changed by d[3]."""
    position, values = at.mesh.position.copy(), at.trial.value.copy()
    position[v] += d[:3]
    values[v] += d[3]
    star = (at.node == v).any(axis=1)
    laws = [at.laws[e] for e in np.flatnonzero(star)]
    return functional(position, at.node[star], at.data[star], values, laws, at.offset)


def own_derivatives(at, v):
    """Gradient (4,) and Hessian (4, 4) of the kernel."""
    at_place = tuple(at.mesh.position[v]), 0.0, 0.0, POSITION
    _, slope, by_w, (xx, xy, xz, yy, yz, zz), mixed, ww = derivatives(at.neurons, at.trial, v, *at_place)
    hessian = np.zeros((4, 4))
    hessian[:3, :3] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    hessian[:3, 3] = hessian[3, :3] = mixed
    hessian[3, 3] = ww
    return np.array([*slope, by_w]), hessian


def inside(at):
    return np.flatnonzero(at.mesh.freedom.number[: at.nodes] == INSIDE)


@pytest.mark.parametrize("surface", [False, True])
@pytest.mark.parametrize("laws", [(None, None), (Brauer(), None)], ids=["linear", "nonlinear"])
def test_derivatives_equal_differences(laws, surface):
    at, near = Setting(0, laws=laws, steep=0.2, surface=surface), 2e-7 if laws[0] is None else 2e-6
    for v in inside(at):
        gradient, hessian = own_derivatives(at, v)
        h = 1e-5
        by = [(star_value(at, v, h * e) - star_value(at, v, -h * e)) / (2.0 * h) for e in np.eye(4)]
        np.testing.assert_allclose(gradient, by, atol=near * np.abs(gradient).max())

        def slope(d, v=v):
            before, own = at.mesh.position[v].copy(), at.trial.value[v]
            at.mesh.position[v], at.trial.value[v] = before + d[:3], own + d[3]
            found = own_derivatives(at, v)[0]
            at.mesh.position[v], at.trial.value[v] = before, own
            return found

        by = [(slope(h * e) - slope(-h * e)) / (2.0 * h) for e in np.eye(4)]
        near_second = 2e-7 if laws[0] is None else 2e-3  # a table has its second derivatives to first order
        np.testing.assert_allclose(hessian, by, atol=near_second * np.abs(hessian).max())


@pytest.mark.parametrize("surface", [False, True])
def test_a_star_is_told_for_every_place_and_value(surface):
    at = Setting(1, laws=(Brauer(), None), surface=surface)
    v, d = inside(at)[1], np.array([0.01, -0.02, 0.015, 0.3])
    moved, still = star_value(at, v, d), star_value(at, v, np.zeros(4))

    def told(d):
        return derivatives(at.neurons, at.trial, v, tuple(at.mesh.position[v] + d[:3]), d[3], 0.0, VALUE)

    own = told(d), told(np.zeros(4))
    assert own[0][0][1] - own[1][0][1] == pytest.approx(moved - still, rel=1e-8)
    h = 1e-5
    ahead, behind = (told(np.array([0.0, 0.0, 0.0, s * h]))[0][1] for s in (1, -1))
    assert (ahead - behind) / (2 * h) == pytest.approx(own[1][2], rel=1e-6)
    assert own[1][0][2] == derivatives(at.neurons, at.trial, v, tuple(at.mesh.position[v]), 0.0, 0.0, POSITION)[0][2]


def test_a_source_by_node_and_one_by_region_of_the_same_value_move_nodes_alike():
    one, other = Setting(2), Setting(2)
    load = one.trial.data[:, SOURCE_24TH]
    other.trial = other.trial._replace(source=np.tile(load, (len(one.mesh.position), 1)))
    other.trial.data[:, SOURCE_24TH] = 0.0
    assert one.sweep() == other.sweep()
    np.testing.assert_array_equal(one.mesh.position, other.mesh.position)
    np.testing.assert_array_equal(one.trial.value, other.trial.value)


def test_nodes_that_are_held_have_their_best_value_and_given_ones_keep_theirs():
    at = Setting(5)
    at.mesh.freedom.number[:] = HELD
    before = at.trial.value.copy()
    for _ in range(2000):
        at.sweep()
    free = ~at.trial.fixed[: at.nodes]
    gradients = np.array([own_derivatives(at, v)[0][3] for v in np.flatnonzero(free)])
    assert np.abs(gradients).max() < 1e-9 * at.size()
    np.testing.assert_array_equal(at.trial.value[at.trial.fixed], before[at.trial.fixed])
