"""Patches on spheres, cylinders and surfaces that are told, and ridges between them: recognised, kept to, refused."""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from helpers.meshes import disk, ring, shells
from helpers.solids import ball, box, cut, extruded, l_shape
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import Delaunay
from skfem import MeshTet, MeshTet2, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    CONE,
    CYLINDER,
    HELD,
    INTERSECTION,
    LINE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    PROJECTED,
    SPHERE,
)
from kohonen_adapt.mesh.measures import area

SHAPES = {"planes": PLANE, "spheres": SPHERE, "cylinders": CYLINDER, "cones": CONE, "others": PROJECTED}
RIDGES = {"lines": LINE, "circles": CIRCLE, "intersections": INTERSECTION}


def stadium(straight):
    """A plane mesh between two outlines of two half circles and two sides, of so many facets each."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 11)
    x, rest = np.linspace(1, -1, straight + 1)[1:-1], np.ones(straight - 1)
    half = np.hstack([np.stack([1 + np.cos(angle), np.sin(angle)]), np.stack([x, rest])])
    whole = np.hstack([half, -half])
    return shells([0.4 * whole, whole], 3)


def capsule(n=6):
    """A round bar with half a ball on both of its ends."""
    mesh = box(n, n, 3 * n)
    x = 2.0 * mesh.p - 1.0
    core = np.clip(3.0 * x[2], -2.0, 2.0)
    x[2] = 3.0 * x[2] - core
    length = np.sqrt(np.sum(x**2, axis=0))
    x *= np.max(np.abs(x), axis=0) / np.where(length > 0.0, length, 1.0)
    x[2] += core
    return MeshTet(x, mesh.t)


def oblique():
    """A round bar, its end cut obliquely: an ellipse."""
    mesh = extruded(disk(4, 1.0), 6, 2.0)
    p = mesh.p.copy()
    p[2] *= 1.0 + 0.3 * p[0]
    return MeshTet(p, mesh.t)


def sector(concentric):
    """A quarter of an annulus with four nodes on each arc, the inner one drawn straight if not `concentric`."""
    flat = MeshTri.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 0.5 * np.pi, 4))
    share, angle = flat.p
    outer = np.stack([np.cos(angle), np.sin(angle)])
    chord = np.stack([1.0 - angle / (0.5 * np.pi), angle / (0.5 * np.pi)])
    inner = 0.5 * (outer if concentric else chord)
    return extruded(MeshTri(inner + share * (outer - inner), flat.t), 3)


def moved(mesh, seed=3):
    """The mesh turned and shifted in space."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return MeshTet(turn @ mesh.p + np.array([[10.0], [2.0], [3.0]]), mesh.t, mesh.boundaries, mesh.subdomains)


# per mesh: numbers of patches by shape and ridges by shape, and of held nodes
RECOGNISED = {
    "bar": (lambda: extruded(disk(3, 1.0), 4), {"planes": 2, "cylinders": 1, "circles": 2}, 0),
    "plate": (lambda: extruded(disk(3, 1.0), 1), {"planes": 2, "cylinders": 1, "circles": 2}, 0),
    "tube": (lambda: extruded(ring(24, 3), 3), {"planes": 2, "cylinders": 2, "circles": 4}, 0),
    "ball": (lambda: ball(6), {"spheres": 1}, 0),
    "slot": (lambda: extruded(stadium(6), 2), {"planes": 6, "cylinders": 4, "circles": 8, "lines": 16}, 16),
    "slot of long facets": (
        lambda: extruded(stadium(1), 2),
        {"planes": 6, "cylinders": 4, "circles": 8, "lines": 16},
        16,
    ),
    "capsule": (capsule, {"spheres": 2, "cylinders": 1, "circles": 2}, 0),
    "oblique": (oblique, {"planes": 2, "cylinders": 1, "circles": 1, "intersections": 1}, 0),
    "coarse": (lambda: sector(True), {"planes": 4, "cylinders": 2, "circles": 4, "lines": 8}, 8),
    "coarse by chance": (lambda: sector(False), {"planes": 8, "lines": 18}, 12),
    "prism of ten sides": (lambda: extruded(ring(10, 2), 2), {"planes": 22, "lines": 60}, 40),
    "box": (lambda: box(4), {"planes": 6, "lines": 12}, 8),
    "L": (lambda: l_shape(2), {"planes": 8, "lines": 18}, 12),
}


