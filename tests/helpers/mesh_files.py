"""Meshes with names for the tests of files, and Gmsh where it can be imported."""

from contextlib import contextmanager
from math import factorial

import meshio
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

try:
    import gmsh
except (ImportError, OSError) as error:  # the wheel needs system libraries
    gmsh = None
    WHY_NOT = f"gmsh cannot be imported: {error}"
else:
    WHY_NOT = ""

needs_gmsh = pytest.mark.skipif(gmsh is None, reason=WHY_NOT)
SUFFIXES = [".msh", ".msh2", ".vtu"]
FORMATS = [("2.2", "text"), ("2.2", "binary"), ("4.1", "text"), ("4.1", "binary")]  # of Gmsh's files


@contextmanager
def gmsh_session():
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        yield gmsh.model
    finally:
        gmsh.finalize()


def two_rooms():
    """Two squares side by side with an interface, a group over both, a part without a name."""
    mesh = MeshTri.init_tensor(np.linspace(0, 2, 9), np.linspace(0, 1, 5) / 3)
    mesh = mesh.with_subdomains(
        {
            "left": lambda x: x[0] < 1,
            "right side": lambda x: x[0] > 1,
            "low": lambda x: (x[1] < 0.15) & (x[0] < 1.5),
        }
    )
    return mesh.with_boundaries(
        {
            "outer": lambda x: (x[0] == 0) | (x[0] == 2),
            "floor": lambda x: x[1] == 0,
            "wall and floor": lambda x: (x[1] == 0) | (x[0] == 0),
            "interface": lambda x: x[0] == 1,
        },
        boundaries_only=False,
    )


def two_boxes(cells=3):
    """Two halves of a cube, distorted inside, with the wall between them, facing down, and a sheet in the upper one."""
    mesh = MeshTet.init_tensor(*[np.linspace(0, 1, 2 * cells + 1)] * 3)
    inner = np.setdiff1d(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
    inner = inner[np.abs(mesh.p[2, inner] - 0.5) > 0.1]
    p = mesh.p.copy()
    p[:2, inner] += np.random.default_rng(0).uniform(-0.05, 0.05, (2, len(inner)))
    mesh = (
        MeshTet(p, mesh.t)
        .oriented()
        .with_subdomains(
            {"low": lambda x: x[2] < 0.5, "upper half": lambda x: x[2] > 0.5, "left": lambda x: x[0] < 0.3}
        )
    )
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    sheet = (np.abs(middle[2] - 0.5 - 0.5 / cells) < 1e-9) & (middle[0] < 0.5)
    places = {"outer": middle[0] == 0, "with a corner": (middle[0] == 0) | (middle[1] == 0), "sheet": sheet}
    named = {name: np.flatnonzero(place).astype(np.int32) for name, place in places.items()}
    wall = mesh.facets_around("low")
    inside = mesh.f2t[1, wall] >= 0
    return MeshTet(mesh.p, mesh.t, named | {"wall": OrientedBoundary(wall[inside], wall.ori[inside])}, mesh.subdomains)


def assert_same(mesh, other):
    assert type(mesh) is type(other)
    assert_array_equal(mesh.p, other.p)
    assert_array_equal(mesh.t, other.t)
    for got, wanted in ((mesh.subdomains, other.subdomains), (mesh.boundaries, other.boundaries)):
        assert (got is None) == (wanted is None)
        assert set(got or ()) == set(wanted or ())
        for name in wanted or ():
            assert_array_equal(got[name], np.sort(np.asarray(wanted[name])))


def assert_same_directions(mesh, other):
    """Assert that boundaries with a direction in the other mesh have the same direction in this one."""
    for name, rows in (other.boundaries or {}).items():
        if isinstance(rows, OrientedBoundary):
            assert isinstance(mesh.boundaries[name], OrientedBoundary) and in_front(mesh, name) == in_front(other, name)


def in_front(mesh, name):
    """For every facet of a boundary, in no order, where it is and where the element is that it faces."""
    boundary = mesh.boundaries[name]
    element = mesh.f2t[getattr(boundary, "ori", 0), boundary]
    places = [mesh.p[:, mesh.facets[:, boundary]].mean(axis=1), mesh.p[:, mesh.t[:, element]].mean(axis=1)]
    return sorted(map(tuple, np.vstack(places).round(12).T.tolist()))


def groups_in_gmsh(path):
    """Return name, rows of nodes and their places of every physical group in Gmsh, by dimension and number."""
    groups = {}
    with gmsh_session() as model:
        gmsh.open(str(path))
        for dimension, tag in model.getPhysicalGroups():
            nodes = []
            for entity in model.getEntitiesForPhysicalGroup(dimension, tag):
                kinds, _, rows = model.mesh.getElements(dimension, entity)
                assert list(kinds) == [(15, 1, 2, 4)[dimension]]
                nodes += [row.reshape(-1, dimension + 1) for row in rows]
            rows = np.unique(np.sort(np.concatenate(nodes), axis=1), axis=0)  # in MSH 2.2 some are there twice
            places = np.array([[model.mesh.getNode(node)[0] for node in row] for row in rows])
            groups[dimension, tag] = model.getPhysicalName(dimension, tag), rows, places
    return groups


def measures(corners):
    """Lengths, areas or volumes of simplices by their corners (count, corners, dim); of points 1."""
    edges = corners[:, 1:] - corners[:, :1]
    return np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))) / factorial(edges.shape[1])


