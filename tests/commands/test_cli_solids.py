"""The commands `check` and `relocate` on meshes of tetrahedra."""

import re

import numpy as np
import pytest
from helpers.cases import run_command, said_of, whole
from helpers.mesh_files import in_front, sizes, two_boxes
from helpers.meshes import centres
from helpers.random_solids import cone
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt.commands.check import faults
from kohonen_adapt.commands.plan import seams


def box(*cells, low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)):
    return MeshTet.init_tensor(*(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells, strict=True)))


def beside(one, other):
    """Two meshes as one, whose nodes are not joined."""
    return MeshTet(np.hstack([one.p, other.p]), np.hstack([one.t, one.nvertices + other.t]))


def test_a_good_solid(tmp_path, capsys):
    mesh = two_boxes(2)
    mesh = MeshTet(mesh.p, mesh.t, mesh.boundaries, {name: mesh.subdomains[name] for name in ("low", "upper half")})
    value, count = ka.quality(mesh), mesh.nelements
    lines = said_of(mesh, tmp_path, capsys).splitlines()
    half = count // 2
    assert lines[:3] == [
        f"size: 1 x 1 x 1 m, {mesh.nvertices} nodes, {count} tetrahedra",
        f"subdomain 'low': {half} tetrahedra, 0.5 m^3",
        f"subdomain 'upper half': {half} tetrahedra, 0.5 m^3",
    ]
    assert lines[3:7] == [
        "boundary 'outer': 32 facets, 1 m^2",
        "boundary 'sheet': 16 facets, 0.5042 m^2, 16 of them inside",  # its rim is no straight line
        "boundary 'wall': 32 facets, 1 m^2, 32 of them inside",
        "boundary 'with a corner': 64 facets, 2 m^2",
    ]
    assert lines[7] == f"coverage: {count} tetrahedra in one subdomain, 0 in none, 0 in two or more"
    assert re.fullmatch(rf"quality: worst {value.min():.3g} \(tetrahedron \d+ near \(.*\) m\), mean .*", lines[8])
    assert lines[10].startswith("surfaces: 13, 13 planes; ")
    assert re.fullmatch(r"nodes: \d+ free, \d+ on surfaces, \d+ on edges, \d+ fixed", lines[11])
    assert sum(map(int, re.findall(r"\d+", lines[11]))) == mesh.nvertices
    assert lines[12:] == ["No faults found."]


def test_dihedral_angles(tmp_path, capsys):
    """Of the corner of a cube: three right angles, and three of arctan sqrt(2)."""
    said = said_of(whole(MeshTet(np.eye(4)[1:], np.arange(4)[:, None])), tmp_path, capsys)
    assert "dihedral angles: from 54.7 to 90 degrees" in said


def test_names_that_are_missing(tmp_path, capsys):
    said = said_of(box(2, 2, 2).with_subdomains({"low": lambda x: x[2] < 0.5}), tmp_path, capsys)
    assert "- 24 tetrahedra are in no subdomain, one near (" in said and "Give every volume one physical group" in said
    assert "no boundary has a name" in said and "a physical group of surfaces" in said


def test_a_unit_that_is_doubtful_and_bad_elements(tmp_path, capsys):
    said = said_of(whole(box(1, 1, 1, high=(9.0, 9.0, 0.3))), tmp_path, capsys)
    assert "the mesh is 9 x 9 x 0.3 m: that looks like millimetres." in said
    assert re.search(r"hint: 6 tetrahedra have a quality below 0\.2, the default of min_quality; the worst", said)


def found(mesh):
    """Places of the nodes of every kind of fault."""
    return {called.split()[0]: mesh.p[:, nodes].T.tolist() for nodes, called, _ in seams(mesh) if len(nodes)}


def test_parts_that_are_not_joined():
    """Two cubes that were meshed alone: alike at the seam, they coincide; of half the size, others hang."""
    one, fine = box(1, 1, 1), box(2, 2, 2, low=(1.0, 0.0, 0.0), high=(2.0, 1.0, 1.0))
    alike = found(beside(one, box(1, 1, 1, low=(1.0, 0.0, 0.0), high=(2.0, 1.0, 1.0))))
    assert set(alike) == {"coincident"} and len(alike["coincident"]) == 8
    unlike = found(beside(one, fine))
    assert sorted(unlike["hanging"]) == [[1.0, *yz] for yz in [(0, 0.5), (0.5, 0), (0.5, 0.5), (0.5, 1), (1, 0.5)]]
    assert any("inside a face of another tetrahedron" in fault for fault in faults(whole(beside(one, fine))))


