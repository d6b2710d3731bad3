"""A pot magnet with a circular coil that pulls a plate: a quarter in space, and the section around its axis."""

from typing import Any

import numpy as np
from skfem import Mesh

from benchmarks.problems.drawing import read, session
from kohonen_adapt.magnetostatics import Coil, Froehlich, MagneticScalarPotential, Magnetostatics, Material

STEEL, AIR = Material(bh=Froehlich(2000.0, 1.8)), Material()
POT = ((0.0, 0.0, 8.0, 20.0), (0.0, -6.0, 25.0, 6.0), (19.0, 0.0, 6.0, 20.0))  # x, y, width and height in mm
PLATE, WINDING = (0.0, 21.5, 25.0, 5.0), (10.0, 2.0, 7.0, 16.0)
MIDDLE, FAR = 10.0, 120.0  # of the sphere of air, in mm
FINE = {2: 3.0, 3: 6.0}  # size of elements at steel, by dimension


def in_space(ampere_turns: float, order: int) -> MagneticScalarPotential:
    """The scalar potential of a quarter."""
    x, y, width, height = 1e-3 * np.array(WINDING)
    coil = Coil.circular((0.0, 0.0, y + 0.5 * height), (0.0, 0.0, 1.0), x + 0.5 * width, (width, height), ampere_turns)
    symmetry = {"x": "parallel", "y": "parallel"}
    materials = {"pot": STEEL, "plate": STEEL, "air": AIR}
    return MagneticScalarPotential(materials, {"far": 0.0}, coils={"winding": coil}, symmetry=symmetry, order=order)


def around_axis(ampere_turns: float) -> Magnetostatics:
    """The vector potential around the axis."""
    materials = {"pot": STEEL, "plate": STEEL, "air": AIR, "winding": AIR}
    turns = {"winding": ampere_turns}
    return Magnetostatics(materials, open_boundary="far", ampere_turns=turns, axisymmetric=True)


def mesh(dimension: int) -> Mesh:
    """The section in the plane, or a quarter in space, in metres."""
    with session() as gmsh:
        parts = {"pot": rectangles(gmsh, *POT), "plate": rectangles(gmsh, PLATE)}
        if dimension == 2:
            parts["winding"] = rectangles(gmsh, WINDING)
        disk = [(2, gmsh.model.occ.addDisk(0.0, MIDDLE, 0.0, FAR, FAR))]
        half = rectangles(gmsh, (0.0, MIDDLE - 2.0 * FAR, 2.0 * FAR, 4.0 * FAR))
        parts["air"] = gmsh.model.occ.intersect(disk, half)[0]
        if dimension == 3:
            parts = {name: turned(gmsh, each) for name, each in parts.items()}
        name_parts(gmsh, dimension, parts)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 10.0 * dimension)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        gmsh.model.mesh.generate(dimension)
        return read(gmsh, scale=1e-3)


def rectangles(gmsh: Any, *given: tuple[float, ...]) -> list[tuple[int, int]]:
    """One surface of rectangles."""
    tags = [(2, gmsh.model.occ.addRectangle(x, y, 0.0, width, height)) for x, y, width, height in given]
    return gmsh.model.occ.fuse(tags[:1], tags[1:])[0] if len(tags) > 1 else tags


def turned(gmsh: Any, surfaces: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """A quarter turn around the axis, which becomes z."""
    made = gmsh.model.occ.revolve(surfaces, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5 * np.pi)
    volumes = [each for each in made if each[0] == 3]
    gmsh.model.occ.rotate(volumes, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5 * np.pi)
    return volumes


def name_parts(gmsh: Any, dimension: int, parts: dict[str, list[tuple[int, int]]]) -> None:
    """Names of parts and of the outer boundary, and sizes of elements at steel."""
    given = [each for name in parts for each in parts[name]]
    _, pieces = gmsh.model.occ.fragment(given, [])
    gmsh.model.occ.synchronize()
    taken: set[tuple[int, int]] = set()
    owner = [name for name in parts for _ in parts[name]]
    for name in parts:  # air comes last, and has what the others leave
        own = {each for each, of in zip(pieces, owner, strict=True) if of == name for each in each} - taken
        taken |= own
        gmsh.model.addPhysicalGroup(dimension, sorted(tag for _, tag in own), name=name)
        if name != "air":
            points = gmsh.model.getBoundary(sorted(own), recursive=True, oriented=False)
            gmsh.model.mesh.setSize(points, FINE[dimension])
    outer: dict[str, list[int]] = {"x": [], "y": [], "far": []}
    for _, tag in gmsh.model.getBoundary(sorted(taken), oriented=False):
        high = np.abs(gmsh.model.getBoundingBox(dimension - 1, tag)).reshape(2, 3).max(axis=0)
        plane = next((name for name, size in zip("xy"[: dimension - 1], high[:2], strict=False) if size < 1e-3), "far")
        outer[plane].append(tag)
    for name, tags in outer.items():
        if tags:
            gmsh.model.addPhysicalGroup(dimension - 1, tags, name=name)