def sizes(mesh):
    """What subdomains and boundaries measure, by name."""
    return [
        {
            name: round(float(measures(mesh.p.T[nodes[:, np.asarray(rows)].T]).sum()), 9)
            for name, rows in (names or {}).items()
        }
        for names, nodes in ((mesh.subdomains, mesh.t), (mesh.boundaries, mesh.facets))
    ]


def as_list(mesh, values, name="f", kind="ST"):
    """Return a list as GetDP writes: elements by their corners, with values (nelements, k) at all of these."""
    corners = np.vstack([mesh.p, np.zeros((3 - len(mesh.p), mesh.p.shape[1]))])[:, mesh.t].transpose(2, 1, 0)
    rows = [
        f"{kind}({','.join(map(repr, place))}){{{','.join(map(repr, row))}}};"
        for place, row in zip(corners.reshape(mesh.nelements, -1).tolist(), values.tolist(), strict=True)
    ]
    return "\n".join([f'View "{name}" {{', *rows, "};\n"])


def of_meshio(mesh, **data):
    """Return a mesh as meshio has it, with three coordinates."""
    points = np.column_stack([mesh.p.T, np.zeros((mesh.p.shape[1], 3 - len(mesh.p)))])
    return meshio.Mesh(points, [("triangle" if len(mesh.p) == 2 else "tetra", mesh.t.T)], **data)


def drawings(text, **usual):
    """A fixture of a function that meshes a drawing with the groups it is given, and returns the file."""

    @pytest.fixture(params=FORMATS, ids=" ".join)
    def drawn(request, tmp_path):
        if gmsh is None:
            pytest.skip(WHY_NOT)

        def draw(groups, **options):
            version, kind = request.param
            return drawn_by_gmsh(tmp_path / "drawing.msh", text + groups, version, kind == "binary", **usual | options)

        return draw

    return drawn


def drawn_by_gmsh(path, text, version="4.1", binary=False, dimension=2, order=1, options=(), parts=1):
    """Write the mesh that Gmsh makes of a drawing, and return its path."""
    path.with_suffix(".geo").write_text(text + "\n")
    with gmsh_session() as model:
        gmsh.open(str(path.with_suffix(".geo")))
        for name, value in [("Mesh.MshFileVersion", float(version)), ("Mesh.Binary", binary), *options]:
            gmsh.option.setNumber(name, value)
        model.mesh.generate(dimension)
        model.mesh.setOrder(order)
        if parts > 1:
            model.mesh.partition(parts)
        gmsh.write(str(path))
    return path
