"""Meshes of scikit-fem for NGSolve, with materials, boundaries, pairs and curved sides."""

from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.geometry.plane.pairs import image_nodes
from kohonen_adapt.magnetostatics import Magnetostatics
from kohonen_adapt.mesh.curved import corners_of, is_second_order, offsets_of_sides

PERIODIC = 2  # Netgen's type of identified points
ON_AXIS = 1e-9  # distance from the axis, relative to the size of the mesh
AT_MIDDLE = -0.125  # value of NGSolve's quadratic function of a side at the middle of the side


def netgen_mesh(mesh: MeshTri, problem: Magnetostatics) -> Any:
    """Return the triangles for NGSolve, with the corners of curved elements.

    Boundaries are those with potentials, pairs and the open boundary. Boundary k of a pair is identified by number k.
    """
    import ngsolve
    from netgen.meshing import Element1D, Element2D, Mesh, MeshPoint, Pnt

    mesh = corners_of(mesh)
    made = Mesh(dim=2)
    points = [made.Add(MeshPoint(Pnt(x, y, 0.0))) for x, y in mesh.p.T]
    (ax, ay), (bx, by), (cx, cy) = mesh.p[:, mesh.t].swapaxes(0, 1)
    clockwise = (bx - ax) * (cy - ay) < (cx - ax) * (by - ay)
    corners = np.where(clockwise, mesh.t[[0, 2, 1]], mesh.t)
    for name in problem.materials:
        region = made.AddRegion(name, dim=2)
        for triangle in corners[:, mesh.subdomains[name]].T:  # in the order of `element_numbers`
            made.Add(Element2D(region, [points[node] for node in triangle]))
    for name, facets in _sides(mesh, problem).items():
        region = made.AddRegion(name, dim=1)
        for side in mesh.facets[:, facets].T:
            made.Add(Element1D([points[node] for node in side], index=region))
    for number, (nodes, images) in enumerate(image_nodes(mesh, problem.pairs), start=1):
        for node, image in zip(nodes, images, strict=True):
            made.AddPointIdentification(points[node], points[image], identnr=number, type=PERIODIC)
    return ngsolve.Mesh(made)


def element_numbers(mesh: MeshTri, problem: Magnetostatics) -> np.ndarray:
    """Return the number in the mesh of scikit-fem of every element of `netgen_mesh`."""
    return np.concatenate([mesh.subdomains[name] for name in problem.materials])


def _sides(mesh: MeshTri, problem: Magnetostatics) -> dict[str, np.ndarray]:
    """Facets by name; of a facet with two names the later counts, and facets on an axis have none."""
    names = [name for pair in problem.pairs for name in pair[:2]]
    names += [problem.open_boundary] if problem.open_boundary else []
    names += problem.potential
    owner = np.full(mesh.facets.shape[1], -1)
    for number, name in enumerate(names):
        owner[mesh.boundaries[name]] = number
    if problem.axisymmetric:
        radius = mesh.p[0, mesh.facets].max(axis=0)
        owner[radius <= ON_AXIS * np.ptp(mesh.p, axis=1).max()] = -1
    return {name: np.flatnonzero(owner == number) for number, name in enumerate(names) if np.any(owner == number)}


def curve_sides(mesh: MeshTri, target: Any) -> Any:
    """Curve the sides of the same mesh in NGSolve as parabolas through midside nodes.

    Returns the offsets from straight sides, a function on the mesh, or None if all sides are straight.
    """
    if not is_second_order(mesh):
        return None
    import ngsolve as ng

    offset = offsets_of_sides(mesh)
    facet = {ends: number for number, ends in enumerate(zip(*np.sort(mesh.facets, axis=0).tolist(), strict=True))}
    offsets = ng.GridFunction(ng.VectorH1(target, order=2))
    for axis, component in enumerate(offsets.components):
        for edge in target.edges:
            (unknown,) = component.space.GetDofNrs(edge)
            component.vec[unknown] = float(offset[axis, facet[ends_of(edge)]]) / AT_MIDDLE
    target.SetDeformation(offsets)
    return offsets


def ends_of(edge: Any) -> tuple[int, int]:
    """Return the sorted vertices of an edge of NGSolve."""
    one, other = sorted(vertex.nr for vertex in edge.vertices)
    return one, other
