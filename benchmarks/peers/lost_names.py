"""Find the names of subdomains and boundaries that a method loses, on triangles and tetrahedra."""

import numpy as np
from skfem import Mesh


def lost_names(before: Mesh, after: Mesh) -> list[str]:
    """Names that are not there afterwards or have another size."""
    then, now = sizes(before), sizes(after)
    return sorted(name for name, size in then.items() if not np.isclose(size, now.get(name, np.nan), rtol=1e-9))


def sizes(mesh: Mesh) -> dict[str, float]:
    """Of every subdomain and boundary."""
    elements, facets = measures(mesh.p[:, mesh.t]), measures(mesh.p[:, mesh.facets])
    parts, sides = mesh.subdomains or {}, mesh.boundaries or {}
    return {name: elements[rows].sum() for name, rows in parts.items()} | {
        name: facets[np.asarray(rows)].sum() for name, rows in sides.items()
    }


def measures(corners: np.ndarray) -> np.ndarray:
    """Lengths, areas or volumes of simplices with corners (d, corners, n), up to a factor."""
    edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0)
    return np.sqrt(np.linalg.det(edges.transpose(0, 2, 1) @ edges))
