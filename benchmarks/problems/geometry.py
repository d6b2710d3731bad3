"""Draw the domains of the problems for Gmsh, with the names that their meshes have."""

from typing import Any

from benchmarks.problems.c_core import EXAMPLES, SCALE

Gmsh = Any  # the module, which is an optional extra


def square(gmsh: Gmsh) -> float:
    """The unit square; metres per unit of the model, as of every function here."""
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    return _named(gmsh, {})


def l_shape(gmsh: Gmsh) -> float:
    """(-1, 1)^2 without its quadrant x > 0 > y."""
    whole = gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)
    quadrant = gmsh.model.occ.addRectangle(0, -1, 0, 1, 1)
    gmsh.model.occ.cut([(2, whole)], [(2, quadrant)])
    return _named(gmsh, {})


def magnet(gmsh: Gmsh, iron: bool) -> float:
    """(-1, 1)^2 with a magnet, and an iron block below it."""
    rectangles = {"magnet": (-0.3, -0.2, 0, 0.6, 0.4)} | ({"iron": (-0.5, -0.6, 0, 1.0, 0.4)} if iron else {})
    whole = gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)
    tools = [(2, gmsh.model.occ.addRectangle(*rectangle)) for rectangle in rectangles.values()]
    _, parts = gmsh.model.occ.fragment([(2, whole)], tools)
    return _named(gmsh, dict(zip(rectangles, parts[1:], strict=True)))


def c_core(gmsh: Gmsh) -> float:
    """The drawing of the examples, in millimetres."""
    gmsh.merge(str(EXAMPLES / "c_core.geo"))
    return SCALE


def _named(gmsh: Gmsh, regions: dict[str, list[tuple[int, int]]]) -> float:
    """Close a model; its outer boundary is "outer", and "rest" what has no name: Gmsh saves only what has one."""
    gmsh.model.occ.synchronize()
    for name, surfaces in regions.items():
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in surfaces], name=name)
    surfaces = gmsh.model.getEntities(2)
    rest = set(surfaces).difference(*regions.values())
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in sorted(rest)], name="rest")
    outside = gmsh.model.getBoundary(surfaces, combined=True, oriented=False)
    gmsh.model.addPhysicalGroup(1, [tag for _, tag in outside], name="outer")
    return 1.0
