"""Remesh the body of a problem on tetrahedra by Gmsh, with sizes given on the mesh before as a background field."""

import tempfile
from pathlib import Path

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.peers.gmsh_remesh import OPTIONS
from benchmarks.problems.geometry import Gmsh
from benchmarks.problems.solids import Box, Solid


def gmsh_in_space(problem: Solid, mesh: MeshTet, metric: np.ndarray) -> MeshTet:
    """A new mesh; `metric`: 1 / h^2 (nnodes,) of the wanted edge lengths h on the mesh before."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        _draw(gmsh, problem)
        for name, value in OPTIONS.items():
            gmsh.option.setNumber(name, value)
        view = gmsh.view.add("sizes")
        rows = np.concatenate((*mesh.p[:, mesh.t], (metric**-0.5)[mesh.t]))
        gmsh.view.addListData(view, "SS", mesh.nelements, rows.T.ravel())
        field = gmsh.model.mesh.field.add("PostView")
        gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
        gmsh.model.mesh.field.setAsBackgroundMesh(field)
        gmsh.model.mesh.generate(3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "remeshed.msh")
            gmsh.write(str(path))
            return ka.read_mesh(path)
    finally:
        gmsh.finalize()


def _draw(gmsh: Gmsh, problem: Solid) -> None:
    """The body with a physical group for every name, and one for the rest of its volume."""
    occ, model = gmsh.model.occ, gmsh.model
    body = [(3, _box(gmsh, problem.body))]
    if problem.notch is not None:
        body, _ = occ.cut(body, [(3, _box(gmsh, problem.notch))])
    if problem.parts:
        occ.fragment(body, [(3, _box(gmsh, box)) for box in problem.parts.values()])
    occ.synchronize()
    volumes: dict[str, list[int]] = {}
    for _, tag in model.getEntities(3):
        middle = np.array(occ.getCenterOfMass(3, tag))
        named = [name for name, box in problem.parts.items() if box.holds(middle)]
        volumes.setdefault(named[0] if named else "rest", []).append(tag)
    faces = [tag for _, tag in model.getBoundary(model.getEntities(3), combined=True, oriented=False)]
    for name, tags in volumes.items():
        model.addPhysicalGroup(3, tags, name=name)
    given = [tag for tag in faces if problem.given(np.array(occ.getCenterOfMass(2, tag))[:, None]).all()]
    model.addPhysicalGroup(2, given, name="given")


def _box(gmsh: Gmsh, box: Box) -> int:
    """A solid box of the model."""
    return int(gmsh.model.occ.addBox(*box.low, *np.subtract(box.high, box.low).tolist()))
