"""Fields of any order in VTU files: Lagrange cells, their nodes, sides on arcs, and means read back."""

import meshio
import numpy as np
import pytest
from helpers.curved_meshes import RADII, curved_annulus
from numpy.testing import assert_allclose
from skfem import Basis, MeshTet, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.display import lattice_points


def vtk_place(index, order):
    """``vtkHigherOrderTriangle::BarycentricIndex`` of VTK 9: barycentric coordinates of a node, in steps."""
    place, highest, lowest = [0, 0, 0], order, 0
    while index != 0 and index >= 3 * order:
        index, highest, lowest, order = index - 3 * order, highest - 2, lowest + 1, order - 3
    if index < 3:
        place[index], place[(index + 1) % 3], place[(index + 2) % 3] = lowest, lowest, highest
    else:
        side, step = divmod(index - 3, order - 1)
        place[(side + 1) % 3], place[(side + 2) % 3], place[side] = lowest, highest - 1 - step, lowest + 1 + step
    return place  # of the second, the third and the first corner


def crooked():
    mesh = MeshTri().refined(1)
    p = mesh.p + 0.1 * np.sin(3.0 * mesh.p[::-1])
    return MeshTri(p, mesh.t).with_subdomains({"low": lambda x: x[1] < 0.5})


def vtk_place_in_space(index, order):
    """``vtkHigherOrderTetra::BarycentricIndex`` of VTK 9: steps of a node towards the corners 1, 2, 3 and 0."""
    place, highest, lowest = [0, 0, 0, 0], order, 0
    while index != 0 and index >= 2 * (order * order + 1):
        index, highest, lowest, order = index - 2 * (order * order + 1), highest - 3, lowest + 1, order - 4
    if index < 4:
        place = [lowest] * 4
        place[(3, 0, 1, 2)[index]] = highest
        return place
    if index - 4 < 6 * (order - 1):
        side, step = divmod(index - 4, order - 1)
        a, b = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))[side]
        place = [lowest] * 4
        place[(a - 1) % 4], place[(b - 1) % 4] = highest - 1 - step, lowest + 1 + step
        return place
    face, step = divmod(index - 4 - 6 * (order - 1), (order - 1) * (order - 2) // 2)
    on_face = vtk_place(step, order - 3)
    for k, each in zip(((0, 2, 3), (2, 0, 1), (2, 1, 3), (1, 0, 3))[face], on_face, strict=True):
        place[k] = lowest + 1 + each
    place[(1, 3, 0, 2)[face]] = lowest
    return place


def crooked_solid():
    mesh = MeshTet().refined(1)
    p = mesh.p + 0.1 * np.sin(3.0 * mesh.p[[1, 2, 0]])
    t = mesh.t.copy()
    t[:2, ::2] = t[1::-1, ::2]  # elements of either sign
    return MeshTet(p, t).with_subdomains({"low": lambda x: x[1] < 0.5})


def polynomial(x, order):
    return (x[0] + 2.0 * x[1]) ** order - 3.0 * x[0] ** (order - 1) * x[1] + x[2:].sum(axis=0)


def points_of(mesh, order):
    return np.einsum("iq,dik->dqk", lattice_points(order, len(mesh.p)), mesh.p[:, mesh.t])


def mean_of(mesh, order):
    basis = Basis(mesh, mesh.elem(), intorder=9)
    values = polynomial(np.asarray(basis.global_coordinates()), order)
    return (values * basis.dx).sum(axis=1) / basis.dx.sum(axis=1)


@pytest.mark.parametrize(
    ("make", "order"),
    [*((crooked, order) for order in range(2, 9)), *((crooked_solid, order) for order in range(2, 7))],
)
def test_nodes_are_in_the_order_of_vtk_and_read_back_as_means(make, order, tmp_path):
    mesh = make()
    dim, x, flag = len(mesh.p), points_of(mesh, order), np.arange(mesh.nelements)
    data = {"u": polynomial(x, order), "x": mesh.p[0]}
    ka.write_mesh(tmp_path / "f.vtu", mesh, point_data=data, cell_data={"k": flag})
    read = meshio.read(tmp_path / "f.vtu")
    (block,) = read.cells
    assert block.type == "VTK_LAGRANGE_" + ("TRIANGLE" if dim == 2 else "TETRAHEDRON")
    assert block.data.shape == (mesh.nelements, x.shape[1])
    place = vtk_place if dim == 2 else vtk_place_in_space
    steps = np.array([place(k, order) for k in range(x.shape[1])])
    wanted = np.einsum("qi,dik->kqd", np.roll(steps, 1, axis=1) / order, mesh.p[:, mesh.t])
    assert_allclose(read.points[block.data][:, :, :dim], wanted, atol=1e-14)
    assert_allclose(read.point_data["u"][block.data], polynomial(wanted.T, order).T, rtol=1e-12)
    assert_allclose(read.point_data["x"][block.data], wanted[:, :, 0], atol=1e-14)
    assert list(read.cell_data["k"][0]) == list(flag) and "skfem:s:low" in read.cell_data
    mean = mean_of(mesh, order)
    assert_allclose(ka.read_field(tmp_path / "f.vtu", mesh, "u"), mean, atol=1e-11 * np.abs(mean).max())


@pytest.mark.parametrize("order", [2, 3, 4, 6])
def test_sides_are_on_the_arcs_above_order_3(order, tmp_path):
    mesh = curved_annulus(12)
    assert type(mesh) is MeshTri2
    zeros = np.zeros((lattice_points(order, 2).shape[1], mesh.nelements))
    ka.write_mesh(tmp_path / "f.vtu", mesh, point_data={"u": zeros, "r": np.hypot(*mesh.p)})
    read = meshio.read(tmp_path / "f.vtu")
    nodes = read.cells[0].data
    ends = np.hypot(*np.moveaxis(read.points[nodes[:, :3], :2], 2, 0))
    farthest = 0.0
    for radius in RADII.values():
        on = np.isclose(ends, radius)
        for side, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)]):
            own = nodes[on[:, a] & on[:, b], 3 + side * (order - 1) : 3 + (side + 1) * (order - 1)]
            farthest = max(farthest, np.abs(np.hypot(*read.points[own, :2].T) / radius - 1.0).max(initial=0.0))
    if order == 3:
        assert 1e-6 < farthest < 1e-3  # a parabola, the side of elements of order 3
    else:
        assert farthest < 1e-12


def test_positions_of_a_field_are_written_as_given(tmp_path):
    mesh, place = crooked(), points_of(crooked(), 3).reshape(2, -1) + 0.25
    ka.write_mesh(tmp_path / "f.vtu", mesh, point_data={"u": np.zeros((10, 8))}, positions=place)
    assert_allclose(meshio.read(tmp_path / "f.vtu").points[:, :2].T, place)


def test_values_for_linear_elements_jump_between_them(tmp_path):
    mesh = crooked()
    values = np.arange(3.0 * mesh.nelements).reshape(3, -1)
    ka.write_mesh(tmp_path / "f.vtu", mesh, point_data={"u": values})
    read = meshio.read(tmp_path / "f.vtu")
    assert_allclose(read.point_data["u"][read.cells_dict["triangle"]], values.T)


def test_a_field_file_is_no_mesh(tmp_path):
    ka.write_mesh(tmp_path / "f.vtu", crooked(), point_data={"u": np.zeros((6, 8))})
    with pytest.raises(
        ValueError, match="Lagrange cells hold a field inside elements; read the mesh from its own file"
    ):
        ka.read_mesh(tmp_path / "f.vtu")
