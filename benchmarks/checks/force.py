"""Measure the noise of forces on a magnet moved past iron, on meshes of Gmsh and on the same adapted."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.geometry import Gmsh
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics import Magnetostatics, Material

TARGET = 5.0  # times less scatter
STEPS = 20
STEP = 0.05  # millimetres, as all lengths here
BOX = (-40.0, -30.0, 80.0, 60.0)  # x, y, width, height
IRON = (0.0, -12.0, 20.0, 10.0)
MAGNET = (-7.0, 0.0, 10.0, 5.0)  # at the first step, 2 mm above the iron and half past its edge
FAR = 6.0  # edge length at the box

PROBLEM = Magnetostatics(
    {"magnet": Material(1.05, remanence=(0.0, 1.2)), "iron": Material(1000.0), "air": Material()},
    potential={"outer": 0.0},
    order=1,
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Root mean square deviation from a cubic through the forces on the magnet, in N/m, of both kinds of mesh."""
    rows = []
    for size in (0.8,) if quick else (0.8, 0.4):
        meshes = [gmsh_mesh(STEP * step, size) for step in range(STEPS)]
        plain = np.array([force(PROBLEM.solve(mesh)) for mesh in meshes])
        name = f"{np.mean([mesh.p.shape[1] for mesh in meshes]):.0f} nodes"
        for seed in seeds:
            adapted = np.array([force(ka.adapt(mesh, PROBLEM, seed=seed).solution) for mesh in meshes])
            rows += [_row(f"{name}, seed {seed}, F_{axis}", plain[:, k], adapted[:, k]) for k, axis in enumerate("xy")]
    return aligned(["force noise", "F", "Gmsh", "adapted", "ratio", "target", ""], rows)


def force(field: object) -> np.ndarray:
    """Force on the magnet, (2,) in N/m."""
    return field.force("magnet")


def noise(forces: np.ndarray) -> float:
    """Root mean square deviation from the cubic that is fitted through forces at equal steps."""
    step = np.linspace(-1.0, 1.0, len(forces))
    return float(np.sqrt(np.mean((forces - np.polyval(np.polyfit(step, forces, 3), step)) ** 2)))


def gmsh_mesh(shift: float, size: float) -> MeshTri:
    """The mesh of Gmsh with the magnet moved along x, edges of that length at magnet and iron; in metres."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        _model(gmsh, shift, size)
        gmsh.model.mesh.generate(2)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "position.msh")
            gmsh.write(str(path))
            return ka.read_mesh(path, scale=1e-3)
    finally:
        gmsh.finalize()


def _model(gmsh: Gmsh, shift: float, size: float) -> None:
    box, iron, magnet = (
        (2, gmsh.model.occ.addRectangle(x, y, 0.0, width, height))
        for x, y, width, height in (BOX, IRON, (MAGNET[0] + shift, *MAGNET[1:]))
    )
    _, (air, iron, magnet) = gmsh.model.occ.fragment([box], [iron, magnet])
    gmsh.model.occ.synchronize()
    bodies = {"iron": iron, "magnet": magnet}
    for name, parts in (bodies | {"air": sorted(set(air) - set(iron) - set(magnet))}).items():
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in parts], name=name)
    outside = gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=True, oriented=False)
    gmsh.model.addPhysicalGroup(1, [tag for _, tag in outside], name="outer")
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), FAR)
    gmsh.model.mesh.setSize(gmsh.model.getBoundary(iron + magnet, combined=False, recursive=True), size)


def _row(name: str, plain: np.ndarray, adapted: np.ndarray) -> list[float | str]:
    scatter = noise(plain), noise(adapted)
    ratio = scatter[0] / scatter[1]
    return [name, float(np.mean(adapted)), *scatter, ratio, TARGET, "met" if ratio >= TARGET else "missed"]
