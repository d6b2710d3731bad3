"""Metric tensors in files: every format gives the same tensors, in the order of its components."""

import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers.mesh_files import as_list, gmsh, gmsh_session, needs_gmsh, of_meshio, two_boxes, two_rooms
from helpers.meshes import centres
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm, logm
from skfem import MeshTri

import kohonen_adapt as ka

DATA = Path(__file__).parent / "data"
MESHES = {2: two_rooms(), 3: two_boxes(2)}
FULL = {2: [0, 1, 2, 3], 3: list(range(9))}
SYMMETRIC = {2: [0, 3, 1], 3: [0, 4, 8, 1, 5, 2]}  # XX, YY, XY; XX, YY, ZZ, XY, YZ, XZ
ROWS_OF_UPPER = {3: [0, 1, 2, 4, 5, 8]}
LOWER = {2: [0, 2, 3], 3: [0, 3, 4, 6, 7, 8]}
LAYOUTS = [
    *[(dim, suffix, layout) for dim in (2, 3) for suffix in (".vtu", ".vtk") for layout in (FULL, SYMMETRIC)],
    *[(dim, ".med", FULL) for dim in (2, 3)],
    *[(3, ".xdmf", layout) for layout in (FULL, ROWS_OF_UPPER)],
]


def metric_at(x):
    """Directions and ratios that turn and grow with the place, (n, d, d) at points (d, n)."""
    d = len(x)
    constant, slopes = np.random.default_rng(d).normal(size=(d, d)), np.random.default_rng(0).normal(size=(d, d, d))
    factors = constant + np.einsum("kn,kij->nij", x, slopes)
    return factors @ factors.transpose(0, 2, 1) + np.eye(d)


def log_means(mesh, nodal):
    with warnings.catch_warnings(action="ignore"):  # of errors below 1e-12
        logs = np.array([logm(tensor) for tensor in nodal])
    return np.array([expm(tensor) for tensor in logs[mesh.t].mean(axis=0)])


def padded(tensors, fill=0.0):
    """Tensors of the plane with a third row and column, as ParaView needs them."""
    full = np.zeros((len(tensors), 3, 3))
    full[:, 2, 2] = fill
    full[:, : tensors.shape[1], : tensors.shape[1]] = tensors
    return full


def write_field(path, mesh, values, nodal):
    if path.suffix in (".med", ".xdmf"):
        pytest.importorskip("h5py")
    data = {"point_data": {"m": values}} if nodal else {"cell_data": {"m": [values]}}
    of_meshio(mesh, **data).write(path)


def write_solution(path, *solutions, dim=2):
    """Solutions (types, rows) as Medit has them."""
    kinds = " ".join(str(kind) for kind, _ in solutions)
    rows = "\n".join(" ".join(map(repr, row)) for row in np.column_stack([rows for _, rows in solutions]).tolist())
    count = len(solutions[0][1])
    head = f"MeshVersionFormatted 2\n\nDimension {dim}\n\nSolAtVertices\n{count}\n{len(solutions)} {kinds}\n"
    path.write_text(f"{head}{rows}\n\nEnd\n")
    return path


def lower(tensors):
    return tensors.reshape(len(tensors), -1)[:, LOWER[tensors.shape[1]]]


@pytest.mark.parametrize("nodal", [False, True], ids=["cells", "points"])
@pytest.mark.parametrize(("dim", "suffix", "layout"), LAYOUTS)
def test_components_in_the_order_of_the_format(tmp_path, dim, suffix, layout, nodal):
    mesh, path = MESHES[dim], tmp_path / f"f{suffix}"
    tensors = metric_at(mesh.p if nodal else centres(mesh))
    write_field(path, mesh, tensors.reshape(len(tensors), -1)[:, layout[dim]], nodal)
    got = ka.read_field(path, mesh, "m")
    assert_array_equal(got, np.swapaxes(got, 1, 2))
    assert_allclose(got, log_means(mesh, tensors) if nodal else tensors, rtol=1e-11)


@pytest.mark.parametrize("fill", [0.0, 1.0])
@pytest.mark.parametrize("components", [9, 6])
def test_of_tensors_in_space_the_part_in_the_plane_is_read(tmp_path, components, fill):
    mesh = MESHES[2]
    tensors = metric_at(centres(mesh))
    rows = padded(tensors, fill).reshape(-1, 9)
    write_field(tmp_path / "f.vtu", mesh, rows if components == 9 else rows[:, SYMMETRIC[3]], nodal=False)
    assert_allclose(ka.read_field(tmp_path / "f.vtu", mesh, "m"), tensors, rtol=1e-15)


