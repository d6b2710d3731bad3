"""Rotation of a part of a mesh by whole steps of the nodes around the part."""

from collections.abc import Sequence
from math import ceil, floor

import numpy as np
from scipy.spatial import KDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import point_text
from kohonen_adapt.mesh.curved import corners_of, midside_offsets
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.joining import sides_of, with_images
from kohonen_adapt.mesh.motions import Rotation, moved
from kohonen_adapt.mesh.names import elements_in, named_sets
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["turned"]

ROUND = 1e-6  # maximum distance of nodes from a circle, relative to the radius
EVEN = 1e-6  # maximum difference of steps, and of an angle from whole steps, in radians
SAME = 1e-5  # maximum distance of coinciding nodes on the circle, relative to the radius


def turned(
    mesh: MeshTri, name: str | Sequence[str], angle: float, *, centre: tuple[float, float] = (0.0, 0.0)
) -> MeshTri:
    """Rotate subdomains about a point, for instance a rotor.

    The rotating part must be everything inside, or outside, a circle of evenly spaced nodes, for instance a ring in the
    middle of an air gap. The angle must be a whole number of node spacings, so that the nodes of both sides meet again.
    If the part rotates out of a sector, the arcs without a counterpart at both ends are boundary. An oriented facet
    there is oriented towards its only element. Remanences, currents and curves are not stored in the mesh and must be
    rotated separately.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri` or `MeshTri2`.
    name
        Name or names of the subdomains to rotate.
    angle
        In radians, counter-clockwise positive.
    centre
        Centre of the rotation (x, y), in mesh units.

    Returns
    -------
    MeshTri
        Mesh with the same elements in the same order, the same midside offsets, and all names. If the circle is
        complete, nodes keep their indices. In a sector some nodes are duplicated, and nodes that meet are merged.

    Raises
    ------
    ValueError
        If the angle is not a whole number of node spacings (with the two nearest angles), if the part and the rest do
        not meet on circles of evenly spaced nodes about the centre, before and after the rotation, or if the mesh or a
        name is invalid.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri.init_symmetric().refined(1).translated((-0.5, -0.5))
    >>> mesh = mesh.with_subdomains({"rotor": lambda x: np.abs(x).max(axis=0) < 0.25})  # four nodes on a circle
    >>> quarter = ka.turned(mesh, "rotor", np.pi / 2)
    >>> np.allclose(quarter.p, mesh.p), np.array_equal(quarter.t, mesh.t)  # other elements between the same nodes
    (True, False)
    """
    check_mesh(mesh, space=False)
    offset, mesh = midside_offsets(mesh), corners_of(mesh)
    motion, part = Rotation(angle, centre), elements_in(mesh, name)
    if part.all():
        raise ValueError(f"a part of the mesh must turn in the rest of it; {name!r} is all.")
    inner, outer = (np.unique(mesh.t[:, which]) for which in (part, ~part))
    shared, origin, count = np.intersect1d(inner, outer), np.array(motion.centre)[:, None], mesh.nvertices
    radii = circles_between(mesh, part, shared, origin)
    steps = [step_of(mesh.p[:, shared] - origin, radius) for radius in radii]
    turn = Rotation(whole_steps(motion.angle, steps), motion.centre)
    copy = np.arange(count)
    copy[shared] = count + np.arange(shared.size)
    p, t, nodes = np.hstack([mesh.p, mesh.p[:, shared]]), mesh.t.copy(), copy[inner]
    t[:, part], p[:, nodes] = copy[t[:, part]], moved(turn.matrix, p[:, nodes])
    image = np.arange(p.shape[1])
    for radius in radii:
        ours, theirs = (rows[on_circle(p[:, rows] - origin, radius)] for rows in (nodes, outer))
        distance, at = KDTree(p[:, theirs].T).query(p[:, ours].T)
        image[ours[distance <= SAME * radius]] = theirs[at[distance <= SAME * radius]]
    if np.array_equal(image, np.arange(len(image))):
        raise ValueError(f"turned by {turn.angle:.6g} rad {name!r} and the rest meet nowhere; turn it by less.")
    sides = {each: sides_of(mesh, rows) for each, rows in (mesh.boundaries or {}).items()}
    offset[:, :, part] = np.tensordot(turn.matrix[:, :2], offset[:, :, part], 1)
    return with_images(mesh, p, t, image, named_sets(mesh.subdomains), sides, offset)


def on_circle(x: Floats, radius: float) -> Mask:
    return np.abs(np.hypot(*x) - radius) <= ROUND * radius


def circles_between(mesh: MeshTri, part: Mask, shared: Ints, origin: Floats) -> list[float]:
    number_facets(mesh)
    one, other = mesh.f2t
    between = np.flatnonzero((other >= 0) & (part[one] != part[other]))
    radius = np.sort(np.hypot(*(mesh.p[:, shared] - origin)))
    radii = radius[np.diff(radius, prepend=-np.inf) > ROUND * radius].tolist()
    ends = mesh.p[:, mesh.facets[:, between]] - origin[:, :, None]
    astray = ends[:, :, np.ptp(np.hypot(*ends), axis=0) > 2.0 * ROUND * radius.max(initial=0.0)].mean(axis=1) + origin
    if not between.size or astray.size:
        where = f"they meet elsewhere, too, as at {point_text(astray[:, 0])}" if astray.size else "they do not meet"
        raise ValueError(
            f"what turns and the rest must meet on circles about {tuple(origin[:, 0].tolist())}; {where}. Name all "
            "that turns, up to a ring of nodes in the air gap (a surface of its own in the mesh)."
        )
    return radii


def step_of(x: Floats, radius: float) -> float:
    angle = np.sort(np.arctan2(*x[::-1, on_circle(x, radius)]))
    gaps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
    steps = np.delete(gaps, np.argmax(gaps)) if gaps.max() > 1.5 * np.median(gaps) else gaps
    if not steps.size or np.ptp(steps) > 2.0 * EVEN:
        least, most = np.degrees([gaps.min(), steps.max(initial=gaps.min())])
        raise ValueError(
            f"the nodes on the circle of radius {radius:.6g} between what turns and the rest must be evenly spaced; "
            f"they are {least:.6g} to {most:.6g} degrees apart. Mesh it so (Gmsh: Transfinite Curve), and pin it."
        )
    return float(steps.mean())


def whole_steps(angle: float, steps: Sequence[float]) -> float:
    for step in steps:
        count = round(angle / step)
        if abs(angle - count * step) > EVEN:
            low, high = floor(angle / step) * step, ceil(angle / step) * step
            raise ValueError(
                f"angle must be whole steps of the nodes on the circle, {step:.9g} rad ({np.degrees(step):.6g} "
                f"degrees) each; got {angle:.9g} rad. The nearest two are {low:.9g} and {high:.9g} rad."
            )
        angle = count * step
    return angle
