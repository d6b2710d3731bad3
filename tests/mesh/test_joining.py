"""Two meshes become one along their shared outline, and a part of a mesh turns by whole steps of the circle around."""

import numpy as np
import pytest
from helpers.meshes import centres, circle, disk, ring, shells, square
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri, MeshTri2
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.mesh.curved import (
    corners_of,
    midside_offsets,
    offsets_of_sides,
    with_midside_offsets,
)
from kohonen_adapt.mesh.measures import area

N = 24  # nodes on the circle
STEP = 2 * np.pi / N


def rotor():
    mesh = disk(4, 0.5).with_subdomains({"iron": lambda x: x[0] < 0.2, "air": lambda x: x[0] >= 0.2})
    return mesh.with_boundaries({"rim": mesh.boundary_facets(), "outer": mesh.boundary_facets()[:2]})


def stator(n=N):
    mesh = ring(n, 3)
    return mesh.with_subdomains({"air": lambda x: np.hypot(*x) < 0.7, "yoke": lambda x: np.hypot(*x) >= 0.7})


def rotated(mesh, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return MeshTri(turn @ mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)


def bits(*meshes):
    return [np.concatenate([x.ravel() for x in (mesh.p, mesh.t, *mesh.subdomains.values())]) for mesh in meshes]


def test_a_rotor_and_a_stator_become_one():
    inner, outer = rotor(), stator()
    before = bits(inner, outer)
    mesh = ka.merge(inner, outer)
    assert mesh.is_valid() and mesh.p.shape[1] == inner.p.shape[1] + outer.p.shape[1] - N
    assert mesh.p.flags.c_contiguous and mesh.t.flags.c_contiguous
    assert_array_equal(mesh.p[:, mesh.t[:, : inner.nelements]], inner.p[:, inner.t])
    assert_allclose(centres(mesh)[:, inner.nelements :], centres(outer), atol=1e-15)
    assert {name: area(mesh)[rows].sum() for name, rows in mesh.subdomains.items()} == pytest.approx(
        {
            "iron": area(inner)[inner.subdomains["iron"]].sum(),
            "air": area(inner)[inner.subdomains["air"]].sum() + area(outer)[outer.subdomains["air"]].sum(),
            "yoke": area(outer)[outer.subdomains["yoke"]].sum(),
        }
    )
    radius = np.hypot(*mesh.p)
    assert_allclose(radius[mesh.facets[:, mesh.boundaries["rim"]]], 0.5)
    assert_array_equal(mesh.boundaries["rim"], mesh.boundaries["inner"])
    assert np.all(mesh.f2t[1, mesh.boundaries["rim"]] >= 0)
    assert_allclose(np.unique(np.round(radius[mesh.facets[:, mesh.boundaries["outer"]]], 9)), [0.5, 1.0])
    assert len(mesh.boundaries["outer"]) == N + 2
    for was, now in zip(before, bits(inner, outer), strict=True):
        assert_array_equal(was, now)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (
            rotated(stator(), STEP / 2),
            r"^the outline that the meshes share must have the same nodes in both, within 1\.98289e-06 \(rtol\); the "
            rf"farthest, at \(.*\), is {np.sin(STEP / 4):.6g} from the nearest node of the other mesh\. Mesh it ",
        ),
        (stator().translated((1e-3, 0.0)), r"is 0\.001 from the nearest node of the other mesh"),
        (stator(30), r"the outline that the meshes share must have the same nodes in both"),
        (stator(12), r"the outline that the meshes share must have the same nodes in both"),
        (
            stator().translated((2.0, 0.0)),
            r"^the meshes must share an outline, facet by facet; they share none, and the nearest of their nodes are ",
        ),
        (
            rotated(square(2), -np.pi / 4).translated((0.5, 0.0)),
            r"they share none, and the nearest of their nodes are 0 apart",
        ),
        (rotor(), r"^the meshes overlap: 96 elements of the second have their middle in the other, the first at \(0\."),
        (disk(8, 3.0), r"^the meshes overlap: "),
        (square(2).to_meshquad() if hasattr(MeshTri, "to_meshquad") else "mesh", r"^mesh must be a skfem\.MeshTri"),
    ],
)
def test_what_cannot_be_merged(other, message):
    with pytest.raises(ValueError, match=message):
        ka.merge(rotor(), other)


def test_a_tolerance_that_is_none():
    with pytest.raises(ValueError, match=r"^rtol must be a number from 0 to below 1; got -1\.$"):
        ka.merge(rotor(), stator(), rtol=-1)
    with pytest.raises(ValueError, match=r"^nodes nearer to one another than 0\.2 become one, but outlines have sev"):
        ka.merge(rotor(), stator(48), rtol=0.1)


