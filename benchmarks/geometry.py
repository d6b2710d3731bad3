"""The domains of the problems as models for Gmsh, with the names that their meshes have."""

from typing import Any

from benchmarks.c_core import EXAMPLES, SCALE

Gmsh = Any  # the module, which is an optional extra


def square(gmsh: Gmsh) -> float:
    """The unit square; metres per unit of the model, as of every function here."""
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    return _named_outside(gmsh)


def l_shape(gmsh: Gmsh) -> float:
    """(-1, 1)^2 without its quadrant x > 0 > y."""
    whole = gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)
    quadrant = gmsh.model.occ.addRectangle(0, -1, 0, 1, 1)
    gmsh.model.occ.cut([(2, whole)], [(2, quadrant)])
    return _named_outside(gmsh)


def magnet(gmsh: Gmsh, iron: bool) -> float:
    """(-1, 1)^2 with a magnet, and an iron block below it."""
    rectangles = {"magnet": (-0.3, -0.2, 0, 0.6, 0.4)} | ({"iron": (-0.5, -0.6, 0, 1.0, 0.4)} if iron else {})
    air = gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)
    tools = [(2, gmsh.model.occ.addRectangle(*rectangle)) for rectangle in rectangles.values()]
    _, parts = gmsh.model.occ.fragment([(2, air)], tools)
    unit = _named_outside(gmsh)
    for name, part in zip(rectangles, parts[1:], strict=True):
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in part], name=name)
    named = {tag for part in parts[1:] for _, tag in part}
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in parts[0] if tag not in named], name="air")
    return unit


def c_core(gmsh: Gmsh) -> float:
    """The drawing of the examples, in millimetres."""
    gmsh.merge(str(EXAMPLES / "c_core.geo"))
    return SCALE


def _named_outside(gmsh: Gmsh) -> float:
    """Close the model and call its outer boundary "outer"."""
    gmsh.model.occ.synchronize()
    outside = gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=True, oriented=False)
    gmsh.model.addPhysicalGroup(1, [tag for _, tag in outside], name="outer")
    return 1.0
