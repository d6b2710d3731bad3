"""Edges and corners in space against those of bodies that are known, and against the plane."""

import numpy as np
import pytest
from helpers.magnet_solids import blocks, nested_balls
from helpers.meshes import disk, square
from helpers.solids import extruded
from numpy.testing import assert_array_equal
from skfem import Basis, ElementTetP2

import kohonen_adapt as ka
from kohonen_adapt.geometry.space.movable_solid import with_round_edges
from kohonen_adapt.mesh.corners import singular_nodes
from kohonen_adapt.mesh.singular_edges import singular_edges
from kohonen_adapt.problem.singular_nodes import materials_of

STEPS = np.linspace(0.0, 1.0, 5)


def everywhere(x):
    return np.full(x.shape[1:], True)


def found(mesh, fixed=everywhere, order=1, **tables):
    """Singular edges and corners if u is given on the facets for whose middles `fixed` says so."""
    outer = mesh.boundary_facets()
    given = outer[fixed(mesh.p[:, mesh.facets[:, outer]].mean(axis=1))]
    mask = np.isin(np.arange(mesh.nvertices), mesh.facets[:, given])
    if order == 2:
        basis = Basis(mesh, ElementTetP2())
        mask = np.isin(np.arange(basis.N), basis.get_dofs(given).all())
    ritz = ka.Ritz(np.zeros(mask.size), mask, **{"coefficient": 1.0} | tables, order=order)
    return singular_edges(mesh, materials_of(mesh, ritz))


def length(mesh, edges):
    return np.linalg.norm(np.diff(mesh.p[:, edges], axis=1)[:, 0], axis=0).sum()


def region_of(mesh, *names):
    return sum((k + 1) * np.isin(np.arange(mesh.nelements), mesh.subdomains[name]) for k, name in enumerate(names))


def box_in_air():
    mesh = blocks([STEPS] * 3, {"inner": ((0.25,) * 3, (0.75,) * 3)})
    return mesh, region_of(mesh, "inner")


def at_corners_of_box(mesh, corners):
    return corners.size == 8 and np.allclose(np.abs(mesh.p[:, corners] - 0.5), 0.25)


def test_iron_in_air():
    mesh, region = box_in_air()
    edges, corners = found(mesh, coefficient=[1.0, 1000.0], region=region)
    assert length(mesh, edges) == pytest.approx(6.0) and at_corners_of_box(mesh, corners)
    assert found(mesh, coefficient=[1.0, 1.001], region=region)[0].size == 0


@pytest.mark.parametrize("permeability", [1.0, 1.05])
def test_edges_of_a_magnet_count_except_along_the_magnetisation(permeability):
    mesh, region = box_in_air()
    flux = np.outer([0.0, 0.0, 1.0], [0.0, 1.0])
    edges, corners = found(mesh, coefficient=[1.0, permeability], flux=flux, region=region)
    assert length(mesh, edges) == pytest.approx(4.0) and at_corners_of_box(mesh, corners)
    assert np.all(np.ptp(mesh.p[2, edges], axis=0) < 1e-12)
    edges, _ = found(mesh, flux=lambda x, region: x * (region == 1), region=region)
    assert length(mesh, edges) == pytest.approx(6.0)


def round_bar(rings=6, layers=4):
    """A bar of half the radius and half the height of the air around it."""
    mesh = extruded(disk(rings, 1.0), layers)
    x = mesh.p[:, mesh.t]
    inner = (np.hypot(*x[:2]).max(axis=0) < 0.5 + 1e-9) & (np.abs(x[2] - 0.5) < 0.25 + 1e-9).all(axis=0)
    return mesh.with_subdomains({"inner": np.flatnonzero(inner), "air": np.flatnonzero(~inner)})


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("half", [False, True])
def test_round_surfaces_have_no_edges_and_circles_no_corners(curved, half):
    bar, ball = round_bar(), nested_balls(2)
    magnet = {"flux": np.outer([0.0, 0.0, 1.0], [0.0, 1.0])}
    for tables in ({"coefficient": [1.0, 1000.0]}, magnet):
        for mesh, name, lines in ((bar, "inner", 4), (ball, "ball", 0)):
            if half:
                middle = mesh.p[:, mesh.t].mean(axis=1)
                mesh = mesh.restrict(np.flatnonzero(middle[1] > 0))
            mesh = with_round_edges(mesh) if curved else mesh
            natural = 1e-9 if half else -np.inf
            edges, corners = found(mesh, lambda x, y=natural: x[1] > y, region=region_of(mesh, name), **tables)
            polygons = lines * 18 * np.sin(np.pi / 18) * (0.5 if half else 1.0)
            assert length(mesh, edges) == pytest.approx(0.5 * polygons) and corners.size == 0


@pytest.mark.parametrize("seed", range(4))
def test_upright_edges_are_singular_where_the_plane_is(seed):
    """Of random materials and conditions drawn along z, with natural ends."""
    rng = np.random.default_rng(seed)
    flat = square(3)
    region = rng.integers(0, 3, flat.nelements)
    coefficient = rng.choice([1.0, 2.0, 50.0, 1e4], 3)
    outer = flat.boundary_facets()
    given = flat.facets[:, outer[rng.random(outer.size) < 0.6]]
    rim = np.isin(np.arange(flat.nvertices), given)
    plane = ka.Ritz(np.zeros(flat.nvertices), rim, coefficient, region=region)
    nodes = singular_nodes(flat, materials_of(flat, plane))
    mesh = extruded(flat, 2)

    def fixed(x):
        sides = (x[2] > 1e-9) & (x[2] < 1 - 1e-9)
        return sides & np.array([on_fixed(point) for point in x.T])

    def on_fixed(point):
        middle = point[:2]
        ends = flat.p[:, flat.facets[:, outer]]
        way, off = ends[:, 1] - ends[:, 0], middle[:, None] - ends[:, 0]
        share = np.sum(way * off, axis=0) / np.sum(way**2, axis=0)
        near = np.hypot(*(off - share * way)) < 1e-9
        own = outer[near & (share > 0) & (share < 1)]
        return rim[flat.facets[:, own]].all()

    edges, _ = found(mesh, fixed, 2, coefficient=coefficient, region=np.tile(region, 6))
    upright = np.ptp(mesh.p[2, edges], axis=0) > 1e-9
    assert upright.all()
    assert_array_equal(np.unique(edges % flat.nvertices), nodes)