# --- turning -----------------------------------------------------------------------------------------------------


def machine():
    """A magnet on a shaft of air, in a rotor of air, in a stator of air; "rotor" is all that turns."""
    mesh = ka.merge(disk(16, 0.5), ring(96, 16, inner=0.5, outer=2.0))
    radius = np.hypot(*centres(mesh))
    places = {"magnet": radius < 0.25, "air": radius >= 0.25, "rotor": radius < 0.5}
    mesh = mesh.with_subdomains({name: np.flatnonzero(at) for name, at in places.items()})
    ends = np.hypot(*mesh.p[:, mesh.facets])
    mark = np.all(np.abs(ends - 0.25) < 1e-9, axis=0)  # half of the magnet's rim
    half = mark & (mesh.p[0, mesh.facets].mean(axis=0) > 0.0)
    ring_ = np.all(np.abs(ends - 0.5) < 1e-9, axis=0)
    names = {"pole": half, "ring": ring_, "outer": np.all(ends > 1.999, axis=0)}
    return MeshTri(mesh.p, mesh.t, {name: np.flatnonzero(at) for name, at in names.items()}, mesh.subdomains)


def on_arcs(mesh):
    """The mesh with sides that join two nodes of a circle about the origin bent to it, and all others at random."""
    middle, radius = mesh.p[:, mesh.facets].mean(axis=1), np.hypot(*mesh.p[:, mesh.facets])
    round_ = np.ptp(radius, axis=0) < 1e-9
    to_arc = middle * (radius.mean(axis=0) / np.maximum(np.hypot(*middle), 1e-9) - 1.0)
    return with_midside_offsets(
        mesh, np.where(round_, to_arc, np.random.default_rng(3).normal(scale=1e-3, size=(2, 1)))
    )


CENTRE = 3.0 - 1.0j


@pytest.mark.parametrize("bend", [corners_of, on_arcs], ids=["straight", "bent"])
@pytest.mark.parametrize("steps", [-8, 1, 24, 200])
def test_what_turns_is_carried_and_the_rest_stays(steps, bend):
    mesh, angle = bend(machine()).translated((CENTRE.real, CENTRE.imag)), 2 * np.pi * steps / 96
    new = ka.turned(mesh, "rotor", angle, centre=(CENTRE.real, CENTRE.imag))
    assert type(new) is type(mesh) and corners_of(new).is_valid()
    assert new.p.shape == mesh.p.shape and new.p.flags.c_contiguous
    turn = np.where(np.isin(np.arange(mesh.nelements), mesh.subdomains["rotor"]), np.exp(1j * angle), 1.0)
    was, now = (each.p[0, each.t] + 1j * each.p[1, each.t] - CENTRE for each in map(corners_of, (mesh, new)))
    assert_allclose(now.mean(axis=0), turn * was.mean(axis=0), atol=1e-14)
    was, now = (each[0] + 1j * each[1] for each in map(midside_offsets, (mesh, new)))
    assert_allclose(now, turn * was, atol=1e-12)  # the circle is whole: nodes keep their numbers
    for name, rows in mesh.subdomains.items():
        assert_array_equal(new.subdomains[name], rows)
    assert {name: len(rows) for name, rows in new.boundaries.items()} == {"pole": 24, "ring": 96, "outer": 96}
    x, y = new.p[:, new.facets[:, new.boundaries["pole"]]].mean(axis=1)
    assert np.all(((x + 1j * y - CENTRE) * np.exp(-1j * angle)).real > 0.0)
    assert len(new.boundary_facets()) == 96


def by_place(mesh):
    """Corners and displacements of elements, (nelements, 3, 2) each, the corners of an element in order of their x."""
    x, off = mesh.p[:, mesh.t].T, midside_offsets(mesh).T
    order = np.argsort(np.round(x @ [1.0, 0.1], 9), axis=1)[:, :, None]
    return np.take_along_axis(x, order, axis=1), np.take_along_axis(off, order, axis=1)


def test_bent_meshes_become_one_with_their_bends():
    """The circle between them is bent as the second has it."""
    inner, outer = rotor(), on_arcs(stator())
    for one, other in ((on_arcs(inner), outer), (inner, outer), (outer, on_arcs(inner))):
        mesh = ka.merge(one, other)
        assert type(mesh) is MeshTri2
        assert_array_equal(corners_of(mesh).p, ka.merge(corners_of(one), corners_of(other)).p)
        (x, found), (_, first), (_, second) = (by_place(each) for each in (mesh, one, other))
        assert_allclose(found[one.nelements :], second, atol=1e-15)
        differ = np.abs(found[: one.nelements] - first).max(axis=(1, 2)) > 1e-15
        assert np.sum(differ) == (N if one is inner else 0)
        assert np.all(np.hypot(*x[: one.nelements][differ].T).max(axis=0) > 0.49)
        assert_allclose(area(mesh).sum(), np.pi, rtol=1e-3)
    assert not np.any(offsets_of_sides(ka.merge(inner, stator())))


