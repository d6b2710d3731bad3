"""Hostile input: random arrangements of polygons and circles, disjoint, nested, touching and overlapping, from Gmsh."""

from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pytest
from helpers.examples import examples
from helpers.mesh_files import gmsh, gmsh_session, needs_gmsh
from helpers.meshes import areas_of
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import ROUND, SLIDING
from kohonen_adapt.kernels.triangle.chains import look_up

pytestmark = needs_gmsh

SIDE = 4.0  # of the frame that all arrangements have
FEW = examples(40)
TOPOLOGIES = ["fixed", "flip", "recycle"]


class Shape(NamedTuple):
    """A circle (no vertices) or a polygon; whole quarters and eighths make shapes touch often."""

    centre: tuple
    radius: float
    vertices: int
    turn: float

    def drawn(self):
        (x, y), occ = self.centre, gmsh.model.occ
        if not self.vertices:
            return occ.addDisk(x, y, 0, self.radius, self.radius)
        angle = self.turn + 2 * np.pi * np.arange(self.vertices) / self.vertices
        corners = np.round(8 * np.stack([x + self.radius * np.cos(angle), y + self.radius * np.sin(angle)])) / 8
        points = [occ.addPoint(*corner, 0) for corner in corners.T.tolist()]
        lines = [occ.addLine(points[k - 1], points[k]) for k in range(len(points))]
        return occ.addPlaneSurface([occ.addCurveLoop(lines)])


@pytest.fixture(scope="module", autouse=True)
def session():
    with gmsh_session():
        yield


def meshed(shapes, rng, size=0.35, per_turn=24):
    """The frame and the shapes cut along one another, meshed, with physical groups; through a file."""
    gmsh.model.add("arrangement")
    try:
        frame = gmsh.model.occ.addRectangle(0, 0, 0, SIDE, SIDE)
        _, parts = gmsh.model.occ.fragment([(2, frame)], [(2, shape.drawn()) for shape in shapes])
        gmsh.model.occ.synchronize()
        name_groups(parts, rng)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", per_turn)
        gmsh.model.mesh.generate(2)
        with TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/arrangement.msh")
            return ka.read_mesh(f"{folder}/arrangement.msh")
    finally:
        gmsh.model.remove()


def name_groups(parts, rng):
    """A surface group per shape, which overlap as the shapes do, and two groups of curves at random."""
    for number, part in enumerate(parts):
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in part], name=f"part {number}")
    curves = [tag for _, tag in gmsh.model.getEntities(1)]
    for name in ("one", "other"):
        chosen = [tag for tag in curves if rng.random() < 0.4]
        gmsh.model.addPhysicalGroup(1, chosen or curves[:1], name=name)


SHAPES = st.lists(
    st.builds(
        Shape,
        st.tuples(st.integers(2, 14).map(lambda k: k / 4), st.integers(2, 14).map(lambda k: k / 4)),
        st.integers(2, 7).map(lambda k: k / 4),
        st.sampled_from([0, 0, 0, 3, 4, 6]),
        st.sampled_from([0.0, np.pi / 4, 0.3]),
    ),
    min_size=1,
    max_size=4,
)


@st.composite
def cases(draw):
    """An arrangement with names, a density and options; ten facets around a circle turn by more than an arc may."""
    shapes, seed = draw(SHAPES), draw(st.integers(0, 2**16))
    rng = np.random.default_rng(seed)
    mesh = meshed(shapes, rng, draw(st.sampled_from([0.35, 0.7])), draw(st.sampled_from([12, 24, 60])))
    assume(ka.quality(mesh).min() > 1e-2)
    density = 10 ** (rng.random(mesh.t.shape[1]) * draw(st.sampled_from([0, 2, 6])))
    return mesh, density, {"topology": draw(st.sampled_from(TOPOLOGIES)), "seed": seed}