def test_parts_that_touch():
    grid = box(2, 2, 2)
    middle = centres(grid)
    octant = np.sum(middle > 0.5, axis=0)
    corner = grid.restrict(np.flatnonzero((octant == 0) | (octant == 3)))  # two cubes that have a corner in common
    assert found(corner) == {"non-manifold": [[0.5, 0.5, 0.5]]}
    edge = grid.restrict(np.flatnonzero((middle[0] > 0.5) == (middle[1] > 0.5)))
    assert sorted(found(edge)["non-manifold"]) == [[0.5, 0.5, 0.0], [0.5, 0.5, 0.5], [0.5, 0.5, 1.0]]
    assert found(grid) == {}
    assert any("touch only in a point or an edge" in fault for fault in faults(whole(edge)))


def test_curved_surfaces_that_nothing_was_recognised_as(tmp_path, capsys):
    mesh = box(4, 4, 4)
    x = mesh.p - 0.5
    scale = np.max(np.abs(x), axis=0) / np.maximum(np.linalg.norm(x * [[1.0], [0.8], [0.6]], axis=0), 1e-9)
    egg = MeshTet(0.1 * x * scale, mesh.t)  # an ellipsoid
    said = said_of(whole(egg), tmp_path, capsys)
    assert "plane surfaces of one or two faces in 'rim': their nodes do not move." in said


TOLD = 'side = {surface = "cone", apex = [0, 0, 2.0], axis = [0, 0, -1], half_angle = 0.4636476090008061}'


def test_surfaces_are_told_to_check_and_to_relocate(tmp_path, capsys):
    mesh, surface = cone(6)
    before, after = (str(tmp_path / name) for name in ("before.msh", "after.msh"))
    mesh = MeshTet(mesh.p, mesh.t, mesh.boundaries)
    ka.write_mesh(before, mesh)
    run_command("check", before)
    assert "1 cone" not in capsys.readouterr().out
    run_command("check", before, "--surfaces", TOLD)
    assert "surfaces: 3, 2 planes, 1 cone; 2 edges between them" in capsys.readouterr().out
    ka.write_mesh(tmp_path / "field.vtu", mesh, cell_data={"want": 1.0 + mesh.p[0, mesh.t].mean(axis=0) ** 2})
    density = ["--density", str(tmp_path / "field.vtu:want")]
    assert run_command("relocate", before, *density, "-o", after, "--surfaces", TOLD) == 0
    found = ka.read_mesh(after)
    x = found.p[:, np.unique(found.facets[:, found.boundaries["side"]])]
    assert np.abs(surface.project(x) - x).max() < 1e-12 and not np.array_equal(found.p, mesh.p)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("side = ka.Sphere", "Invalid value"),
        ("side = 3", "surfaces.side must be a table with a key surface, one of 'plane', 'sphere', 'cylinder', 'cone'"),
        ('side = {surface = "sphere", radius = 1.0}', "surfaces.side.centre is missing"),
        ('side = {surface = "sphere", centre = [0, 0, 0], radius = -1.0}', "surfaces.side: radius of a Sphere must be"),
    ],
)
def test_surfaces_that_are_none_are_refused(text, message, capsys):
    with pytest.raises(SystemExit):
        run_command("check", "it.msh", "--surfaces", text)
    assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_relocate_keeps_groups_and_goes_where_it_is_told(tmp_path, capsys, topology):
    mesh = two_boxes(2)
    x = centres(mesh)
    density = 1.0 + 20.0 * np.exp(-30.0 * np.sum((x - 0.3) ** 2, axis=0))
    before, out = (str(tmp_path / name) for name in ("before.msh2", "after.msh"))
    ka.write_mesh(before, mesh, cell_data={"want": density})
    assert run_command("relocate", before, "--density", f"{before}:want", "--topology", topology, "-o", out) == 0
    assert re.search(rf"{mesh.nvertices} nodes, worst quality 0\.\d\d; before 0\.\d\d\.", capsys.readouterr().out)
    after = ka.read_mesh(out)
    assert ka.read_groups(out).names == ka.read_groups(before).names
    assert sizes(after)[0] == pytest.approx(sizes(mesh)[0])
    assert all(low < 0.5 + 1e-12 for *_, low in in_front(after, "wall"))
    near = [np.sum(np.sum((each.p - 0.3) ** 2, axis=0) < 0.3**2) for each in (mesh, after)]
    assert near[1] > near[0]
