"""Write a commented case for a mesh, which runs as it stands where one boundary holds most of the rim."""

import json
import re

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import named_sets

__all__ = ["case_text"]

Sets = dict[str, Ints]

HEAD = """\
# A case of kohonen-adapt. Check it:  kohonen-adapt run THIS.toml --dry-run
#                          run it:  kohonen-adapt run THIS.toml --out DIR
# All units are SI. What is commented out shows what else there is.

mesh = {mesh}
scale = {scale!r}  # metres per unit of the mesh file; the mesh is then {width:.4g} m wide and {height:.4g} m high
# depth = 0.05  # m: forces, energies and flux linkages are totals then, else per metre of depth
# axisymmetric = true  # x is the distance from the axis, y the height
# order = 2  # quadratic elements, planar only
# estimator = "residual"  # or "recovery", or "equilibrated": a guaranteed bound
# open_boundary = "rim"  # a circle with nothing but air beyond it
# periodic = [["left", "right"]]  # A is the same on both
# antiperiodic = [["left", "right"]]  # A is the other's negative

# Every element needs exactly one material. What a material may have:
#   permeability = 1000.0  # relative to vacuum
#   remanence = [0.0, 1.2]  # T; or coercivity = [0.0, 9e5], A/m
#   current_density = 2e6  # A/m^2, out of the page
#   bh = "steel.csv"  # columns B in T and H in A/m; or [[1.0, 500.0], [1.9, 2e4], ...],
#                     # {{law = "brauer", k1 = 50.0, k2 = 10.0, k3 = 1.5}},
#                     # {{law = "froehlich", permeability = 2000.0, saturation = 2.0}} or "arctan" likewise
"""

TAIL = """
# [ampere_turns]  # A: the whole current through a subdomain, in place of its current_density
# coil = 1000.0

[adapt]
passes = 4
min_quality = 0.3  # of elements: 1 is equilateral, 0 is flat
seed = 0
# rtol = 0.02  # stop when the estimate is at most this share of the energy norm; atol likewise, absolute
# topology = "recycle"  # or "flip": every node moves and none is replaced; "fixed": the connectivity stays, too
# polish = true
# target_nodes = 5000  # grow to so many nodes
# pinned = ["outer"]  # names and node numbers of what is to stay
# layers = {gap = 2}  # layers of elements to keep across thin subdomains
# curves = {rim = {curve = "arc", centre = [0.0, 0.0], radius = 0.05}}  # m; or "line" (start, end), "spline" (points)
# output_rtol = 0.01  # stop when no output changes by more than this share

# [outputs.force]
# quantity = "force"  # or "torque" (body, centre), "flux_linkage" (coil, turns), "energy", "coenergy"
# body = "armature"
# component = "y"
"""


def case_text(mesh: MeshTri, file: str, scale: float) -> str:
    """The text of a case.

    Parameters
    ----------
    mesh
        The mesh as `read_mesh` gives it at that scale.
    file
        Its file, as the case is to name it.
    scale
        Metres per unit of the file.

    Returns
    -------
    str
        TOML: every subdomain is air, and A = 0 on the boundary that holds more than half of the rim, if one does.
        Subdomains that overlap those, and other boundaries, are commented out.
    """
    width, height = np.ptp(mesh.p, axis=1)
    head = HEAD.format(mesh=_quoted(file), scale=float(scale), width=width, height=height)
    return head + _materials(mesh) + _potential(mesh) + TAIL


def _materials(mesh: MeshTri) -> str:
    sets = named_sets(mesh.subdomains)
    areas = area(mesh)
    chosen = _partition(sets, areas)
    total, lines = areas.sum(), []
    for name, rows in sorted(sets.items()):
        share = f"{100.0 * areas[rows].sum() / total:.3g} % of the area"
        if name in chosen:
            lines += ["", f"[materials.{_key(name)}]  # {share}", "permeability = 1.0"]
        else:
            lines += ["", f"# [materials.{_key(name)}]  # {share}; it overlaps others, or is empty"]
    bare = total - sum(areas[sets[name]].sum() for name in chosen)
    if bare > 1e-9 * total:
        share = f"{100.0 * bare / total:.3g} % of the area"
        lines += ["", f"# {share} has no material above: give it a surface group of its own in the mesh."]
    return "\n".join([*lines, *([] if chosen else ["", "[materials]"]), ""])


def _partition(sets: Sets, areas: Floats) -> set[str]:
    """Names of subdomains that do not overlap: from the smallest on or from the largest, what covers more."""
    order = sorted(sets, key=lambda name: float(areas[sets[name]].sum()))
    found = [_disjoint(sets, names, len(areas)) for names in (order, order[::-1])]
    return max(found, key=lambda names: sum(float(areas[sets[name]].sum()) for name in names))


def _disjoint(sets: Sets, names: list[str], count: int) -> set[str]:
    taken, chosen = np.zeros(count, dtype=bool), set()
    for name in names:
        if len(sets[name]) and not taken[sets[name]].any():
            taken[sets[name]] = True
            chosen.add(name)
    return chosen


def _potential(mesh: MeshTri) -> str:
    shares = {name: _share_of_rim(mesh, rows) for name, rows in named_sets(mesh.boundaries).items() if len(rows)}
    lines = ["", "[potential]  # A in Wb/m; where none is given, flux crosses the boundary at a right angle"]
    candidates = [name for name in sorted(shares) if shares[name] > 0.0]
    outer = max(candidates, key=lambda name: shares[name], default=None)
    if outer is not None and shares[outer] <= 0.5:  # that may be a periodic side as well
        outer = None
        lines.append(
            "# No boundary holds more than half of the rim: choose where no flux leaves, not on periodic sides."
        )
    for name in sorted(shares, key=lambda name: (shares[name] == 0.0, name)):
        share = f"{100.0 * shares[name]:.3g} % of the rim" if shares[name] > 0.0 else "not on the rim alone"
        lines.append(f"{'' if name == outer else '# '}{_key(name)} = 0.0  # {share}")
    if not candidates:
        lines.append("# The mesh names no part of its rim: give the lines there a physical group, and name it here.")
    return "\n".join([*lines, ""])


def _share_of_rim(mesh: MeshTri, rows: Ints) -> float:
    """Which share of the length of the rim is in a boundary; 0 if some of it is inside, where A = 0 cuts the field."""
    rim = mesh.boundary_facets()
    ends = mesh.p[:, mesh.facets]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]))
    return float(length[rows].sum() / length[rim].sum()) if np.isin(rows, rim).all() else 0.0


def _key(name: str) -> str:
    """A name as a key of TOML, in quotes where it must be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
