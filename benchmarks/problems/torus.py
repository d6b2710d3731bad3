"""A closed torus of iron with a circular coil around its section: the half above its plane of symmetry."""

import numpy as np
from skfem import MeshTet

from benchmarks.problems.drawing import group, read, session
from kohonen_adapt.magnetostatics import Coil, MagneticScalarPotential, Material

RADIUS, SECTION, FAR = 0.05, 0.012, 0.16  # radii of the torus, of its section and of the air, in m
WINDING = Coil.circular((RADIUS, 0.0, 0.0), (0.0, 1.0, 0.0), 0.02, (0.008, 0.03), 1000.0)


def problem() -> MagneticScalarPotential:
    materials = {"iron": Material(permeability=1000.0), "air": Material()}
    return MagneticScalarPotential(
        materials, {"outer": 0.0}, coils={"winding": WINDING}, symmetry={"plane": "parallel"}, order=1
    )


def mesh(chords: int, fine: float, coarse: float = 0.04) -> MeshTet:
    """The half torus in half a ball of air, with so many chords around the section and elements of such sizes."""
    with session() as gmsh:
        occ = gmsh.model.occ
        ring, ball = [(3, occ.addTorus(0.0, 0.0, 0.0, RADIUS, SECTION))], [(3, occ.addSphere(0.0, 0.0, 0.0, FAR))]
        above = [(3, occ.addBox(-2.0 * FAR, -2.0 * FAR, 0.0, 4.0 * FAR, 4.0 * FAR, 2.0 * FAR))]
        ring = occ.intersect(ring, above, removeTool=False)[0]
        ball = occ.intersect(ball, above)[0]
        _, (iron, air) = occ.fragment(ring, ball)
        occ.synchronize()
        air = [each for each in air if each not in iron]
        group(gmsh, 3, {"iron": [tag for _, tag in iron], "air": [tag for _, tag in air]})
        sides = {"plane": list[int](), "outer": list[int]()}
        for _, tag in gmsh.model.getBoundary(iron + air, oriented=False):
            low, high = np.array(gmsh.model.getBoundingBox(2, tag)).reshape(2, 3)
            sides["plane" if high[2] - low[2] < 1e-4 else "outer"].append(tag)
        group(gmsh, 2, sides)
        gmsh.option.setNumber("Mesh.MeshSizeMax", coarse)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        points = gmsh.model.getBoundary(iron, recursive=True, oriented=False)
        gmsh.model.mesh.setSize(points, min(fine, 2.0 * np.pi * SECTION / chords))
        gmsh.model.mesh.generate(3)
        return read(gmsh)
