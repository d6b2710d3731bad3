"""Draw the domains of the problems for Gmsh, with the names that their meshes have."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.problems.c_core import EXAMPLES, SCALE
from benchmarks.problems.solids import Box, Solid

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


def solid(gmsh: Gmsh, problem: Solid) -> float:
    """The body of a problem in space."""
    body = [(3, _box(gmsh, problem.body))]
    if problem.notch is not None:
        body, _ = gmsh.model.occ.cut(body, [(3, _box(gmsh, problem.notch))])
    parts: list[list[tuple[int, int]]] = [[]]
    if problem.parts:
        _, parts = gmsh.model.occ.fragment(body, [(3, _box(gmsh, box)) for box in problem.parts.values()])
    gmsh.model.occ.synchronize()

    def given(tag: int) -> bool:
        return bool(problem.given(np.array(gmsh.model.occ.getCenterOfMass(2, tag))[:, None]).all())

    return _named(gmsh, dict(zip(problem.parts, parts[len(body) :], strict=False)), "given", given)


def _box(gmsh: Gmsh, box: Box) -> int:
    return int(gmsh.model.occ.addBox(*box.low, *np.subtract(box.high, box.low).tolist()))


def _named(
    gmsh: Gmsh,
    regions: dict[str, list[tuple[int, int]]],
    sides: str = "outer",
    has: Callable[[int], bool] = lambda tag: True,
) -> float:
    """Close a model; its outer sides have a name, and "rest" is what has none: Gmsh saves only what has one."""
    gmsh.model.occ.synchronize()
    dim = gmsh.model.getDimension()
    for name, parts in regions.items():
        gmsh.model.addPhysicalGroup(dim, [tag for _, tag in parts], name=name)
    bodies = gmsh.model.getEntities(dim)
    rest = set(bodies).difference(*regions.values())
    gmsh.model.addPhysicalGroup(dim, [tag for _, tag in sorted(rest)], name="rest")
    outside = gmsh.model.getBoundary(bodies, combined=True, oriented=False)
    gmsh.model.addPhysicalGroup(dim - 1, [tag for _, tag in outside if has(tag)], name=sides)
    return 1.0
