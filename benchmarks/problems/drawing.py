"""Draw models out of named shapes in Gmsh, and mesh them."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import cos, sin
from pathlib import Path

from skfem import Mesh, MeshTri

import kohonen_adapt as ka
from benchmarks.problems.geometry import Gmsh

Surfaces = Mapping[str, list[int]]  # tags by name


def meshed(
    draw: Callable[[Gmsh], Surfaces],
    sizes: Mapping[str, float],
    rim: Callable[[float, float, float, float], str | None],
    facets: Mapping[str, int] | None = None,
) -> MeshTri:
    """The mesh of a drawing in metres.

    `draw` makes surfaces that may overlap and says what they are called; each takes away from those before it. `sizes`
    are edge lengths at the outlines of what is named, the later for what two of them share. `rim` gives the name of an
    outer curve by its bounding box (xmin, ymin, xmax, ymax), or None; `facets` are numbers of equal ones on some.
    """
    with session() as gmsh:
        gmsh.option.setNumber("General.NumThreads", 1)
        parts = _cut(gmsh, draw(gmsh))
        for name, size in sizes.items():
            gmsh.model.mesh.setSize(gmsh.model.getBoundary(parts[name], combined=False, recursive=True), size)
        rims = _rims(gmsh, rim)
        for name, number in (facets or {}).items():
            gmsh.model.mesh.setTransfiniteCurve(rims[name][0], number + 1)
        group(gmsh, 2, {name: [tag for _, tag in own] for name, own in parts.items()})
        group(gmsh, 1, rims)
        gmsh.model.mesh.generate(2)
        return read(gmsh)


@contextmanager
def session() -> Iterator[Gmsh]:
    """Gmsh without output, from its start to its end."""
    import gmsh  # an optional dependency

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()


def annulus(gmsh: Gmsh, inner: float, outer: float) -> int:
    """Between circles about the origin."""
    disks = [(2, gmsh.model.occ.addDisk(0, 0, 0, radius, radius)) for radius in (outer, inner)]
    ((_, tag),), _ = gmsh.model.occ.cut(disks[:1], disks[1:])
    return tag


def sector(gmsh: Gmsh, inner: float, outer: float, start: float, end: float) -> int:
    """Of such a ring between two angles, less than pi apart."""
    occ = gmsh.model.occ
    origin = occ.addPoint(0, 0, 0)
    corners = ((inner, start), (outer, start), (outer, end), (inner, end))
    a, b, c, d = (occ.addPoint(r * cos(angle), r * sin(angle), 0) for r, angle in corners)
    outline = [occ.addLine(a, b), occ.addCircleArc(b, origin, c), occ.addLine(c, d), occ.addCircleArc(d, origin, a)]
    return occ.addPlaneSurface([occ.addCurveLoop(outline)])


def _cut(gmsh: Gmsh, surfaces: Surfaces) -> dict[str, list[tuple[int, int]]]:
    """The surfaces without what later ones cover, all of them sharing their curves."""
    names = [name for name, tags in surfaces.items() for _ in tags]
    whole = [(2, tag) for tags in surfaces.values() for tag in tags]
    _, parts = gmsh.model.occ.fragment(whole[:1], whole[1:])
    gmsh.model.occ.synchronize()
    owner = {part: name for name, own in zip(names, parts, strict=True) for part in own}
    return {name: [part for part, own in owner.items() if own == name] for name in surfaces}


def _rims(gmsh: Gmsh, rim: Callable[[float, float, float, float], str | None]) -> dict[str, list[int]]:
    curves: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=True, oriented=False):
        left, low, _, right, high, _ = gmsh.model.getBoundingBox(1, tag)
        name = rim(left, low, right, high)
        if name is not None:
            curves.setdefault(name, []).append(tag)
    return curves


def group(gmsh: Gmsh, dimension: int, groups: dict[str, list[int]]) -> None:
    for name, tags in groups.items():
        gmsh.model.addPhysicalGroup(dimension, tags, name=name)


def read(gmsh: Gmsh, scale: float = 1.0) -> Mesh:
    """The mesh in metres, of a drawing in units of `scale`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "drawing.msh")
        gmsh.write(str(path))
        return ka.read_mesh(path, scale=scale)