def found(solid):
    """How many patches and ridges of each shape there are."""
    kinds = [(solid.surfaces.shape, SHAPES), (solid.surfaces.ridge_shape, RIDGES)]
    return {name: n for shape, names in kinds for name, k in names.items() if (n := int(np.sum(shape == k)))}


@pytest.mark.parametrize("name", RECOGNISED)
@pytest.mark.parametrize("place", [lambda mesh: mesh, moved], ids=["as it is", "turned"])
def test_what_is_recognised(name, place):
    build, wanted, held = RECOGNISED[name]
    mesh = place(build())
    solid = MovableSolid.of(mesh, Rules())
    assert found(solid) == wanted
    assert np.sum(solid.freedom.number == HELD) == held
    assert_on_surfaces(solid, 1e-12 * np.ptp(mesh.p, axis=1).max())


def assert_on_surfaces(solid, within):
    """Nodes are on all that they slide on; on an intersection on both of its patches."""
    x, (number, place, _), surfaces = solid.tetrahedralization.position, solid.freedom, solid.surfaces
    pairs = [(np.flatnonzero(number == ON_PATCH), place[number == ON_PATCH])]
    on = np.flatnonzero(number == ON_RIDGE)
    pairs += [(on[p >= 0], p[p >= 0]) for p in surfaces.meets[place[on]].T]
    for nodes, patch in pairs:
        assert np.abs(solid.patches.project(patch, x[nodes]) - x[nodes]).max(initial=0.0) < within


def hull_of_sphere(count, seed):
    """Tetrahedra from the centre of a sphere to the faces of the hull of nodes on the sphere, nearly even."""
    i, noise = np.arange(count) + 0.5, np.random.default_rng(seed).normal(0.0, 0.12, (3, count))
    z, angle = 1.0 - 2.0 * i / count, np.pi * (1.0 + np.sqrt(5.0)) * i
    x = np.stack([np.sqrt(1.0 - z**2) * np.cos(angle), np.sqrt(1.0 - z**2) * np.sin(angle), z]) + noise
    x = np.append(x / np.linalg.norm(x, axis=0), np.zeros((3, 1)), axis=1)
    return MeshTet(x, Delaunay(x.T).simplices.T.astype(np.int64))


@pytest.mark.parametrize(("count", "seed"), [(24, 1), (30, 5)])
def test_single_faces_in_a_coarse_sphere_belong_to_the_sphere(count, seed):
    mesh = hull_of_sphere(count, seed)
    assert found(MovableSolid.of(mesh, Rules())) == {"spheres": 1}


@pytest.mark.parametrize("name", ["bar", "ball", "slot", "capsule", "oblique"])
def test_settling_puts_nodes_on_all_that_they_slide_on(name):
    mesh = moved(RECOGNISED[name][0]())
    solid = MovableSolid.of(mesh, Rules(min_quality=0.0))
    x, slides = (
        solid.tetrahedralization.position,
        (solid.freedom.number == ON_PATCH) | (solid.freedom.number == ON_RIDGE),
    )
    x[slides] += 1e-3 * np.random.default_rng(0).uniform(-1, 1, (slides.sum(), 3))
    on_plane = slides & np.isin(solid.freedom.place, np.flatnonzero(solid.surfaces.shape == PLANE))
    x[on_plane & (solid.freedom.number == ON_PATCH)] = mesh.p.T[on_plane & (solid.freedom.number == ON_PATCH)]
    lines = slides & (solid.freedom.number == ON_RIDGE)
    lines[lines] = solid.surfaces.ridge_shape[solid.freedom.place[lines]] == LINE
    x[lines] = mesh.p.T[lines]
    others = x[~slides].copy()
    solid.project_nodes()
    assert_on_surfaces(solid, 1e-11)
    assert_array_equal(x[~slides], others)
    assert np.all(solid.tetrahedralization.volumes() > 0.0)
    still, again = x.copy(), MovableSolid.of(solid.mesh(), Rules())
    solid.project_nodes()
    assert_array_equal(x, still)
    assert found(again) == RECOGNISED[name][1]
    assert_array_equal(again.freedom.number, solid.freedom.number)


