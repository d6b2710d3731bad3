"""What quadratic faces cut off curved surfaces, counted at order 2, and nodes that slide there."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.magnet_solids import bar, nested_balls
from helpers.quadratic_solids import slivers
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, Constraints
from kohonen_adapt.kernels.tetrahedron.polish.curved_order2 import slivers_at
from kohonen_adapt.kernels.tetrahedron.polish.star import number_star
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Material
from kohonen_adapt.mesh.curved import offsets_of_sides
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

IRON = Material(50.0)
SATURATED = Material(bh=Froehlich(2000.0, 1.8))
MAGNET = Material(5.0, remanence=(1.0, 0.0, 0.5))


MESHES = {"ball": lambda: nested_balls(2), "bar": bar}
each_case = pytest.mark.parametrize(("name", "material"), [("ball", MAGNET), ("bar", SATURATED)], ids=MESHES)


def along(x):
    return 1e6 * x[2]


def problem_of(material, outer=along):
    return MagneticScalarPotential({"ball": material, "air": Material()}, {"outer": outer}, order=2)


def descent_on(mesh, ritz):
    movable = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(ritz, movable, mesh)
    descent = descent_of(movable, functional)
    return movable, replace(descent, swaps=False)


def curved(name):
    return ka.adapt(MESHES[name](), problem_of(IRON), passes=0).mesh


def volume(mesh, name):
    return area(mesh)[mesh.subdomains[name]].sum()


def test_slivers_have_the_volume_that_quadratic_faces_lack():
    """Of u = s . x with the flux c s the density is -c |s|^2 / 2, and no flux crosses a face."""
    mesh, slope, coefficient = curved("ball"), np.array([1.0, -0.5, 2.0]), np.array([1.0, 3.0])
    region = np.zeros(mesh.nelements, dtype=np.int64)
    region[mesh.subdomains["air"]] = 1
    middle = 0.5 * (mesh.p[:, mesh.edges[0]] + mesh.p[:, mesh.edges[1]]) + offsets_of_sides(mesh)
    values = slope @ np.hstack([mesh.p[:, : mesh.nvertices], middle])
    fixed = np.zeros(values.size, dtype=bool)
    constants = {"coefficient": coefficient, "flux": np.outer(slope, coefficient), "region": region}
    _, descent = descent_on(mesh, Ritz(values, fixed, **constants, order=2))
    lacking = 4.0 / 3.0 * np.pi - volume(mesh, "ball")
    exact = 0.5 * (slope @ slope) * (coefficient[1] - coefficient[0]) * lacking
    assert slivers(descent) == pytest.approx(2.0 * exact, rel=0.02)


@each_case
def test_stars_count_the_slivers_of_their_faces(name, material):
    mesh, problem = curved(name), problem_of(material)
    _, descent = descent_on(mesh, problem.ritz(mesh, problem.solve(mesh)))
    opened, quadratic, total = descent.opened.mesh, descent.function()[1], 0.0
    assert descent.functional.faces.counted.any()
    arrays = KernelMesh(
        opened.position,
        opened.elements,
        descent.opened.star(),
        Constraints(opened.freedom, opened.surfaces, opened.freedom.number == INSIDE),
    )
    for v in range(mesh.nvertices):
        assert interpreted(number_star)(arrays, quadratic, v)
        total += interpreted(slivers_at)(arrays, quadratic, v)
    assert total > 0.0
    assert total / 3.0 == pytest.approx(slivers(descent), rel=1e-9)  # a face is in three stars


@each_case
def test_nodes_slide_on_curved_surfaces_while_the_functional_falls_as_told(name, material):
    mesh, problem = curved(name), problem_of(material)
    movable, descent = descent_on(mesh, problem.ritz(mesh, problem.solve(mesh)))
    before = descent.value()
    descent, fall = descent.descend_checked(2, False)
    assert 0.0 < fall == before - descent.value()
    descent.opened.write_back(movable)
    after = movable.mesh()
    inner = np.unique(mesh.facets[:, faces_between(mesh)])
    radius = np.linalg.norm(mesh.p[: 3 if name == "ball" else 2], axis=0)
    assert_allclose(np.linalg.norm(after.p[: 3 if name == "ball" else 2, inner], axis=0), radius[inner], rtol=1e-12)
    assert np.any(np.linalg.norm(after.p[:, inner] - mesh.p[:, inner], axis=0) > 1e-3)
    assert_array_equal(after.t, mesh.t)
    lacking = (4.0 / 3.0 * np.pi if name == "ball" else 0.25 * np.pi) - volume(mesh, "ball")
    assert abs(volume(after, "ball") - volume(mesh, "ball")) < lacking  # of the ball or the bar


def faces_between(mesh):
    inside = np.zeros(mesh.nelements, dtype=bool)
    inside[mesh.subdomains["ball"]] = True
    one, other = mesh.f2t
    return np.flatnonzero((other >= 0) & (inside[one] != inside[other]))


def test_given_values_that_vary_along_a_surface_hold_its_nodes():
    mesh = curved("ball")
    for outer, slides in ((0.0, True), (along, False)):
        problem = problem_of(MAGNET, outer)
        _, descent = descent_on(mesh, problem.ritz(mesh, problem.solve(mesh)))
        rows = mesh.boundary_nodes()
        before = descent.opened.mesh.position.copy()
        descent.descend(1, False)
        assert np.any(descent.opened.mesh.position[rows] != before[rows]) == slides
