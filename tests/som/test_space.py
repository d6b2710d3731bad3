"""Relocation of tetrahedra: nodes where a density wants them, and everything that must stay as it was."""

import numpy as np
import pytest
from helpers.solids import box, two_regions, volumes
from helpers.tetrahedra import crack
from numpy.testing import assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka

TOPOLOGIES = ("flip", "recycle", "fixed")


def shell(x):
    """A sphere about the middle of the cube, with twenty times the density of the rest."""
    return 1.0 + 20.0 / np.cosh(20.0 * (((x - 0.5) ** 2).sum(axis=0) - 0.16)) ** 2


def spread(mesh, density):
    """Coefficient of variation of the mass of elements, from the density at their nodes."""
    mass = np.abs(volumes(mesh)) * density(mesh.p)[mesh.t].mean(axis=0)
    return mass.std() / mass.mean()


def area(mesh, facets):
    a, b, c = mesh.p[:, mesh.facets[:, facets]].transpose(1, 2, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize(("topology", "most"), [("recycle", 0.35), ("flip", 0.65), ("fixed", 0.65)])
def test_mass_is_shared_out(topology, most):
    """From 0.90; what only moves cannot carry nodes far."""
    mesh = box(12)
    found = ka.relocate(mesh, shell, topology=topology)
    assert found.nvertices == mesh.nvertices and found.is_valid()
    assert spread(found, shell) < most < spread(mesh, shell)
    assert ka.quality(found).min() >= 0.2 and ka.quality(found).mean() > 0.8
    assert np.abs(volumes(found)).sum() == pytest.approx(1.0, rel=1e-12)


def test_slits_stay_open():
    mesh = crack(8)
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    density = 1.0 + 1e6 * np.exp(-20.0 * ((x - 0.9) ** 2 + (y - 0.1) ** 2))  # few nodes are wanted at the slit
    moved = ka.relocate(mesh, density, topology="recycle", min_quality=0.0)
    assert area(moved, moved.boundary_facets()) == pytest.approx(area(mesh, mesh.boundary_facets()), rel=1e-12)


def test_facets_that_adaptive_refinement_forgets_are_kept():
    """scikit-fem keeps the numbers of facets when it refines some elements: here all facets are where they were."""
    mesh = box(3).with_boundaries({"left": lambda x: x[0] == 0.0})
    refined = mesh.refined(np.arange(20))
    stale = refined.p[0, refined.facets[:, refined.boundaries["left"]]]
    assert np.any(stale != 0.0)
    for topology in TOPOLOGIES:
        found = ka.relocate(mesh, shell, topology=topology)
        assert np.all(found.p[0, found.facets[:, found.boundaries["left"]]] == 0.0)
        assert area(found, found.boundaries["left"]) == pytest.approx(1.0, rel=1e-12)


def test_without_sweeps_bad_elements_are_swapped_away():
    mesh = box(6)
    rng = np.random.default_rng(0)
    inner = np.all((mesh.p > 0) & (mesh.p < 1), axis=0)
    moved = mesh.p + np.where(inner, rng.uniform(-0.04, 0.04, mesh.p.shape), 0.0)
    mesh = MeshTet(moved, mesh.t)
    found = ka.relocate(mesh, shell, schedule=ka.Schedule(()))
    assert np.array_equal(found.p, mesh.p)
    assert ka.quality(found).min() > 1.2 * ka.quality(mesh).min()


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_stages_are_presented_where_a_schedule_has_some(topology):
    mesh, schedule = two_regions(4), ka.Schedule((ka.Stage(1, 2, 0.3),), sweeps=1)
    values = shell(mesh.p[:, mesh.t].mean(axis=1))
    found, again, without = (
        ka.relocate(mesh, density, topology=topology, schedule=plan)
        for density, plan in ((values, schedule), (values, schedule), (values, ka.Schedule((), sweeps=1)))
    )
    assert_array_equal(found.p, again.p)
    assert found.p.shape == mesh.p.shape and np.any(found.p != without.p)
    assert ka.quality(found).min() >= min(0.2, ka.quality(mesh).min()) - 1e-14
    for name in mesh.boundaries:
        assert area(found, found.boundaries[name]) == pytest.approx(area(mesh, mesh.boundaries[name]), rel=1e-12)


def test_rounds_of_transport_are_refused():
    with pytest.raises(ValueError, match="rounds of transport are for triangles only"):
        ka.relocate(box(2), shell, schedule=ka.Schedule((), rounds=1))


def test_it_says_why_no_node_moves(caplog):
    ka.relocate(box(1), shell)
    assert "relocate moved no node: every node is held" in caplog.text
