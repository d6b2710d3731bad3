"""Commented case for a mesh.

The case runs unchanged if one boundary covers more than half of the rim, or no areas of the rim has a name.
"""

import json
import re
from collections.abc import Iterable, Iterator
from importlib.resources import files
from itertools import combinations
from string import Template

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.mesh.cells import centroids_of, facet_normals
from kohonen_adapt.mesh.measures import area, magnitude
from kohonen_adapt.mesh.names import named_sets

__all__ = ["case_text"]

GIVEN = {
    2: "A in Wb/m; flux crosses boundaries without a value at a right angle",
    3: "phi in A, 0 on a distant boundary; no flux crosses boundaries without a value",
}


def case_text(mesh: Mesh, file: str, scale: float, *, points: Iterable[str] = ()) -> str:
    """Return the text of a case for a mesh.

    Parameters
    ----------
    mesh
        The mesh of `read_mesh` at this scale.
    file
        Its file, as named in the case.
    scale
        Metres per unit of the file.
    points
        Names of the groups of points in the file.

    Returns
    -------
    str
        TOML: every subdomain is air, and the potential is 0 on the boundary with more than half of the rim, if any, and
        on the whole rim if no part of it has a name. Overlapping subdomains, other boundaries and an example of every
        other key are commented out.
    """
    sizes = [f"{size:.4g}" for size in np.ptp(mesh.p, axis=1)]
    name = "template.toml" if len(mesh.p) == 2 else "template_in_space.toml"
    return Template(files(__package__).joinpath(name).read_text(encoding="utf-8")).substitute(
        _names(mesh),
        mesh=_quoted(file),
        scale=float(scale),
        width=sizes[0],
        height=sizes[1],
        size=" x ".join(sizes),
        left=float(mesh.p[0].min()),
        right=float(mesh.p[0].max()),
        node=mesh.p[:, 0].tolist(),
        place=", ".join(f"{middle:.4g}" for middle in centroids_of(mesh, np.argmax(area(mesh)))),
        more=2 * mesh.nvertices,
        rim=_rim(mesh),
        materials="\n".join(_materials(mesh)),
        potential="\n".join([*_potential(mesh), *(f"# {_key(name)} = 0.0  # a point" for name in sorted(points))]),
    )


def _names(mesh: Mesh) -> dict[str, str]:
    sizes, sides = _fractions(mesh), _rim_fractions(mesh)
    subdomain = min(sorted(sizes), key=sizes.__getitem__, default="coil")
    side = max(sides, key=sides.__getitem__, default=_unused_name(mesh))
    pair = min(combinations(sides, 2), key=lambda two: abs(sides[two[0]] - sides[two[1]]), default=("left", "right"))
    return {
        "part": _quoted(subdomain),
        "part_key": _key(subdomain),
        "side": _quoted(side),
        "side_key": _key(side),
        "one": _quoted(pair[0]),
        "other": _quoted(pair[1]),
    }


def _rim(mesh: Mesh) -> str:
    line = f"rim = {_quoted(_unused_name(mesh))}  # a name for the whole rim, holes included"
    return f"# {line}" if any(_rim_fractions(mesh).values()) else f"{line}; no part of it has a name in the mesh"


def _unused_name(mesh: Mesh) -> str:
    taken = {*(mesh.boundaries or {}), *(mesh.subdomains or {})}
    return next(name for name in ("rim", *(f"rim {k}" for k in range(len(taken)))) if name not in taken)


def _materials(mesh: Mesh) -> Iterator[str]:
    sets, sizes = named_sets(mesh.subdomains), _fractions(mesh)
    whole, group = ("the area", "surface") if len(mesh.p) == 2 else ("the volume", "volume")
    chosen = _partition(sets, sizes, mesh.nelements)
    for name in sorted(sets):
        fraction = f"{100.0 * sizes[name]:.3g} % of {whole}"
        if name in chosen:
            yield f"\n[materials.{_key(name)}]  # {fraction}\npermeability = 1.0"
        else:
            yield f"\n# [materials.{_key(name)}]  # {fraction}; overlaps other subdomains, or is empty"
    bare = 1.0 - sum(sizes[name] for name in chosen)
    if bare > 1e-9:
        fraction = f"{100.0 * bare:.3g} % of {whole}"
        yield f"\n# {fraction} has no material above: give it a {group} group of its own in the mesh."
    if not chosen:
        yield "\n[materials]"


def _fractions(mesh: Mesh) -> dict[str, float]:
    areas = area(mesh) / area(mesh).sum()
    return {name: float(areas[rows].sum()) for name, rows in named_sets(mesh.subdomains).items()}


def _partition(sets: dict[str, Ints], sizes: dict[str, float], count: int) -> set[str]:
    """Return disjoint subdomains, the larger area of two greedy choices.

    One choice begins with the smallest subdomain, the other with the largest.
    """
    order, found = sorted(sets, key=sizes.__getitem__), list[set[str]]()
    for names in (order, order[::-1]):
        taken, chosen = np.zeros(count, bool), set()
        for name in names:
            if len(sets[name]) and not taken[sets[name]].any():
                taken[sets[name]] = True
                chosen.add(name)
        found.append(chosen)
    return max(found, key=lambda names: sum(map(sizes.__getitem__, names)))


def _potential(mesh: Mesh) -> Iterator[str]:
    fractions = _rim_fractions(mesh)
    outer = max(fractions, key=fractions.__getitem__, default="")
    most = fractions.get(outer, 0.0)
    yield f"\n[potential]  # {GIVEN[len(mesh.p)]}"
    if 0.0 < most <= 0.5:  # possibly a periodic side
        yield "# No boundary covers more than half of the rim: set 0 where no flux leaves, but not on periodic sides."
    if most == 0.0:
        yield f"{_key(_unused_name(mesh))} = 0.0"
    for name in sorted(fractions, key=lambda name: (fractions[name] == 0.0, name)):
        fraction = (
            f"{100.0 * fractions[name]:.3g} % of the rim" if fractions[name] > 0.0 else "has facets inside the mesh"
        )
        yield f"{'' if name == outer and most > 0.5 else '# '}{_key(name)} = 0.0  # {fraction}"


def _rim_fractions(mesh: Mesh) -> dict[str, float]:
    rim, (a, b) = mesh.boundary_facets(), mesh.p[:, mesh.facets[:2]].swapaxes(0, 1)
    size = magnitude(b - a if len(mesh.p) == 2 else facet_normals(mesh, slice(None)))
    return {
        name: float(size[rows].sum() / size[rim].sum()) if np.isin(rows, rim).all() else 0.0
        for name, rows in sorted(named_sets(mesh.boundaries).items())
        if len(rows)
    }


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
