"""What chords cut off, counted: the functional is that of the true domain, and nodes on curves descend it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.meshes import circle, shells
from numpy.testing import assert_array_equal
from skfem import Basis, ElementTriP1, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.magnetostatics import Brauer, Magnetostatics, Material, radial
from kohonen_adapt.polishing.curve_nodes import Stars
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value

RADII = (0.3, 0.6, 1.0)


def disk(around=12, layers=3, off=0.0):
    """A disk in a ring in a ring, their nodes shifted along the circles, where neighbours allow it."""
    radii = np.concatenate([[0.15], np.linspace(0.3, 0.6, layers), np.linspace(0.6, 1.0, layers)[1:]])
    turned = [radius * circle(around, off * np.sin(7 * radius)) for radius in radii]
    mesh = shells(turned, 1)
    centre = mesh.p.shape[1]
    first = np.flatnonzero(np.hypot(*mesh.p) < 0.16)
    first = first[np.argsort(np.arctan2(mesh.p[1, first], mesh.p[0, first]))]
    fan = np.stack([np.full(around, centre), first, np.roll(first, -1)])
    mesh = MeshTri(np.hstack([mesh.p, np.zeros((2, 1))]), np.hstack([mesh.t, fan]))
    middle = np.hypot(*mesh.p[:, mesh.t].mean(axis=1))
    parts = {name: np.flatnonzero((middle > low) & (middle < high)) for name, low, high in PARTS}
    return mesh.with_subdomains(parts).with_boundaries({"rim": lambda x: np.hypot(*x) > 0.9})


def sliding(functional, movable):
    """Nodes on the curves of which the slivers are known, (n,)."""
    constraints = movable.constraints
    on_curves = constraints.kind == SLIDING
    return on_curves & functional.chords.counted[np.where(on_curves, constraints.own_chain, 0)]


PARTS = (("core", 0.0, 0.29), ("ring", 0.29, 0.595), ("air", 0.595, 1.0))


def functional_on(mesh, natural=False, seed=1):
    """Constants by region of any kind, values of any kind, given as 0 on the rim if it is not natural there."""
    rng, n = np.random.default_rng(seed), mesh.p.shape[1]
    number = np.zeros(mesh.nelements, dtype=int)
    for place, (name, _, _) in enumerate(PARTS):
        number[mesh.subdomains[name]] = place
    fixed = np.zeros(n, dtype=bool) if natural else np.hypot(*mesh.p) > 0.99
    values = np.where(fixed, 0.0, mesh.p[0] * (1.0 - np.sum(mesh.p**2, axis=0)) + 0.3 * mesh.p[1])
    source, flux = (np.zeros(3), np.zeros((2, 3))) if natural else (rng.normal(size=3), rng.normal(size=(2, 3)))
    return ka.Ritz(values, fixed, 10.0 ** rng.uniform(-1, 1, 3), source, flux, number)


def true_functional(mesh, ritz, values, points=1000):
    """That of the same P1 function on the true disk, at points in polar coordinates."""
    radius, angle = np.meshgrid((np.arange(points) + 0.5) / points, 2.0 * np.pi * np.arange(points) / points)
    x = np.stack([radius * np.cos(angle), radius * np.sin(angle)]).reshape(2, -1)
    found, middle = ka.find_elements(mesh, x), mesh.p[:, mesh.t].mean(axis=1)
    rim = mesh.f2t[0, mesh.boundary_facets()]
    lost = np.flatnonzero(found < 0)  # beyond the chords of the rim, where its elements go on
    way = np.abs(np.angle(np.exp(1j * (np.arctan2(*x[::-1, lost])[:, None] - np.arctan2(*middle[::-1, rim])))))
    found[lost] = rim[np.argmin(way, axis=1)]
    slope = np.asarray(Basis(mesh, ElementTriP1(), intorder=1).interpolate(values).grad)[:, found, 0]
    u = values[mesh.t[:, found]].mean(axis=0) + np.sum(slope * (x - middle[:, found]), axis=0)
    if ritz.fixed.any():
        slope[:, lost] = u[lost] = 0.0
    number = np.digitize(radius.ravel(), RADII[:2])
    density = 0.5 * ritz.coefficient[number] * np.sum(slope**2, axis=0) - ritz.source[number] * u
    density -= np.sum(ritz.flux[:, number] * slope, axis=0)
    return float(radius.ravel() @ density) * 2.0 * np.pi / points**2


@pytest.mark.parametrize("natural", [False, True])
def test_with_slivers_it_is_the_functional_of_the_true_domain(natural):
    mesh = disk()
    ritz = functional_on(mesh, natural)
    movable = MovableMesh.of(mesh, Rules())
    functional = Functional.of(ritz, movable)
    assert functional.chords.counted.all() and functional.comparable == natural  # where no source ends
    polygons, exact = functional_value(mesh, ritz), true_functional(mesh, ritz, np.asarray(ritz.values))
    counted = functional.value(movable.triangulation, functional.solution)
    assert counted == pytest.approx(
        polygons + functional.energy_beyond_chords(movable.triangulation, functional.solution)
    )
    assert abs(counted - exact) < 0.02 * abs(polygons - exact)


@pytest.mark.parametrize("dual", [False, True])
def test_stars_know_what_a_move_along_a_curve_does_to_the_whole(dual):
    mesh = disk(off=0.1)
    movable, ritz = MovableMesh.of(mesh, Rules()), functional_on(mesh)
    if dual:
        other = functional_on(mesh, seed=2)
        ritz = replace(ritz, dual=replace(other, coefficient=ritz.coefficient), share=3.0)
    functional = Functional.of(ritz, movable)
    trial, constraints, tri = functional.solution.copy(), movable.constraints, movable.triangulation
    moving = np.flatnonzero(sliding(functional, movable))
    assert len(moving) == 3 * 12
    for v in moving[::5]:
        node, found = np.array([v]), []
        stars = Stars.of(movable, functional, trial, node, functional.chords.slivers(tri))
        start = constraints.parameter[node].copy()
        for parameter in (start, start + 0.02):
            old, (total, _, changes) = trial.copy(), stars.evaluated(parameter)
            tri.position[node], constraints.parameter[node] = stars.points(parameter), parameter
            for part, change in zip(stars.parts, changes, strict=True):
                part.values[node] += change
            least = functional.value(tri, trial)
            found.append((least, total[0]))
            for part in stars.parts:
                part.values[node] += 1e-4
                assert functional.value(tri, trial) > least or trial.fixed[v]  # it was the best value
            trial.restore(old)
        assert found[1][0] - found[0][0] == pytest.approx(found[1][1] - found[0][1], rel=1e-6)
        tri.position[node], constraints.parameter[node] = stars.points(start), start


MATERIALS = {"core": Material(remanence=(1.0, 0.5)), "ring": Material(50.0), "air": Material()}


HOSTILE = {
    "nonlinear": (MATERIALS | {"ring": Material(bh=Brauer(100.0, 10.0, 1.8))}, {"rim": 0.0}),
    "turning": (MATERIALS | {"ring": Material(1.05, remanence=radial(1.0))}, {"rim": 0.0}),
    "given": (MATERIALS, {"rim": lambda x: x[0]}),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_where_slivers_are_not_known_nodes_on_curves_stay(name):
    materials, potential = HOSTILE[name]
    mesh = disk()
    problem = Magnetostatics(materials, potential=potential, order=1)
    movable = MovableMesh.of(mesh, Rules())
    functional = Functional.of(problem.ritz(mesh, problem.solve(mesh)), movable)
    assert not functional.comparable
    still = ~sliding(functional, movable) & ~np.isclose(np.hypot(*mesh.p), 0.0)
    on = still & np.isin(np.round(np.hypot(*mesh.p), 9), RADII)
    assert on.any()
    better = ka.polish(mesh, problem, sweeps=2)
    assert_array_equal(better.p[:, on], mesh.p[:, on])
    assert np.abs(better.p - mesh.p).max() > 1e-3