def test_settling_leaves_no_element_worse_than_the_floor_or_than_it_was():
    mesh = ball(4)
    solid = MovableSolid.of(mesh.with_boundaries({"rim": mesh.boundary_facets()}), Rules())
    x = solid.tetrahedralization.position
    x *= 0.98 + 0.04 * np.random.default_rng(1).random((len(x), 1))  # far off
    before = MeshTet(x.T.copy(), solid.mesh().t)
    assert np.all(solid.tetrahedralization.volumes() > 0.0)
    solid.project_nodes()
    after = solid.mesh()
    assert np.any(after.p != before.p)
    assert np.all(solid.tetrahedralization.volumes() > 0.0)
    assert np.all(ka.quality(after) >= np.minimum(0.2, ka.quality(before)))


@dataclass
class Ellipsoid:
    """x^2 / 4 + y^2 + z^2 = 1, by steps along its gradient: a surface of a user's own."""

    calls: int = 0

    def project(self, x):
        self.calls += 1
        found, scale = np.array(x), np.array([[0.25], [1.0], [1.0]])
        for _ in range(60):
            value, gradient = np.sum(scale * found**2, axis=0) - 1.0, 2.0 * scale * found
            found -= gradient * (value / np.sum(gradient**2, axis=0))
        return found


def egg():
    """A ball stretched along x, its rim named."""
    mesh = ball(6)
    mesh = MeshTet(mesh.p * [[2.0], [1.0], [1.0]], mesh.t)
    return mesh.with_boundaries({"rim": mesh.boundary_facets()})


def frustum():
    """A round bar that gets thinner, its side named."""
    mesh = extruded(disk(4, 1.0), 4)
    mesh = MeshTet(mesh.p * np.stack([1 - 0.5 * mesh.p[2], 1 - 0.5 * mesh.p[2], np.ones(mesh.p.shape[1])]), mesh.t)
    return mesh.with_boundaries({"side": lambda x: (x[2] > 0.0) & (x[2] < 1.0)})


CONE_OF_FRUSTUM = ka.Cone((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), np.arctan(0.5))