@needs_gmsh
@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
@pytest.mark.parametrize("kind", ["NodeData", "ElementData", "ElementNodeData"])
@pytest.mark.parametrize(("dim", "version", "components"), [(2, 2.2, 1), (2, 4.1, 1), (2, 4.1, 9), (3, 4.1, 9)])
def test_views_that_gmsh_saves(tmp_path, dim, version, components, kind, binary):
    mesh = MESHES[dim]
    if components == 1:
        nodal = 1.0 + mesh.p[0] + 2.0 * mesh.p[1]
        cellwise = means = nodal[mesh.t].mean(axis=0)
    else:
        nodal, cellwise = metric_at(mesh.p), metric_at(centres(mesh))
        means = log_means(mesh, nodal)
    ka.write_mesh(tmp_path / "m.msh", mesh)
    with gmsh_session() as model:
        gmsh.open(str(tmp_path / "m.msh"))
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("PostProcessing.SaveMesh", 1)
        tags = 1 + np.arange(mesh.nvertices if kind == "NodeData" else mesh.nelements)
        values = {"NodeData": nodal, "ElementData": cellwise, "ElementNodeData": np.concatenate(nodal[mesh.t.T])}[kind]
        values = values if components == 1 else padded(values)
        view = gmsh.view.add("m")
        gmsh.view.addHomogeneousModelData(
            view, 0, model.getCurrent(), kind, tags, values.ravel(), numComponents=components
        )
        gmsh.view.write(view, str(tmp_path / "f.msh"))
    wanted = cellwise if kind == "ElementData" else means
    assert_allclose(ka.read_field(tmp_path / "f.msh", mesh, "m"), wanted, rtol=1e-11)


def test_lists_of_tensors(tmp_path):
    mesh = MESHES[2]
    nodal = metric_at(mesh.p)
    rows = padded(nodal).reshape(-1, 9)[mesh.t.T].reshape(mesh.nelements, -1)
    (tmp_path / "f.pos").write_text(as_list(mesh, rows, "m", "TT"))
    assert_allclose(ka.read_field(tmp_path / "f.pos", mesh, "m"), log_means(mesh, nodal), rtol=1e-11)


@pytest.mark.parametrize("dim", [2, 3])
def test_solutions_of_medit(tmp_path, dim):
    mesh = MESHES[dim]
    nodal, h = metric_at(mesh.p), 1.0 + mesh.p[0]
    solutions = (3, lower(nodal)), (1, h[:, None]), (2, mesh.p.T), (4, nodal.reshape(len(nodal), -1))
    path = write_solution(tmp_path / "f.sol", *solutions, dim=dim)
    for name in ("solution 1", "solution 4"):
        assert_allclose(ka.read_field(path, mesh, name), log_means(mesh, nodal), rtol=1e-11)
    assert_allclose(ka.read_field(path, mesh, "solution 2"), h[mesh.t].mean(axis=0), rtol=1e-14)
    with pytest.raises(ValueError, match=r"'solution 3' of '.*' must be one real number or a tensor .*; got \d comp"):
        ka.read_field(path, mesh, "solution 3")
    with pytest.raises(ValueError, match=r"must have one field if no name is given; its fields are: 'solution 1', "):
        ka.read_field(path, mesh)


@pytest.mark.parametrize("text", ["{0} {1} {2} {3} {4}", "# of Mmg\n{0}\n\n{1}\n{2} # here\n{3}\n{4}"])
def test_the_only_solution_needs_no_name_and_blanks_separate(tmp_path, text):
    mesh = MeshTri()
    parts = ["MeshVersionFormatted 1", "Dimension 2", "SolAtVertices 4 1 3", "4 0 1 4 0 1 4 0 1 4e0 0E0 1", "End"]
    (tmp_path / "f.sol").write_text(text.format(*parts))
    assert_allclose(ka.read_field(tmp_path / "f.sol", mesh), np.tile(np.diag([4.0, 1.0]), (2, 1, 1)), rtol=1e-14)


def test_solutions_belong_to_the_mesh_beside_them(tmp_path):
    """The nodes of a `.sol` file are in the order of its mesh file, whatever the order in the mesh."""
    mesh, rng = MESHES[2], np.random.default_rng(0)
    order = rng.permutation(mesh.nvertices)
    other = MeshTri(mesh.p[:, order], np.argsort(order)[mesh.t])
    nodal = metric_at(mesh.p)
    write_solution(tmp_path / "f.sol", (3, lower(nodal[order])))
    meshio.Mesh(other.p.T, [("triangle", other.t.T)]).write(tmp_path / "f.mesh")
    assert_allclose(ka.read_field(tmp_path / "f.sol", mesh), log_means(mesh, nodal), rtol=1e-11)
    scaled = mesh.scaled(1e-3)
    assert_allclose(ka.read_field(tmp_path / "f.sol", scaled, scale=1e3), log_means(mesh, nodal), rtol=1e-11)


