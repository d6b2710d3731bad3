"""A mesh between circles, and Gmsh files of second order written by hand."""

import numpy as np
from skfem import MeshTri2

from helpers.meshes import circle, closed, shells, with_lines

RADII = {"inner": 0.5, "interface": 1.0, "outer": 1.5}


def annulus(count):
    """Two rings of `count` times two triangles around a hole: three circles and a straight spoke as boundaries."""
    mesh = shells([radius * circle(count) for radius in RADII.values()], 1)
    lines = {name: closed(np.arange(k * count, (k + 1) * count)) for k, name in enumerate(RADII)}
    core = np.any(mesh.t < count, axis=0)
    mesh = with_lines(mesh, lines | {"spoke": count * np.arange(3)})
    return mesh.with_subdomains({"core": np.flatnonzero(core), "shell": np.flatnonzero(~core)})


def on_circles(mesh, facets):
    """Middles of facets: on the circle through both ends where there is one around the origin, else in the middle."""
    ends = mesh.p[:, mesh.facets[:, facets]]
    middle, radius = ends.mean(axis=1), np.hypot(*ends)
    round_ = np.abs(radius[0] - radius[1]) < 1e-9
    return np.where(round_, middle * radius[0] / np.hypot(*middle), middle)


def curved_annulus(count):
    """`annulus` as a `MeshTri2` with all midside nodes on the circles."""
    return with_midsides(annulus(count), on_circles)


def with_midsides(mesh, place):
    """A `MeshTri2` with the midside nodes that `place(mesh, facets)` returns, and the names of the mesh."""
    midsides = place(mesh, np.arange(mesh.facets.shape[1]))
    return MeshTri2(np.hstack([mesh.p, midsides]), mesh.t, mesh.boundaries, mesh.subdomains)


def write_second_order(path, mesh, middles, *, version, seed=0):
    """A text file with `triangle6` and `line3`; nodes numbered with gaps and listed in any order."""
    rng = np.random.default_rng(seed)
    nodes, facets = mesh.p.shape[1], mesh.facets.shape[1]
    number = rng.choice(10 * (nodes + facets), nodes + facets, replace=False) + 1
    number[:nodes] = np.sort(number[:nodes])  # so that the corners come back in the order of the mesh
    points = np.concatenate([mesh.p, middles], axis=1)
    between = {tuple(pair): number[nodes + facet] for facet, pair in enumerate(mesh.facets.T.tolist())}
    elements = []
    for dimension, kind, sets, corners in (
        (1, 8, mesh.boundaries, mesh.facets),
        (2, 9, mesh.subdomains, mesh.t),
    ):
        for tag, items in enumerate(sets.values(), 1):
            for item in items:
                a = rng.permutation(corners[:, item]).tolist()
                sides = [(a[0], a[1])] if dimension == 1 else [(a[0], a[1]), (a[1], a[2]), (a[2], a[0])]
                row = [*number[a], *(between[tuple(sorted(side))] for side in sides)]
                elements.append((dimension, kind, tag, [str(value) for value in row]))
    names = [f'1 {k} "{name}"' for k, name in enumerate(mesh.boundaries, 1)]
    names += [f'2 {k} "{name}"' for k, name in enumerate(mesh.subdomains, 1)]
    lines = [f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(names)}", *names, "$EndPhysicalNames"]
    order = rng.permutation(len(number))
    where = [f"{x!r} {y!r} 0" for x, y in points.T.tolist()]
    if version == "2.2":
        lines += [f"$Nodes\n{len(number)}", *(f"{number[k]} {where[k]}" for k in order), "$EndNodes"]
        lines += [f"$Elements\n{len(elements)}"]
        lines += [f"{k} {kind} 2 {tag} {tag} {' '.join(row)}" for k, (_, kind, tag, row) in enumerate(elements, 1)]
    else:
        curves, surfaces = (range(1, len(sets) + 1) for sets in (mesh.boundaries, mesh.subdomains))
        lines += [f"$Entities\n0 {len(curves)} {len(surfaces)} 0"]
        lines += [f"{tag} 0 0 0 1 1 0 1 {tag} 0" for tag in (*curves, *surfaces)]
        lines += [f"$EndEntities\n$Nodes\n1 {len(number)} 1 {number.max()}\n2 1 0 {len(number)}"]
        lines += [*(str(number[k]) for k in order), *(where[k] for k in order), "$EndNodes"]
        lines += [f"$Elements\n{len(elements)} {len(elements)} 1 {len(elements)}"]
        lines += [f"{d} {tag} {kind} 1\n{k} {' '.join(row)}" for k, (d, kind, tag, row) in enumerate(elements, 1)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path