class Truth:
    """What outlines enclose and how long they are, arcs as arcs; the circles; how far nodes are from their chains."""

    def __init__(self, mesh):
        movable = MovableMesh.of(mesh, Rules())
        self.mesh, self.triangulation, self.outline = mesh, movable.triangulation, movable.outline
        elements, chains = self.triangulation.elements, self.outline.constraints.chains
        e, k = np.nonzero((elements.chain >= 0) & (np.append(chains.shape, 0)[elements.chain] == ROUND))
        a, b, apex = (self.triangulation.position[elements.node[e, (k + step) % 3]] for step in (1, 2, 0))
        centre, radius = circle_of(chains, elements.chain[e, k])
        angle = 2 * np.arcsin(0.5 * np.hypot(*(b - a).T) / radius)
        outward = np.sign(cross(b - a, centre - a) * cross(b - a, apex - a))  # -1: the arc bulges into the element
        self.enclosed = areas_of(self.triangulation)
        np.add.at(self.enclosed, e, outward * 0.5 * radius**2 * (angle - np.sin(angle)))
        self.circles = np.unique(np.round(np.column_stack([centre, radius]), 8), axis=0)
        ends = np.sort([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=0)
        self.arcs = dict(zip(zip(*ends.tolist(), strict=True), (angle * radius).tolist(), strict=True))

    def area(self, name):
        assert np.array_equal(np.sort(self.mesh.t, axis=0), np.sort(self.triangulation.elements.node.T, axis=0))
        return self.enclosed[self.mesh.subdomains[name]].sum()

    def length(self, name):
        ends = self.mesh.facets[:, np.asarray(self.mesh.boundaries[name])]
        chord = np.hypot(*(self.mesh.p[:, ends[1]] - self.mesh.p[:, ends[0]]))
        return sum(self.arcs.get(tuple(pair), flat) for pair, flat in zip(ends.T.tolist(), chord, strict=True))

    def off_chains(self):
        """How far sliding nodes are from where their chains have them."""
        nodes = np.flatnonzero(self.outline.constraints.kind == SLIDING)
        target = np.empty((len(nodes), 2))
        look_up(self.outline.constraints, nodes, target)
        return np.abs(target - self.triangulation.position[nodes]).max(initial=0.0)


def circle_of(chains, c):
    """Centres (k, 2) and radii of round chains."""
    normal = np.stack([-chains.direction[c, 1], chains.direction[c, 0]], axis=1)
    return chains.origin[c] + normal / chains.curvature[c, None], 1 / np.abs(chains.curvature[c])


def cross(u, w):
    return u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]


@FEW
@given(cases())
def test_areas_outlines_names_orientation_and_quality_are_kept(case):
    mesh, density, options = case
    result = ka.relocate(mesh, density, **options)
    old, new = Truth(mesh), Truth(result)
    assert result.p.shape == mesh.p.shape
    assert areas_of(new.triangulation).min() > 0
    assert ka.quality(result).min() >= min(0.3, ka.quality(mesh).min()) * (1 - 1e-9)
    assert sorted(result.subdomains) == sorted(mesh.subdomains)
    assert sorted(result.boundaries) == sorted(mesh.boundaries)
    for name in mesh.subdomains:
        assert new.area(name) == pytest.approx(old.area(name), rel=1e-12)
    for name in mesh.boundaries:
        assert new.length(name) == pytest.approx(old.length(name), rel=1e-12)
        assert off_lines(result, mesh, old.circles, name) < 1e-8
    assert_allclose(new.circles, old.circles, rtol=0, atol=1e-8)
    assert new.off_chains() < 1e-12 * SIDE


def off_lines(result, mesh, circles, name):
    """How far nodes of a boundary are from the facets that it had, or from the circles that were recognised."""
    a, b = mesh.p[:, mesh.facets[:, mesh.boundaries[name]]].transpose(1, 2, 0)
    off = [0.0]
    for x in result.p[:, np.unique(result.facets[:, result.boundaries[name]])].T:
        along = np.clip(np.sum((x - a) * (b - a), axis=1) / np.sum((b - a) ** 2, axis=1), 0, 1)
        flat = np.hypot(*(x - a - along[:, None] * (b - a)).T)
        off.append(min([*flat, *np.abs(np.hypot(*(x - circles[:, :2]).T) - circles[:, 2])]))
    return max(off)