def test_solutions_of_another_mesh(tmp_path):
    path = write_solution(tmp_path / "f.sol", (1, np.ones((9, 1))))
    message = (
        r"^read_field expected a solution at the 45 nodes of the mesh, in their order; '.*f\.sol' has 9 vertices\. Put "
        r"the mesh of the solution beside it, as 'f\.mesh', and read the mesh from this file\.$"
    )
    with pytest.raises(ValueError, match=message):
        ka.read_field(path, MESHES[2])
    meshio.Mesh(MESHES[2].p.T, [("triangle", MESHES[2].t.T)]).write(tmp_path / "f.mesh")
    with pytest.raises(ValueError, match=r"at the 45 vertices of '.*f\.mesh'; '.*f\.sol' has 9 vertices\."):
        ka.read_field(path, MESHES[2])
    path = write_solution(tmp_path / "f.sol", (1, np.ones((45, 1))))
    with pytest.raises(ValueError, match=r"expected a field on the mesh, of 9 nodes and 8 triangles; .* 45 and 64\."):
        ka.read_field(path, MeshTri().refined(1))


@pytest.mark.parametrize(("name", "nodes"), [("mmg_plane", 70), ("mmg_solid", 84)])
def test_edges_of_mmg_have_length_one_in_the_metric_of_its_solution(name, nodes):
    """Their lengths are not, if a component is in another place."""
    mesh = ka.read_mesh(DATA / f"{name}.mesh")
    metric, corners = ka.read_field(DATA / f"{name}.sol", mesh), mesh.p[:, mesh.t]
    edges = np.stack([corners[:, i] - corners[:, j] for i in range(len(mesh.t)) for j in range(i)])
    lengths = np.sqrt(np.einsum("edm,mdc,ecm->em", edges, metric, edges))
    assert mesh.nvertices == nodes and set(mesh.subdomains) == {"region_1", "region_2"}
    assert_allclose(np.quantile(lengths, [0.05, 0.5, 0.95]), [0.5, 0.85, 1.2], atol=0.1)
    assert np.linalg.cond(metric).max() > 7.0


BEGIN = "MeshVersionFormatted 2 Dimension 2 "
BROKEN = {
    "Dimension 2 SolAtVertices 4 1 1 1 1 1 1": "MeshVersionFormatted is missing",
    f"{BEGIN} SolAtTriangles 2 1 1 1 1": "SolAtVertices is missing, its values are SolAtTriangles",
    "MeshVersionFormatted 2 Dimension 4 SolAtVertices 4 1 1 1 1 1 1": "its dimension is 4",
    f"{BEGIN} SolAtVertices 4 1 3 1 0 1": "it announces 12 values at 4 vertices and has 3",
    f"{BEGIN} SolAtVertices 4 1 7 1 1 1 1": r"its solutions have the types \[7\]; 1 to 4 are known",
    f"{BEGIN} SolAtVertices 4": "its number of vertices or of solutions is missing",
    f"{BEGIN} SolAtVertices 4 1 1 1 one 1 1": "a section of numbers has other text",
    "\1\0\0\0\2\0\0\0": "MeshVersionFormatted is missing",
}


@pytest.mark.parametrize(("text", "reason"), BROKEN.items(), ids=BROKEN.values())
def test_damaged_solutions(tmp_path, text, reason):
    (tmp_path / "f.sol").write_text(text)
    start = r"^read_field expected a solution of Medit or Mmg as text; '.*f\.sol' cannot be read: "
    with pytest.raises(ValueError, match=f"{start}{reason}"):
        ka.read_field(tmp_path / "f.sol", MeshTri())


def test_binary_solutions_are_refused_with_the_remedy(tmp_path):
    (tmp_path / "f.solb").write_bytes(b"\1\0\0\0\2\0\0\0")
    message = r"expected a file name that ends in .*\.sol; got 'f\.solb'\. Write the binary solution as text: Mmg does "
    with pytest.raises(ValueError, match=message):
        ka.read_field(tmp_path / "f.solb", MeshTri())


@pytest.mark.parametrize("components", [3, 4, 5, 6])
def test_vectors_and_tensors_of_the_plane_are_no_tensors_in_space(tmp_path, components):
    mesh = MESHES[3]
    write_field(tmp_path / "f.med", mesh, np.ones((mesh.nelements, components)), nodal=False)
    with pytest.raises(ValueError, match=f"must be one real number or a tensor .*; got {components} components"):
        ka.read_field(tmp_path / "f.med", mesh, "m")
