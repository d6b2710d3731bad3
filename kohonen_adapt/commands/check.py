"""Description of a mesh and of its faults."""

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain, combinations
from typing import Any

import numpy as np
import scipy  # loads `scipy.optimize` at its first use
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.commands.plan import seams, size_text, unit_doubts
from kohonen_adapt.display import counted, listed_numbers, plural
from kohonen_adapt.geometry.plane.arcs import possible_arcs
from kohonen_adapt.geometry.plane.layers import bands_of, check_layer_count, parts_of
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules, floor_of
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.prisms import possible_cylinders
from kohonen_adapt.geometry.space.surfaces import NamedSurfaces
from kohonen_adapt.io import Groups, check_names_written
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, HELD, INSIDE, ON_PATCH, ON_RIDGE, PLANE, SPHERE
from kohonen_adapt.loop.single_steps import why_held
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of, centroids_of, facet_normals
from kohonen_adapt.mesh.measures import angles_between, area, hat_gradients, magnitude, quality
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = [
    "angles_described",
    "described",
    "facets_described",
    "faults",
    "held_described",
    "hints_of_mesh",
    "moving",
    "outlines_described",
    "points_described",
    "surfaces_described",
]

SHAPES = {PLANE: "plane", SPHERE: "sphere", CYLINDER: "cylinder", CONE: "cone"}
SMALL = 2  # faces per patch of a curved surface that was not recognised
MANY = 12  # patches of this size; fewer may be details of a plane drawing
NAMED = 3  # names listed
SHOWN = 3  # positions listed per fault
GROUPS = {2: ("surface", "lines"), 3: ("volume", "surfaces")}  # groups of subdomains and boundaries
LONG = 25.0  # squared perimeter over area of a narrow subdomain; 25 for a rectangle of 1 by 4
TIPS = 0.05  # fraction of the area; a smaller single layer is a tip in which two sides meet
LISTED = 6  # radii listed; of more, the range
REASONS = 12  # reasons listed


def facets_described(mesh: MeshTet, rows: Ints) -> str:
    total = 0.5 * magnitude(facet_normals(mesh, rows)).sum()
    inside = int(np.sum(mesh.f2t[1, rows] >= 0))
    return f", {total:.4g} m^2{f', {inside} of them inside' if inside else ''}"


def angles_described(mesh: Mesh) -> str:
    normal = hat_gradients(mesh).swapaxes(0, 1)
    angles = [np.pi - angles_between(one, other) for one, other in combinations(normal, 2)]
    low, high = np.degrees([np.min(angles), np.max(angles)])
    if len(mesh.p) == 2:
        return f"smallest angle: {low:.3g} degrees"
    return f"dihedral angles: from {low:.3g} to {high:.3g} degrees"


def surfaces_described(movable: MovableSolid) -> list[str]:
    surfaces, number = movable.surfaces, movable.freedom.number
    sizes = {text: surfaces.size[surfaces.shape == shape] for shape, text in SHAPES.items()}
    shapes = [
        counted(len(size), text) + (_radii(size) if text in ("sphere", "cylinder") else "")
        for text, size in sizes.items()
        if len(size)
    ]
    inside, faces, ridges, held = (np.sum(number == kind) for kind in (INSIDE, ON_PATCH, ON_RIDGE, HELD))
    return [
        f"surfaces: {len(surfaces.shape)}, {', '.join(shapes) or 'of unknown shape'}; "
        f"{counted(len(surfaces.ridge_shape), 'edge')} between them",
        f"nodes: {inside} free, {faces} on surfaces, {ridges} on edges, {held} fixed",
    ]


def doubtful_patches(movable: MovableSolid) -> Iterator[str]:
    tet = movable.tetrahedralization
    patch, across = tet.elements.patch[tet.used], tet.elements.neighbour[tet.used]
    share = np.where(across < 0, 1.0, 0.5)  # an interior face has two elements
    faces = np.bincount(patch[patch >= 0], share[patch >= 0], minlength=len(movable.surfaces.shape))
    small = (movable.surfaces.shape == PLANE) & (faces <= SMALL)
    if np.sum(small) >= MANY:
        names = [f"'{name}'" for name, manner in movable.patches.names.items() if np.any(manner[small] != 0)]
        more = ", ..." if len(names) > NAMED else ""
        where = f" in {', '.join(names[:NAMED])}{more}" if names else ""
        yield (
            f"{np.sum(small)} plane surfaces of one or two faces{where}: their nodes do not move. If they are parts of "
            'a curved surface, specify it with --surfaces, in Python surfaces={"NAME": ka.Cylinder(point, axis, '
            "radius)}, or ka.Sphere, ka.Cone."
        )