def test_what_is_turned_out_of_a_sector_stays_there():
    """A quarter of a ring: of twelve steps three come apart at each end, and keep their names; back they meet again."""
    unit = square(12)
    r, angle = 0.5 + unit.p[0], 0.5 * np.pi * unit.p[1]
    mesh = MeshTri(np.stack([r * np.cos(angle), r * np.sin(angle)]), unit.t)
    inside = np.flatnonzero(centres(unit)[0] < 0.5)
    seam = unit.facets_satisfying(lambda x: np.abs(x[0] - 0.5) < 1e-9)
    seam = OrientedBoundary(seam, np.where(np.isin(unit.f2t[0, seam], inside), 0, 1))
    mesh = mesh.with_subdomains({"rotor": inside}).with_boundaries({"ring": seam})
    new = ka.turned(mesh, "rotor", np.pi / 8)
    ring_ = new.boundaries["ring"]
    assert new.p.shape[1] == mesh.p.shape[1] + 3 and len(ring_) == 15
    assert len(np.intersect1d(ring_, new.boundary_facets())) == 6
    assert_allclose(np.hypot(*new.p[:, new.facets[:, ring_]]), 1.0)
    between = new.f2t[1, np.asarray(ring_)] >= 0
    assert np.isin(new.f2t[ring_.ori, np.asarray(ring_)][between], inside).all()
    assert np.all(new.f2t[ring_.ori, np.asarray(ring_)] >= 0)
    back = ka.turned(new, "rotor", -np.pi / 8)
    assert back.p.shape == mesh.p.shape and len(back.boundaries["ring"]) == 12
    with pytest.raises(ValueError, match=r"^turned by 2\.61799 rad 'rotor' and the rest meet nowhere; turn it by les"):
        ka.turned(mesh, "rotor", 20 * np.pi / 24)


def uneven():
    """The same ring of nodes but for one."""
    angle = np.arange(24) * STEP + np.where(np.arange(24) == 5, 0.01, 0.0)
    middle = 0.5 * np.stack([np.cos(angle), np.sin(angle)])
    mesh = shells([0.2 * circle(24), middle, circle(24)], 2)
    return mesh.with_subdomains({"rotor": np.flatnonzero(np.arange(mesh.nelements) % 96 < 48)})


@pytest.mark.parametrize(
    ("change", "arguments", "message"),
    [
        (
            {},
            ("rotor", 0.1),
            r"^angle must be whole steps of the nodes on the circle, 0\.0654498469 rad \(3\.75 degrees\) each; got "
            r"0\.1 rad\. The nearest two are 0\.0654498469 and 0\.130899694 rad\.$",
        ),
        ({}, ("rotor", -0.1), r"The nearest two are -0\.130899694 and -0\.0654498469 rad\.$"),
        ({}, ("rotr", 0.0), r"^subdomain 'rotr' is not in the mesh; it has 'air', 'magnet', 'rotor'"),
        ({}, ([], 0.0), r"^a body is the name of a subdomain or a sequence of names; got \[\]\."),
        ({}, (["magnet", "air"], 0.0), r"^a part of the mesh must turn in the rest of it; .* is all\."),
        (
            {"centre": (0.01, 0.0)},
            ("rotor", 0.0),
            r"^what turns and the rest must meet on circles about \(0\.01, 0\.0\); ",
        ),
        (
            {"half": True},
            ("half", 0.0),
            r"they meet elsewhere, too, as at \(.*Name all that turns, up to a ring",
        ),
    ],
)
def test_what_cannot_turn(change, arguments, message):
    mesh = machine()
    if change.pop("half", False):
        mesh = mesh.with_subdomains({"half": lambda x: x[0] < 0.0})
    with pytest.raises(ValueError, match=message):
        ka.turned(mesh, *arguments, **change)


def test_nodes_that_are_not_evenly_spaced_are_refused():
    angle = r"15(\.0*\d*)? degrees|14\.427 to 15\.573 degrees"
    mesh = uneven()
    rotor_ = np.flatnonzero(np.hypot(*centres(mesh)) < 0.5 * np.cos(STEP / 2))
    with pytest.raises(ValueError, match=rf"must be evenly spaced; they are ({angle}) apart\. Mesh it so"):
        ka.turned(mesh.with_subdomains({"rotor": rotor_}), "rotor", STEP)
