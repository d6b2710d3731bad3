"""Gmsh files of order 2 to 5: corners, the middles of sides, what is lost, and curves."""

import logging
import re

import meshio
import numpy as np
import pytest
from helpers.curved_meshes import annulus
from helpers.mesh_files import assert_same, drawn_by_gmsh, needs_gmsh
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.mesh.curved import corners_of

COUNT = 12


def on_arc(start, end, at):
    """Points at `at` from 0 to 1 of the arc around the origin if both ends are equally far, else of the chord."""
    radius, angle = np.hypot(*start), np.arctan2(start[1], start[0])
    if abs(np.hypot(*end) - radius) > 1e-9:
        return start + at * (end - start)
    turn = np.angle(complex(*end) / complex(*start))
    return radius * np.array([np.cos(angle + at * turn), np.sin(angle + at * turn)])


def write_of_order(path, mesh, order, side=on_arc):
    """A text file of MSH 2.2 with the nodes of `side(start, end, at)` on the sides, and centroids inside."""
    points, number, rows = list(mesh.p.T), {}, []
    inner = (order - 1) * (order - 2) // 2
    for corners in mesh.t.T.tolist():
        row = list(corners)
        for start, end in ((corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[0])):
            if (end, start) not in number:
                number[start, end] = [len(points) + k for k in range(order - 1)]
                points += [side(mesh.p[:, start], mesh.p[:, end], k / order) for k in range(1, order)]
            row += number[start, end] if (start, end) in number else number[end, start][::-1]
        rows.append([*row, *(len(points) + k for k in range(inner))])
        points += [mesh.p[:, corners].mean(axis=1)] * inner
    tags = {name: [np.ones(len(rows), int)] for name in ("gmsh:physical", "gmsh:geometrical")}
    file = meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), [(f"triangle{len(rows[0])}", rows)], cell_data=tags)
    meshio.gmsh.write(path, file, "2.2", binary=False)
    return path


@pytest.mark.parametrize("order", [3, 4, 5])
def test_midside_nodes_are_the_middles_of_the_polynomials(order, tmp_path, caplog):
    mesh = annulus(COUNT)
    with caplog.at_level(logging.INFO):
        read = ka.read_mesh(write_of_order(tmp_path / "ring.msh", mesh, order))
    assert type(read) is MeshTri2
    assert_array_equal(read.p[:, : read.nvertices], mesh.p)
    middles = read.p[:, read.nvertices :]
    round_ = np.ptp(np.hypot(*read.p[:, read.facets]), axis=0) < 1e-9
    share = np.hypot(*middles[:, round_]) / np.hypot(*read.p[:, read.facets[0, round_]]) - 1.0
    at = np.linspace(0.0, 1.0, order + 1)
    along = np.exp(1j * at * 2.0 * np.pi / COUNT)
    exact = abs(complex(*(np.polyval(np.polyfit(at, part, order), 0.5) for part in (along.real, along.imag))))
    assert_allclose(share, exact - 1.0, atol=1e-12)
    assert_allclose(middles[:, ~round_], read.p[:, read.facets[:, ~round_]].mean(axis=1), atol=1e-15)
    assert f"sides of order {order} of" in caplog.text and "nodes inside triangles are left out" in caplog.text


def wavy(start, end, at):
    across = np.array([start[1] - end[1], end[0] - start[0]])
    return start + at * (end - start) + 0.02 * np.sin(2.0 * np.pi * at) * across


@pytest.mark.parametrize(
    ("mesh", "side", "level", "said"),
    [
        (MeshTri().refined(1), wavy, "WARNING", "is off by 0.02 of its length, near ("),
        (annulus(COUNT), on_arc, "INFO", "become arcs"),
    ],
    ids=["waves", "arcs"],
)
def test_what_is_lost_is_a_warning_with_its_size_and_place(mesh, side, level, said, tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        ka.read_mesh(write_of_order(tmp_path / "m.msh", mesh, 4, side))
    (told,) = [record for record in caplog.records if "become arcs" in record.message]
    assert told.levelname == level and said in told.message


@pytest.mark.parametrize("order", [3, 4, 5])
def test_straight_sides_are_read_as_corners(order, tmp_path, caplog):
    mesh = MeshTri().refined(2)
    read = ka.read_mesh(write_of_order(tmp_path / "flat.msh", mesh, order, lambda a, b, at: a + at * (b - a)))
    assert type(read) is MeshTri and read.t.shape == mesh.t.shape and "become arcs" not in caplog.text


def test_a_side_node_out_of_the_plane_is_named(tmp_path):
    path = write_of_order(tmp_path / "ring.msh", annulus(COUNT), 3)
    first = annulus(COUNT).nvertices + 1
    path.write_text(re.sub(rf"(?m)^({first} .*) \S+e\S+$", r"\1 0.5", path.read_text()))
    with pytest.raises(ValueError, match=r"expected a drawing in the xy-plane; z runs from 0 to 0\.5"):
        ka.read_mesh(path)


DRAWING = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {2, 0, 0}; Point(4) = {0, 1, 0}; Point(5) = {0, 2, 0};
Circle(1) = {2, 1, 4}; Circle(2) = {3, 1, 5}; Line(3) = {2, 3}; Line(4) = {4, 5}; Line(5) = {1, 2}; Line(6) = {4, 1};
Curve Loop(1) = {5, 1, 6}; Plane Surface(1) = {1};
Curve Loop(2) = {3, 2, -4, -1}; Plane Surface(2) = {2};
Physical Surface("shaft", 1) = {1}; Physical Surface("gap", 2) = {2};
Physical Curve("interface", 1) = {1}; Physical Curve("outer", 2) = {2, 3, 4, 5, 6};
Mesh.MeshSizeMin = 0.4; Mesh.MeshSizeMax = 0.4;
"""


def by_gmsh(folder, order, version=4.1, binary=1):
    return drawn_by_gmsh(folder / "machine.msh", DRAWING, version, binary, order=order)


@needs_gmsh
@pytest.mark.parametrize(("version", "binary"), [(2.2, 0), (4.1, 1)])
@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_a_quarter_of_a_machine_by_gmsh(order, version, binary, tmp_path):
    path = by_gmsh(tmp_path, order, version, binary)
    mesh, straight = ka.read_mesh(path), ka.read_mesh(by_gmsh(tmp_path, 1, version, binary))
    path = by_gmsh(tmp_path, order, version, binary)
    assert type(mesh) is MeshTri2 and mesh.nvertices == straight.nvertices
    assert {name: len(rows) for name, rows in mesh.boundaries.items()} == {
        name: len(rows) for name, rows in straight.boundaries.items()
    }
    middles = mesh.p[:, mesh.nvertices :][:, mesh.boundaries["interface"]]
    assert_allclose(np.hypot(*middles), 1.0, rtol={2: 1e-9, 3: 1e-4}.get(order, 1e-6))
    if order == 2:
        assert_same(corners_of(mesh), straight)
    curves = ka.read_curves(path, mesh)
    assert set(curves) == {"interface", "outer"} and len(curves["outer"].pieces) == 3
    angle = np.linspace(0.0, np.pi / 2, 200)
    x = np.stack([np.cos(angle), np.sin(angle)])
    assert np.abs(curves["interface"].project(x) - x).max() < 3e-2 * 0.2**4