def described(mesh: Mesh) -> list[str]:
    cell, in_plane = cell_of(mesh), len(mesh.p) == 2
    areas, value, count = area(mesh), quality(mesh), _memberships(mesh).sum(axis=0)
    worst = int(np.argmin(value))
    return [
        f"size: {size_text(mesh)}, {mesh.nvertices} nodes, {counted(mesh.nelements, cell.name)}",
        *(
            f"subdomain '{name}': {counted(len(rows), cell.name)}, {areas[rows].sum():.4g} m^{cell.dim}"
            for name, rows in sorted(named_sets(mesh.subdomains).items())
        ),
        *(
            f"boundary '{name}': {counted(len(rows), 'facet')}{'' if in_plane else facets_described(mesh, rows)}"
            for name, rows in sorted(named_sets(mesh.boundaries).items())
        ),
        f"coverage: {np.sum(count == 1)} {plural(cell.name)} in one subdomain, {np.sum(count == 0)} in none, "
        f"{np.sum(count > 1)} in two or more",
        f"quality: worst {value[worst]:.3g} ({cell.name} {worst} near {_middle(mesh, worst)} m), "
        f"mean {value.mean():.3g}",
        angles_described(mesh),
    ]


def points_described(groups: Groups) -> list[str]:
    places = sorted(groups.places.items())
    return [f"point '{name}': {', '.join(map(point_text, points.T))} m" for name, points in places]


def _memberships(mesh: Mesh) -> Mask:
    sets = named_sets(mesh.subdomains).values()
    is_in = np.zeros((len(sets), mesh.nelements), bool)
    for own, rows in zip(is_in, sets, strict=True):
        own[rows] = True
    return is_in


def unions(mesh: Mesh) -> dict[str, list[str]]:
    # The subdomains that consist of others: all that turns in a machine, or a second name. They need no material.
    sets = {name: set(rows.tolist()) for name, rows in named_sets(mesh.subdomains).items()}
    found = dict[str, list[str]]()
    for name in sorted(sets, key=lambda name: len(sets[name]), reverse=True):
        parts = [other for other in sets if other not in (name, *found) and sets[other] <= sets[name]]
        if parts and set.union(*(sets[part] for part in parts)) == sets[name]:
            found[name] = sorted(parts)
    return found


def _middle(mesh: Mesh, element: int | np.signedinteger[Any]) -> str:
    return point_text(centroids_of(mesh, element))


def moving(mesh: Mesh, surfaces: NamedSurfaces | None = None) -> tuple[list[str], Iterator[str]]:
    rules = Rules(surfaces=surfaces or None)
    if cell_of(mesh) is TETRAHEDRON:
        solid = MovableSolid.of(mesh, rules)
        return surfaces_described(solid), chain(doubtful_patches(solid), advice(possible_cylinders(solid)))
    movable = MovableMesh.of(mesh, rules)
    return outlines_described(movable), chain(thin_parts(movable), advice(possible_arcs(movable)))


def held_described(mesh: Mesh, surfaces: NamedSurfaces) -> list[str]:
    why = why_held(mesh, Rules(surfaces=surfaces or None))
    counts = Counter(why[why != ""].tolist()).most_common()
    more = len(counts) - REASONS
    lines = [f"  {count}: {reason}" for reason, count in counts[:REASONS]]
    return [f"held nodes: {sum(count for _, count in counts)}", *lines, *([f"  and {more} more reasons"] * (more > 0))]


def outlines_described(movable: MovableMesh) -> list[str]:
    outline, chains = movable.outline, movable.constraints.chains
    radii = 1.0 / np.abs(chains.curvature[outline.on_circles])
    splines = len(outline.straight) - np.sum(outline.straight) - len(radii)
    free, sliding, jumps, held = (np.sum(mask) for mask in outline.nodes_by_freedom().values())
    return [
        f"boundaries and interfaces: {counted(len(outline.straight), 'segment')}, {np.sum(outline.straight)} straight, "
        f"{len(radii)} on arcs{_radii(radii)}, {f'{splines} on splines, ' if splines else ''}"
        f"{np.sum(chains.closed)} closed",
        f"nodes: {free} free, {sliding} on boundaries and interfaces, {jumps} at corners, {held} fixed",
    ]


