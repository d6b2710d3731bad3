"""Sentences for the user about the work of a case, and about likely mistakes."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.cases.case import Case
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.display import counted
from kohonen_adapt.loop.corners import corner_sentences
from kohonen_adapt.loop.growth import MAX_NODES
from kohonen_adapt.loop.settings import percent
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of, width_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.measures import distances, magnitude
from kohonen_adapt.mesh.names import connected_components_of
from kohonen_adapt.problem.protocol import CheckedProblem

__all__ = [
    "allowed_errors",
    "case_doubts",
    "coil_sentences",
    "plan_lines",
    "plan_sentence",
    "seams",
    "size_text",
    "unit_doubts",
]


def plan_lines(case: Case, mesh: Mesh) -> list[str]:
    hints = (f"hint: {hint}" for hint in case_hints(case))
    return [plan_sentence(case, mesh), *strong_corners(case, mesh), *hints]


def plan_sentence(case: Case, mesh: Mesh) -> str:
    if case.most_passes == 0:
        return f"Plan: solve and estimate {mesh.nvertices} nodes without a pass."
    allowed, count = allowed_errors(case), case.most_passes
    until = f", until {allowed}," if allowed else " without a tolerance (rtol),"
    return f"Plan: at most {counted(count, 'pass')}{until} with {_nodes(case, mesh)} of {_orders(case)}."


def coil_sentences(case: Case) -> Iterator[str]:
    for name, coil in case.coils.items():
        low, high = coil.winding.edges.min(axis=(0, 2)), coil.winding.edges.max(axis=(0, 2))
        yield (
            f"Coil '{name}': {coil.ampere_turns:g} A around {point_text(np.round(coil.axis, 6) + 0.0)}, from "
            f"{point_text(low)} to {point_text(high)} m, section {coil.width:g} x {coil.height:g} m, "
            f"{_current_density(coil):.4g} A/m^2."
        )


def case_hints(case: Case) -> Iterator[str]:
    problem = case.problem
    currents = {name: coil.ampere_turns for name, coil in case.coils.items()}
    currents |= getattr(problem, "ampere_turns", None) or {}
    if idle := [name for name, current in currents.items() if current == 0.0]:
        yield f"ampere_turns of {listed(idle)} is 0, so that no current flows there."
    sources: list[Any] = [
        *currents.values(),
        *(problem.potential or {}).values(),
        getattr(problem, "applied_field", None),
    ]
    for material in problem.materials.values():
        sources += [material.current_density, material.coercivity, material.remanence]
    if not any(source is not None and (callable(source) or np.any(source)) for source in sources):
        yield "no current, magnet, applied field or potential other than 0 is given, so that the field is zero."


def _current_density(coil: Coil) -> float:
    return abs(coil.ampere_turns) / (coil.width * coil.height)


def strong_corners(case: Case, mesh: Mesh) -> list[str]:
    problem = case.problem
    return corner_sentences(mesh, problem.corner_exponents(mesh)) if isinstance(problem, Magnetostatics) else []


def allowed_errors(case: Case) -> str:
    given, texts = case.adapt, list[str]()
    relative, absolute = given.get("rtol"), given.get("atol")
    of_estimate = [] if relative is None else [f"{percent(relative)} of the energy norm"]
    if absolute is not None and case.goal is not None:
        of_estimate.append(f"{absolute**2:.4g} {case.problem.goal_unit}")
    elif absolute:
        of_estimate.append(f"{absolute:.4g} sqrt({case.energy_unit})")
    if of_estimate:
        texts.append(f"the estimated error is at most {' plus '.join(of_estimate)}")
    if "goal_rtol" in given:
        texts.append(f"that of the goal is at most {percent(given['goal_rtol'])}")
    of_outputs = given.get("output_rtol", {})
    if isinstance(of_outputs, Mapping):
        texts += [f"that of '{name}' is at most {percent(tolerance)}" for name, tolerance in of_outputs.items()]
    else:
        texts.append(f"that of every output is at most {percent(of_outputs)}")
    return " and ".join(texts).replace("that of", "the estimated error of", not of_estimate)


def _nodes(case: Case, mesh: Mesh) -> str:
    start = mesh.nvertices
    if case.follows_tolerance:
        return f"at most {case.adapt.get('max_nodes', MAX_NODES)} nodes"
    target = case.adapt.get("target_nodes", start)
    return f"{start} nodes" if target == start else f"{start} to {target} nodes"


def _orders(case: Case) -> str:
    problem = CheckedProblem(case.problem)
    last = problem.final_orders(case.follows_tolerance)
    order = problem.at_grading_order.order if last else problem.order
    if not last:
        return f"order {order}"
    return f"order {order}, then one solve of order {last[-1]}" if len(last) == 1 else f"orders {order} to {last[-1]}"


LARGE, SMALL = 2.0, 2e-5  # m: devices in millimetres are larger, and smaller with the scale of another unit
LEAST_PERMEABILITY = 0.999  # diamagnetic metals have more
MOST_REMANENCE = 3.0  # T: magnets have at most 1.5
MOST_MILLITESLA = 3000.0  # larger values are in gauss
LEAST_CURRENT_DENSITY = 100.0  # A/m^2: windings have about 10^6, which is 1 A/mm^2
MOST_CURRENT_DENSITY = 1e10  # A/m^2: superconductors have 10^9
LONG = 20.0  # m
SAME = 1e-9  # tolerance for equal positions, relative to the size of the mesh or a facet


def size_text(mesh: Mesh) -> str:
    return f"{' x '.join(f'{size:.4g}' for size in np.ptp(mesh.p, axis=1))} m"


def unit_doubts(mesh: Mesh, scale: float = 1.0) -> Iterator[str]:
    extent, size = width_of(mesh), size_text(mesh)
    if extent > LARGE and scale == 1.0:
        yield f"the mesh is {size}: that looks like millimetres. If so, --scale 1e-3 (scale = 1e-3 in a case)."
    elif extent > LARGE or extent < SMALL:
        which = "large" if extent > LARGE else "small"
        yield (
            f"the mesh is {size}: a scale of {scale:g} looks too {which}. The scale is metres per unit of the file: "
            "1 for m, 1e-3 for mm, 1e-6 for um."
        )


def case_doubts(case: Case, mesh: Mesh) -> Iterator[str]:
    yield from unit_doubts(mesh, case.scale)
    problem, corners = case.problem, corners_of(mesh)
    given = coefficients(corners, problem.materials)
    remanence = magnitude(given.remanence)
    for index, (name, material) in enumerate(problem.materials.items()):
        if material.permeability < LEAST_PERMEABILITY:
            yield permeability_doubt(name, material.permeability)
        largest = remanence[given.material_index == index].max(initial=0.0)
        if material.coercivity is None and largest > MOST_REMANENCE:
            unit, factor = ("mT", 1e3) if largest <= MOST_MILLITESLA else ("gauss", 1e4)
            yield (
                f"remanence of '{name}' is {largest:.6g} T, more than any magnet has: that looks like {unit}. If so, "
                f"write {largest / factor:.6g}."
            )
        if 0.0 < abs(material.current_density) < LEAST_CURRENT_DENSITY:
            yield (
                f"current_density of '{name}' is {material.current_density:g} A/m^2: that looks like A/mm^2. If so, "
                f"write {material.current_density:g}e6."
            )
    for name, coil in case.coils.items():
        density = _current_density(coil)
        if density > MOST_CURRENT_DENSITY:
            yield (
                f"coil '{name}' has {density:.4g} A/m^2, and windings have about 10^6: check its ampere_turns, in A, "
                "and its section, in m."
            )
    depth = getattr(problem, "depth", None)
    if depth is not None and depth > LONG:
        yield f"depth is {depth:g} m: that looks like millimetres. If so, write {depth / 1e3:g}."


def permeability_doubt(name: str, permeability: float) -> str:
    start = f"permeability of '{name}' is relative, 1 for air; {permeability:.5g} "
    if permeability < 0.1:
        relative = permeability / VACUUM_PERMEABILITY
        return f"{start}looks like H/m. If so, write {relative:.4g} (divide by 4 pi 1e-7)."
    return f"{start}is below 1, as in superconductors only."


def seams(mesh: Mesh) -> Iterator[tuple[Ints, str, str]]:
    rim, cell = mesh.boundary_facets(), cell_of(mesh)
    nodes = np.unique(mesh.facets[:, rim])
    tree = cKDTree(mesh.p[:, nodes].T)
    yield (
        nodes[np.unique(tree.query_pairs(SAME * width_of(mesh), output_type="ndarray"))],
        "coincident rim node",
        ": the parts on both sides are not connected there. Unless a slit is intended, merge them (Gmsh: Coherence, or "
        "BooleanFragments).",
    )
    yield (
        _hanging(mesh, rim, nodes, tree),
        "hanging node",
        f", inside {cell.facet} of another {cell.name}, so the field has a gap there. Mesh both sides together.",
    )
    touch = "a point" if cell is TRIANGLE else "a point or an edge"
    yield (
        _non_manifold(mesh),
        "non-manifold node",
        f": parts of the mesh touch only in {touch}; such a node does not move.",
    )


def _hanging(mesh: Mesh, rim: Ints, nodes: Ints, tree: cKDTree) -> Ints:
    corners = mesh.p[:, mesh.facets[:, rim]]
    centre = corners.mean(axis=1)
    reach = magnitude(corners - centre[:, None]).max(axis=0)
    near = tree.query_ball_point(centre.T, reach * (1.0 - SAME))
    facet, node = np.repeat(np.arange(len(rim)), list(map(len, near))), nodes[np.concatenate(near).astype(int)]
    at, own = mesh.p[:, node], corners[:, :, facet]
    tolerance = SAME * reach[facet]
    is_corner = magnitude(at[:, None] - own).min(axis=0) <= tolerance
    return np.unique(node[~is_corner & (distances(at, own) < tolerance)])


def _non_manifold(mesh: Mesh) -> Ints:
    # Return nodes with several sets of elements that are connected by facets at the node.
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    nodes, corners = mesh.facets[:, inner], list[Ints]()
    for element in mesh.f2t[:, inner]:
        which = np.argmax(mesh.t[:, None, element] == nodes, axis=0)
        corners.append((which * mesh.nelements + element).ravel())
    fan = connected_components_of(mesh.t.size, np.stack(corners, axis=1))
    node = np.empty(fan.max() + 1, int)
    node[fan] = mesh.t.ravel()
    return np.flatnonzero(np.bincount(node) > 1)
