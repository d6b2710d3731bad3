"""Meshes that lie on themselves are refused everywhere, and those that only touch themselves are not."""

import numpy as np
import pytest
from helpers.meshes import apart, disk, perturbed, ring, slit, square
from skfem import MeshTet, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.cells import cell_of

LIES = r"^the mesh lies on itself: at \("
AIR, IRON = square(9), square(6).scaled((0.3, 0.5)).translated((0.31, 0.21))


def iron_over_air():
    """A bar of iron drawn over a square of air that is not cut there."""
    mesh, air = joined(AIR, IRON), np.arange(AIR.nelements)
    mesh = mesh.with_subdomains({"air": air, "iron": air.size + np.arange(IRON.nelements)})
    return mesh.with_boundaries({"outer": mesh.boundary_facets()})


def joined(*meshes):
    """The elements of meshes of one kind, with no node in common."""
    first = np.cumsum([0, *(mesh.p.shape[1] for mesh in meshes)])
    t = np.hstack([mesh.t + start for mesh, start in zip(meshes, first, strict=False)])
    return type(meshes[0])(np.hstack([mesh.p for mesh in meshes]), t)


def cube(cells=3):
    return MeshTet.init_tensor(*[np.linspace(0.0, 1.0, cells + 1)] * 3)


def spiral(turns, rise):
    """A strip wound around the origin, farther out by `rise` after a turn."""
    mesh = MeshTri.init_tensor(np.linspace(0.0, turns, 25), np.linspace(1.0, 1.5, 4))
    angle, radius = 2.0 * np.pi * mesh.p[0], mesh.p[1] + rise * mesh.p[0]
    return MeshTri(radius * np.stack([np.cos(angle), np.sin(angle)]), mesh.t)


def lies_on_itself(mesh):
    """Whether any centroid is inside another element, each compared with each."""
    cell, corners = cell_of(mesh), mesh.p[:, mesh.t]
    whole = cell.determinant(corners)
    for e, centroid in enumerate(corners.mean(axis=1).T):
        share = []
        for k in range(cell.dim + 1):
            replaced = corners.copy()
            replaced[:, k] = centroid[:, None]
            share.append(cell.determinant(replaced) / whole)
        if np.any(np.delete(np.min(share, axis=0), e) > 1e-9):
            return True
    return False


def is_refused(mesh):
    try:
        ka.find_elements(mesh, np.zeros((len(mesh.p), 1)))
    except ValueError as error:
        assert str(error).startswith("the mesh lies on itself: at (")
        return True
    return False


OVERLAPPING = {
    "iron over air": iron_over_air(),
    "drawn twice": joined(square(5), square(5)),
    "a speck in a coarse element": joined(square(1), disk(3, 0.01).translated((0.6, 0.3))),
    "over the rim": joined(square(6), square(4).translated((0.7, 0.6))),
    "wound on itself": spiral(1.4, 0.0),
    "boxes": joined(cube(), cube().translated((0.5, 0.4, 0.3))),
    "a box drawn twice": joined(cube(), cube()),
    "a small box in a large element": joined(cube(1), cube(2).scaled(0.05).translated((0.55, 0.3, 0.2))),
}
TOUCHING = {
    "slit": perturbed(slit(8), 4),
    "doubled nodes": apart(square(5), square(5).translated((1.0, 0.0))),
    "nodes of their own": joined(square(5), square(8).translated((1.0, 0.0))),
    "every element alone": MeshTri(square(6).p[:, square(6).t.T.ravel()], np.arange(3 * 72).reshape(72, 3).T),
    "wound beside itself": spiral(2.5, 0.6),
    "needles": MeshTri(np.array([[1.0], [1e-7]]) * square(9).p, square(9).t),
    "boxes side by side": joined(cube(), cube(4).translated((1.0, 0.0, 0.0))),
    "flat boxes": MeshTet(np.array([[1.0], [1.0], [1e-5]]) * cube().p, cube().t),
}


@pytest.mark.parametrize("name", OVERLAPPING)
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_overlaps_are_refused_at_any_scale_and_place(name, scale, shift):
    mesh = OVERLAPPING[name]
    assert lies_on_itself(mesh)
    assert is_refused(type(mesh)(scale * (mesh.p + shift), mesh.t))


@pytest.mark.parametrize("name", TOUCHING)
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_what_only_touches_itself_passes(name, scale, shift):
    mesh = TOUCHING[name]
    if name in ("needles", "flat boxes") and shift:
        pytest.skip("so far away the numbers of its nodes have no digits left for its height")
    assert not lies_on_itself(mesh)
    assert not is_refused(type(mesh)(scale * (mesh.p + shift), mesh.t))


def test_bent_sides_that_meet_on_a_circle_may_have_chords_that_cross():
    """Two rings that slide on one another, turned by half a side, the outer one thin."""
    inner, outer = ring(8, 1, 0.5, 1.0), ring(8, 1, 1.0, 1.05)
    turn = np.array([[np.cos(np.pi / 8), -np.sin(np.pi / 8)], [np.sin(np.pi / 8), np.cos(np.pi / 8)]])
    straight = joined(inner, MeshTri(turn @ outer.p, outer.t))
    with pytest.raises(ValueError, match=LIES):
        ka.KohonenMap(straight)
    bent = MeshTri2.from_mesh(straight)
    a, b = straight.p[:, bent.facets].transpose(1, 0, 2)
    radius, middle = np.hypot(*a), 0.5 * (a + b)
    round_ = np.isclose(radius, np.hypot(*b))
    p = np.hstack([straight.p, np.where(round_, middle * radius / np.hypot(*middle), middle)])
    assert ka.KohonenMap(MeshTri2(p, bent.t)).mesh.nelements == straight.nelements


def problem():
    return Magnetostatics({"air": Material(), "iron": Material(1000.0)}, {"outer": 0.0})


CALLS = {
    "relocate": lambda mesh: ka.relocate(mesh, np.ones(mesh.nelements)),
    "map": ka.KohonenMap,
    "adapt": lambda mesh: ka.adapt(mesh, problem()),
    "polish": lambda mesh: ka.polish(mesh, problem()),
    "interpolate": lambda mesh: ka.interpolate(mesh, mesh.p[0], mesh.p),
}


@pytest.mark.parametrize("call", CALLS)
def test_every_way_in_says_where_and_what_to_do(call):
    with pytest.raises(ValueError, match=LIES) as refused:
        CALLS[call](iron_over_air())
    assert "(subdomain 'iron') is on element" in str(refused.value)
    assert "(subdomain 'air'), so areas count twice. Cut the surfaces of the drawing at one another before" in str(
        refused.value
    )
    assert "BooleanFragments" in str(refused.value) and "Coherence" in str(refused.value)