def _radii(radii: Floats) -> str:
    return f" (radius {listed_numbers(radii, LISTED)} m)" if radii.size else ""


def faults(mesh: Mesh) -> Iterator[str]:
    # A run refuses a mesh with a fault, or its result is wrong. Hints do not change the exit status.
    yield from _names(mesh)
    for nodes, called, remedy in seams(mesh):
        if len(nodes):
            places = ", ".join(map(point_text, mesh.p[:, nodes[:SHOWN]].T))
            yield f"{counted(len(nodes), called)}, at {places}{', ...' if len(nodes) > SHOWN else ''}{remedy}"


def hints_of_mesh(mesh: Mesh, scale: float = 1.0) -> Iterator[str]:
    yield from unit_doubts(mesh, scale)
    for name, parts in unions(mesh).items():
        yield f"subdomain '{name}' consists of {listed(parts)}: give materials to these, or to '{name}' alone."
    if not named_sets(mesh.boundaries):
        yield (
            'no boundary has a name: for a potential, write rim = "outer" above all tables of a case to name the whole '
            f"rim, or give the rim a physical group of {GROUPS[len(mesh.p)][1]}."
        )
    value, cell = quality(mesh), cell_of(mesh)
    least = floor_of(Rules(), cell.dim)
    if bad := np.sum(value < least):
        yield (
            f"{bad} {plural(cell.name)} have a quality below {least}, the default of min_quality; the worst, "
            f"{value.min():.3g}, is near {_middle(mesh, np.argmin(value))}. Their quality is not reduced further, so "
            "their nodes hardly move."
        )


def advice(found: Iterable[Any]) -> Iterator[str]:
    return (each.advice() for each in found)


def thin_parts(movable: MovableMesh) -> Iterator[str]:
    triangulation, constraints = movable.triangulation, movable.constraints
    size = area(triangulation.mesh)
    for name, rows in named_sets(triangulation.mesh.subdomains).items():
        for inside in parts_of(triangulation.elements, triangulation.region_of_input[rows]):
            own = inside[triangulation.elements.region]
            if perimeter(triangulation, own) ** 2 < LONG * size[own].sum():
                continue
            try:
                bands = bands_of(triangulation, constraints, name, 2, inside)
            except ValueError:  # no pair of facing sides, so not thin
                continue
            for band in bands:
                one, other = (np.isin(triangulation.elements.node, side).any(axis=1) for side in band.sides)
                if size[own & one & other].sum() < TIPS * size[own].sum():
                    continue
                try:
                    check_layer_count(triangulation.position, band)
                except ValueError as error:
                    yield f"{str(error).partition(';')[0]}: a field across it is poor. Refine it there."


def perimeter(triangulation: Triangulation, own: Mask) -> float:
    across = triangulation.elements.neighbour
    e, k = np.nonzero(own[:, None] & ((across < 0) | ~own[across]))
    a, b = triangulation.elements.ends(e, k)
    return float(magnitude((triangulation.position[b] - triangulation.position[a]).T).sum())


def _names(mesh: Mesh) -> Iterator[str]:
    is_in, name, inside = _memberships(mesh), plural(cell_of(mesh).name), GROUPS[len(mesh.p)][0]
    count = is_in.sum(axis=0)
    overlap = (count > 1) & ~_can_be_covered(is_in[:, count > 0])
    for which, text in ((count == 0, "no subdomain"), (overlap, "more than one subdomain")):
        if which.any():
            yield (
                f"{np.sum(which)} {name} are in {text}, one near {_middle(mesh, np.argmax(which))}: a case needs "
                f"exactly one material for each. Give every {inside} one physical group, or name the materials so that "
                "they do not overlap."
            )
    try:
        check_names_written(mesh)
    except ValueError as error:
        yield str(error)


def _can_be_covered(is_in: Mask) -> bool:
    # True if some of the subdomains, shape (k, nelements), contain every element exactly once
    if not is_in.size:
        return True
    once = scipy.optimize.LinearConstraint(np.unique(is_in, axis=1).T.astype(float), 1.0, 1.0)
    count, bounds = len(is_in), scipy.optimize.Bounds(0.0, 1.0)
    found = scipy.optimize.milp(np.zeros(count), integrality=np.ones(count), bounds=bounds, constraints=once)
    return bool(found.success)
