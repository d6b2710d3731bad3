"""Remesh a CAD model by Gmsh, with sizes given on the mesh before as a background field."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
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


def gmsh_remesh(geometry: Callable[[Gmsh], float], mesh: MeshTri, metric: np.ndarray) -> MeshTri:
    """A new mesh of the model; `metric`: 1 / h^2 (nnodes,) of the wanted edge lengths h on the mesh before."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        unit = geometry(gmsh)
        for name, value in OPTIONS.items():
            gmsh.option.setNumber(name, value)
        _set_sizes(gmsh, mesh.p / unit, mesh.t, metric**-0.5 / unit)
        gmsh.model.mesh.generate(2)
        return _meshed(gmsh, unit)
    finally:
        gmsh.finalize()


def _set_sizes(gmsh: Gmsh, p: np.ndarray, t: np.ndarray, sizes: np.ndarray) -> None:
    """Linear on every triangle, in units of the model."""
    view = gmsh.view.add("sizes")
    rows = np.concatenate((p[0][t], p[1][t], np.zeros(t.shape), sizes[t]))
    gmsh.view.addListData(view, "ST", t.shape[1], rows.T.ravel())
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)


def _meshed(gmsh: Gmsh, unit: float) -> MeshTri:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "remeshed.msh")
        gmsh.write(str(path))
        return ka.read_mesh(path, scale=unit)
