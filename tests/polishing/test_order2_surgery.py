"""Swaps and exchanges of tetrahedra at order 2: gains are falls of the functional of a continuous function."""

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.examples import examples
from helpers.quadratic_solids import PAIRS, QuadraticDiffusion
from helpers.random_solids import flat_solids
from helpers.solids import box, volumes
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.polishing.polish import descend_and_recycle
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

FLOOR = 0.2


def graded(seed, cells=(4, 4, 3)):
    """The unit cube in two halves with named sides, refined towards a corner, and a problem on it."""
    rng, mesh = np.random.default_rng(seed), box(*cells)
    p = mesh.p.copy()
    shift = 0.2 * rng.uniform(-1, 1, p.shape) / np.array(cells)[:, None]
    p += np.where((p > 0) & (p < 1) & (p != 0.5), shift, 0.0)
    p = p ** np.array([1.6, 1.3, 1.0])[:, None]
    sides = {f"side{2 * d + k}": lambda x, d=d, k=k: x[d] == float(k) for d in range(3) for k in range(2)}
    halves = {"left": lambda x: x[0] < 0.5**1.6, "right": lambda x: x[0] > 0.5**1.6}
    return MeshTet(p, mesh.t).with_boundaries(sides).with_subdomains(halves), QuadraticDiffusion.random(seed)


def start(seed):
    mesh, problem = graded(seed)
    solid = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(problem.ritz(mesh, problem.solve(mesh)), solid, mesh)
    return mesh, problem, solid, functional, descent_of(solid, functional)


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


@pytest.mark.parametrize("seed", range(4))
def test_gains_are_falls_of_the_functional(seed):
    _, _, _, functional, descent = start(seed)
    size, done = abs(descent.value()) + 1.0, []
    steps = (
        lambda: descent.swap(descent.opened.parts()),
        lambda: descent.recycle()[1],
        lambda: descent.sweep(descent.opened.parts(), freedom_of(functional, descent)),
        lambda: descent.swap(descent.opened.parts()),
    )
    for step in steps:
        before = descent.value()
        done.append(step())
        assert done[-1] >= 0.0 and before - descent.value() == pytest.approx(done[-1], abs=1e-11 * size)
        assert is_continuous(descent)
    assert done[0] > 0.0 or done[1] > 0.0


def freedom_of(functional, descent):
    return functional.freedom(descent.opened.mesh.freedom, descent.trial.fixed)


def test_swaps_and_exchanges_happen():
    swapped = exchanged = 0
    for seed in range(6):
        *_, descent = start(seed)
        swapped += descent.swap(descent.opened.parts()) > 0.0
        exchanged += descent.recycle()[0]
    assert swapped > 3 and exchanged > 10


def test_the_price_of_a_sample_is_near_the_price_of_all_nodes():
    mesh, problem = graded(1, (13, 13, 12))
    solid = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(problem.ritz(mesh, np.zeros(count_unknowns(mesh, 2))), solid, mesh)
    descent = descent_of(solid, functional)
    of_sample = descent.charge()
    descent.weigh(np.arange(mesh.nvertices))
    assert of_sample != descent.charge() and of_sample == pytest.approx(descent.charge(), rel=0.2)


def areas(mesh):
    corners = mesh.p[:, mesh.facets]
    size = np.linalg.norm(np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2)), axis=0), axis=0) / 2.0
    return {name: size[np.asarray(rows)].sum() for name, rows in mesh.boundaries.items()}


@examples(100)
@given(flat_solids(), st.booleans())
def test_random_bodies_keep_volumes_names_surfaces_and_quality(case, zero_outside):
    mesh, _, _ = case
    rng = np.random.default_rng(mesh.nelements)
    unknowns = count_unknowns(mesh, 2)
    outer = mesh.facets[:, mesh.boundary_facets()]
    edges = {tuple(sorted(pair)) for k in range(3) for pair in outer[[k, k - 1]].T.tolist()}
    on_edges = [tuple(sorted(pair)) in edges for pair in mesh.edges.T.tolist()]
    fixed = np.append(np.isin(np.arange(mesh.nvertices), outer), on_edges) & zero_outside
    values = np.where(fixed, 0.0, rng.normal(size=unknowns))
    solid = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(ka.Ritz(values, fixed, 1.0, source=1.0, order=2), solid, mesh)
    gain = descend_and_recycle(descent_of(solid, functional), (2, 2))[1]
    after = solid.mesh()
    old, new = Tetrahedralization.of(mesh), Tetrahedralization.of(after)
    assert gain >= 0.0 and new.volumes().min() > 0.0
    size = np.abs(volumes(mesh)).sum()
    by_region = [np.bincount(tet.elements.region[tet.used], tet.volumes()) for tet in (old, new)]
    np.testing.assert_allclose(*map(np.sort, by_region), atol=1e-10 * size)
    for name, rows in (mesh.subdomains or {}).items():
        own = np.abs(volumes(after))[after.subdomains[name]].sum()
        assert own == pytest.approx(np.abs(volumes(mesh))[rows].sum(), abs=1e-10 * size)
    assert list(after.boundaries or {}) == list(mesh.boundaries or {})
    if mesh.boundaries:
        assert areas(after) == pytest.approx(areas(mesh), abs=1e-9 * size ** (2 / 3))
    assert ka.quality(after).min() >= min(FLOOR, ka.quality(mesh).min()) * (1.0 - 1e-9)
