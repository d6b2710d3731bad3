"""The polish of elements with curved sides and around an axis: its derivatives, and what it says it takes off."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, MeshTri

from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, FREE, POSITION, UNKNOWNS, VALUE
from kohonen_adapt.kernels.triangle.polish import patch, rows
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
STEP = 1e-5


def square():
    mesh, rng = MeshTri.init_tensor(np.linspace(0.0, 1.0, 6), np.linspace(0.0, 1.0, 6)), np.random.default_rng(0)
    p = mesh.p.copy()
    p[:, mesh.interior_nodes()] += 0.03 * rng.normal(size=(2, len(mesh.interior_nodes())))
    return MeshTri(p, mesh.t)


def half_disk():
    disk = MeshTri.init_circle(2)
    half = disk.restrict(np.flatnonzero(disk.p[0, disk.t].mean(axis=0) > 0.0))
    return MeshTri(np.where(np.abs(half.p) < 1e-9, 0.0, half.p), half.t)


class Linked:
    """A law that is no straight line."""

    def field_strength(self, b):
        return b + b**3

    def energy(self, b):
        return 0.5 * b**2 + 0.25 * b**4


# mesh, order, around an axis, law
CASES = {
    "axis, P1": (square, 1, True, None),
    "axis, P1, nonlinear": (square, 1, True, Linked()),
    "axis, P2": (square, 2, True, None),
    "axis, P3": (square, 3, True, None),
    "curved, P2": (lambda: MeshTri.init_circle(2), 2, False, None),
    "curved, P2, nonlinear": (lambda: MeshTri.init_circle(2), 2, False, Linked()),
    "curved, P3": (lambda: MeshTri.init_circle(2), 3, False, None),
    "curved, P3, nonlinear": (lambda: MeshTri.init_circle(2), 3, False, Linked()),
    "curved around an axis, P2": (half_disk, 2, True, None),
}
each_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


class Setting:
    """A mesh that is curved where an outline is, and a function on it with a functional that has all of its terms."""

    def __init__(self, case, dual=False):
        build, order, around, law = case
        mesh = build()
        self.movable = MovableMesh.of(mesh, Rules().guarded(), order > 1)
        basis = Basis(mesh, ELEMENTS[order]())
        x, y = basis.doflocs
        fixed = np.isin(np.arange(basis.N), basis.get_dofs(mesh.boundary_facets()).all())
        bump = np.sin(3.0 * x + y) + 0.3 * np.cos(4.0 * y) + 1.0
        values = np.where(fixed, 0.0, bump * (x**2 if around else 1.0))
        laws = [law] if law else []
        self.ritz = Ritz(values, fixed, 2.0, 0.7, (0.3, -0.4), None, laws, order, around)
        if dual:
            other = Ritz(np.where(fixed, 0.0, np.cos(2.0 * x - 3.0 * y)), fixed, 2.0, -0.2, (-0.5, 0.1), order=order)
            self.ritz = replace(self.ritz, dual=other, share=0.4)
        self.mesh = self.movable.mesh() if self.movable.curved else mesh
        self.functional = Functional.of(self.ritz, self.movable, self.mesh)
        self.trial = self.functional.solution.copy()

    def value(self):
        return self.functional.value(self.movable.triangulation, self.trial, self.movable.midside_offsets())

    def torn(self):
        """The largest difference between the coefficients of a side in its two elements."""
        elements, side = self.movable.triangulation.elements, self.trial.modes.side
        e, k = np.nonzero(elements.neighbour >= 0)
        other = elements.neighbour[e, k]
        j = np.argmax(elements.neighbour[other] == e[:, None], axis=1)
        return np.abs(side[e, k] - np.array([1.0, -1.0])[: side.shape[2]] * side[other, j]).max(initial=0.0)


@each_case
def test_kernels_have_the_functional_and_its_derivatives(case):
    at = Setting(case)
    tri, movable = at.movable.triangulation, at.movable
    assert at.value() == pytest.approx(functional_value(at.mesh, at.ritz), rel=1e-12)
    scratch = at.functional.loops(movable, at.trial, movable.kernel_mesh()).scratch(0).primal
    loops = patch.derivatives, patch.number_unknowns, patch.change, rows.gather_star, rows.put_star
    derivatives, number, change, gather, put = map(interpreted, loops)
    special = np.unique(tri.elements.node[scratch.shapes.special])
    nodes = special[movable.constraints.kind[special] == FREE]
    beside_axis = [nodes[np.argmin(tri.position[nodes, 0])]] if case[2] else []
    for v in [*beside_axis, *([nodes[-1]] if movable.curved else [])]:
        gather(scratch, v)
        number(scratch, True)
        count, (x, y) = scratch.block.size[UNKNOWNS], tri.position[v].copy()

        def now(dx=0.0, dy=0.0, v=v, count=count, x=x, y=y):
            """The functional of the whole mesh, and what the kernel has of the star."""
            tri.position[v] = x + dx, y + dy
            star, value = derivatives(scratch, (x + dx, y + dy), POSITION), at.value()
            tri.position[v] = x, y
            block = scratch.block
            stiffness = np.tril(block.stiffness[:count, :count])
            whole = stiffness + np.tril(stiffness, -1).T
            return value, np.array(star[2]), block.rest[:count].copy(), block.mixed[:count].copy(), whole, star[3]

        _, slope, rest, mixed, stiffness, (xx, xy, yy) = now()
        value = derivatives(scratch, (x, y), POSITION)[1]
        for wanted in (VALUE, BLOCK):
            assert derivatives(scratch, (x, y), wanted)[1] == pytest.approx(value, rel=1e-14)
        assert_array_equal(scratch.block.rest[:count], rest)
        assert_array_equal(np.tril(scratch.block.stiffness[:count, :count]), np.tril(stiffness))
        hessian, scale = np.array([[xx, xy], [xy, yy]]), np.abs(stiffness).max()
        near = {"rtol": 1e-5, "atol": 1e-6 * scale}
        loose = {"rtol": 1e-5, "atol": (1e-6 if case[3] is None else 1e-3) * scale}  # tables know W'' to first order
        for i, way in enumerate(STEP * np.eye(2)):
            (up, up_slope, up_rest, *_), (down, down_slope, down_rest, *_) = now(*way), now(*-way)
            assert_allclose((up - down) / (2.0 * STEP), slope[i], **near)
            assert_allclose((up_slope - down_slope) / (2.0 * STEP), hessian[i], **loose)
            assert_allclose((up_rest - down_rest) / (2.0 * STEP), mixed[:, i], **loose)
        for i in range(count):
            found = []
            for step in (STEP, -2.0 * STEP):
                scratch.block.correction[:count] = np.eye(count)[i]
                change(scratch.block, 0, scratch.block.correction, step)
                put(scratch, v, True)
                found.append(now())
            change(scratch.block, 0, scratch.block.correction, STEP)
            put(scratch, v, True)
            assert_allclose((found[0][0] - found[1][0]) / (2.0 * STEP), rest[i], **near)
            assert_allclose((found[0][2] - found[1][2]) / (2.0 * STEP), stiffness[i], **loose)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case[3] and not case[2]])
def test_few_points_integrate_the_block_of_a_uniform_field(name):
    at = Setting(CASES[name])
    tri, movable = at.movable.triangulation, at.movable
    at.trial.values[:], at.trial.modes.side[:], at.trial.modes.bubble[:] = tri.position[:, 0], 0.0, 0.0
    scratch = at.functional.loops(movable, at.trial, movable.kernel_mesh()).scratch(0).primal
    straight = np.setdiff1d(tri.elements.node, tri.elements.node[scratch.shapes.special])
    v = straight[movable.constraints.kind[straight] == FREE][0]
    interpreted(rows.gather_star)(scratch, v)
    interpreted(patch.number_unknowns)(scratch, True)
    count, found = scratch.block.size[UNKNOWNS], []
    for wanted in (COARSE_BLOCK, BLOCK):
        interpreted(patch.derivatives)(scratch, tri.position[v], wanted)
        found.append((scratch.block.rest[:count].copy(), np.tril(scratch.block.stiffness[:count, :count])))
    for few, all_points in zip(*found, strict=True):
        assert_allclose(few, all_points, rtol=1e-12, atol=1e-12 * np.abs(all_points).max())
