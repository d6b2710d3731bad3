"""Remesh a CAD model of any dimension by Gmsh, with sizes given on the mesh before as a background field."""

from collections.abc import Callable

import numpy as np
from skfem import Mesh

from benchmarks.problems.drawing import read, session
from benchmarks.problems.geometry import Gmsh

FRONTAL_DELAUNAY = 6
OPTIONS = {
    "General.NumThreads": 1,
    "Mesh.Algorithm": FRONTAL_DELAUNAY,
    "Mesh.Binary": 1,
    # the field alone says how long the edges are
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
}
LISTS = {2: "ST", 3: "SS"}  # of scalars on triangles and tetrahedra


def gmsh_remesh(geometry: Callable[[Gmsh], float], mesh: Mesh, metric: np.ndarray) -> Mesh:
    """A new mesh of the model; `metric`: 1 / h^2 (nnodes,) of the wanted edge lengths h on the mesh before."""
    dim = mesh.dim()
    with session() as gmsh:
        unit = geometry(gmsh)
        for name, value in OPTIONS.items():
            gmsh.option.setNumber(name, value)
        view, x = gmsh.view.add("sizes"), np.zeros((3, mesh.nvertices))
        x[:dim] = mesh.p / unit
        rows = np.concatenate((*x[:, mesh.t], (metric**-0.5 / unit)[mesh.t]))
        gmsh.view.addListData(view, LISTS[dim], mesh.nelements, rows.T.ravel())
        field = gmsh.model.mesh.field.add("PostView")
        gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
        gmsh.model.mesh.field.setAsBackgroundMesh(field)
        gmsh.model.mesh.generate(dim)
        return read(gmsh, unit)
