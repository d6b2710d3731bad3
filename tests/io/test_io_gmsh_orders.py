"""Gmsh files of order 2 to 5: corners, the middles of sides, what is lost, and curves."""

import logging
import re

import numpy as np
import pytest
from helpers.mesh_files import assert_same, drawn_by_gmsh, needs_gmsh
from numpy.testing import assert_allclose
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.mesh.curved import corners_of

SQUARE = """SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1}; Physical Surface("square") = {1};
Mesh.MeshSizeMin = 0.4; Mesh.MeshSizeMax = 0.4;
"""
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


def drawn(folder, order, bend=lambda x: x):
    """A file of MSH 2.2 with the square by Gmsh, whose nodes (3, n) have gone to other places."""
    path = drawn_by_gmsh(folder / f"square_{order}.msh", SQUARE, "2.2", order=order)
    lines = path.read_text().split("\n")
    first, last = lines.index("$Nodes") + 2, lines.index("$EndNodes")
    number, *x = np.array([line.split() for line in lines[first:last]], float).T
    places = bend(np.array(x)).T.tolist()
    lines[first:last] = [f"{n:.0f} {' '.join(map(repr, place))}" for n, place in zip(number, places, strict=True)]
    path.write_text("\n".join(lines))
    return path


def bent(x, size=0.05, number=3.0):
    y = x.copy()
    y[:2] += size * np.sin(number * x[1::-1])
    return y


def waves(x):
    return bent(x, 0.02, 30.0)


@needs_gmsh
@pytest.mark.parametrize("order", [3, 4, 5])
def test_midside_nodes_are_the_middles_of_the_polynomials(order, tmp_path, caplog):
    straight = ka.read_mesh(drawn(tmp_path, 1))
    with caplog.at_level(logging.INFO):
        read = ka.read_mesh(drawn(tmp_path, order, bent))
    assert type(read) is MeshTri2
    assert_allclose(read.p[:, : read.nvertices], bent(straight.p), atol=1e-14)
    at = np.linspace(0.0, 1.0, order + 1)[:, None]
    one, other = straight.p[:, straight.facets].transpose(1, 0, 2)[:, :, None]
    middle = np.linalg.solve(np.vander(at[:, 0]).T, 0.5 ** np.arange(order, -1, -1))
    wanted = np.einsum("k,dkf->df", middle, bent(one + at * (other - one)))
    assert_allclose(read.p[:, read.nvertices :], wanted, atol=1e-12)
    assert f"sides of order {order} of" in caplog.text and "nodes inside triangles are left out" in caplog.text


@needs_gmsh
@pytest.mark.parametrize(
    ("draw", "level", "said"),
    [
        (lambda folder: drawn(folder, 4, waves), "WARNING", r"is off by 0\.\d+ of its length, near \("),
        (lambda folder: by_gmsh(folder, 4), "INFO", "become arcs"),
    ],
    ids=["waves", "arcs"],
)
def test_what_is_lost_is_a_warning_with_its_size_and_place(draw, level, said, tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        ka.read_mesh(draw(tmp_path))
    (told,) = [record for record in caplog.records if "become arcs" in record.message]
    assert told.levelname == level and re.search(said, told.message)


@needs_gmsh
@pytest.mark.parametrize("order", [3, 4, 5])
def test_straight_sides_are_read_as_corners(order, tmp_path, caplog):
    read, wanted = (ka.read_mesh(drawn(tmp_path, each)) for each in (order, 1))
    assert type(read) is MeshTri and "become arcs" not in caplog.text
    assert_same(read, wanted)


@needs_gmsh
def test_a_side_node_out_of_the_plane_is_refused(tmp_path):
    corners = ka.read_mesh(drawn(tmp_path, 1)).nvertices

    def lifted(x):
        return np.vstack([x[:2], 0.5 * (np.arange(x.shape[1]) == corners)])

    with pytest.raises(ValueError, match=r"expected a drawing in the xy-plane; z runs from 0 to 0\.5"):
        ka.read_mesh(drawn(tmp_path, 3, lifted))


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