REFUSED = {
    r"surfaces must map names of boundaries to surfaces; got list\.": [CONE_OF_FRUSTUM],
    r"surfaces has 'top', which is no boundary of the mesh; its boundaries are: 'side'\.": {"top": CONE_OF_FRUSTUM},
    r"the surface of boundary 'side' must be a kohonen_adapt\.Plane, .*project\(x \(3, n\)\) -> \(3, n\); got 3\.": {
        "side": 3
    },
    r"the nodes of boundary 'side' must lie on the surface given for it, within 0\.001 of its size, 2 in units of .*": {
        "side": ka.Cylinder((0, 0, 0), (0, 0, 1), 1.0)
    },
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_told_of_surfaces_is_checked(message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        MovableSolid.of(frustum(), Rules(surfaces=REFUSED[message]))


def test_how_far_faces_are_off_is_told():
    count = 24
    mesh = extruded(ring(count, 3), 3).with_boundaries({"rim": lambda x: np.hypot(x[0], x[1]) > 0.9})
    solid = MovableSolid.of(mesh, Rules())
    assert solid.sagitta() == pytest.approx(1.0 - np.cos(np.pi / count), rel=1e-9)
    assert solid.farthest_part() == "boundary 'rim'"
    assert MovableSolid.of(cut(2), Rules()).sagitta() == 0.0


def test_the_farthest_surface_of_a_body_without_names_is_told_by_its_place():
    said = MovableSolid.of(ball(4, 2.0), Rules()).farthest_part()
    place = np.array(re.fullmatch(r"one without a name, with a face near \((.*)\)", said)[1].split(", "), dtype=float)
    assert 1.5 < np.linalg.norm(place) < 2.0


OWN = Rules(surfaces={"rim": Ellipsoid()}, min_quality=0.0)
ROUND = {
    "ball": (ball, Rules(), lambda x: np.linalg.norm(x, axis=0) - 1.0),
    "bar": (lambda: extruded(disk(4, 1.0), 3), Rules(), lambda x: np.hypot(x[0], x[1]) - 1.0),
    "frustum": (frustum, Rules(surfaces={"side": CONE_OF_FRUSTUM}), lambda x: np.hypot(x[0], x[1]) - 1.0 + 0.5 * x[2]),
    "egg": (egg, OWN, lambda x: np.hypot(0.5 * x[0], np.hypot(x[1], x[2])) - 1.0),
}  # fmt: skip


@pytest.mark.parametrize("shape", ROUND)
def test_midside_nodes_lie_on_curved_surfaces_unless_an_element_would_fold(shape):
    make, rules, off = ROUND[shape]
    straight, bent = (MovableSolid.of(make(), rules, sides) for sides in (False, True))
    mesh = bent.mesh()
    assert type(straight.mesh()) is MeshTet and type(mesh) is MeshTet2
    assert bent.sagitta() == 0.0 < straight.sagitta()
    assert ka.quality(mesh).min() > 0.0  # which refuses inverted elements
    ends = mesh.edges[:, np.unique(mesh.t2e[:, mesh.f2t[0, mesh.boundary_facets()]])]
    place, middle = mesh.p[:, mesh.nvertices :], mesh.p[:, mesh.edges].mean(axis=1)
    moved = np.any(place != middle, axis=0)
    assert ends.size and np.abs(off(place[:, moved])).max() < 1e-9
    on = np.all(np.abs(off(mesh.p[:, mesh.edges.ravel()]).reshape(2, -1)) < 1e-9, axis=0) & (off(middle) < -1e-9)
    assert moved[on].mean() > (0.6 if shape in ("ball", "egg") else 0.9)  # blown-up cubes have flat elements at edges
    assert not moved[~on].any()


def test_curved_edges_on_surfaces_that_are_not_recognised_are_kept():
    drawn = MovableSolid.of(egg(), ROUND["egg"][1], True).mesh()
    solid = MovableSolid.of(drawn, Rules(min_quality=0.0))
    assert found(solid).keys() == {"planes", "lines"}
    assert_allclose(solid.mesh().p, drawn.p, atol=1e-12)
    after = ka.relocate(drawn, lambda x: 1.0 + x[0] ** 2, min_quality=0.0)
    assert type(after) is MeshTet2
    assert area(after).sum() == pytest.approx(area(drawn).sum(), rel=1e-3)
    assert type(ka.relocate(MeshTet(drawn.p[:, : drawn.nvertices], drawn.t), np.ones(drawn.nelements))) is MeshTet


def test_a_cone_holds_its_apex():
    flat = disk(4, 1.0)
    p = np.hstack([np.vstack([flat.p, 0.0 * flat.p[:1]]), [[0.0], [0.0], [1.0]]])
    pointed = MeshTet(p, np.vstack([flat.t, np.full(flat.nelements, flat.nvertices)]))
    pointed = pointed.with_boundaries({"side": lambda x: x[2] > 0.0})
    solid = MovableSolid.of(pointed, Rules(surfaces={"side": ka.Cone((0, 0, 1), (0, 0, -1), np.pi / 4)}))
    (apex,) = np.flatnonzero(pointed.p[2] == 1.0)
    assert np.flatnonzero(solid.freedom.number == HELD).tolist() == [apex]
