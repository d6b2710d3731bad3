"""Relocation of the nodes of a mesh to a given density."""

import logging
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import with_nearest_names
from kohonen_adapt.geometry.plane.curves import Curve
from kohonen_adapt.geometry.plane.missing_layers import with_layers
from kohonen_adapt.geometry.rules import LeastQuality, Pinned, Rules, check_for
from kohonen_adapt.geometry.space.surfaces import Surface
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.mesh.cells import check_kind
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.som.relocate import report_sagitta
from kohonen_adapt.som.schedule import Schedule, check_training

logger = logging.getLogger("kohonen_adapt")

__all__ = ["relocate"]


@with_nearest_names({"size": "density", "sizes": "density", "indicators": "density", "fixed": "pinned"})
def relocate(
    mesh: Mesh,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    *,
    schedule: Schedule | None = None,
    topology: str = "flip",
    min_quality: LeastQuality = "auto",
    pinned: Pinned = (),
    seed: int = 0,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
    surfaces: Mapping[str, Surface] | None = None,
) -> Mesh:
    """Move the nodes of a mesh to a given density.

    All nodes and their numbers are kept. Nodes of triangles are moved by a Kohonen map, nodes of tetrahedra by sweeps
    of smoothing with swaps of elements between the sweeps. `adapt`, which repeats relocation for an estimated density,
    recycles nodes by default, too.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, a `skfem.MeshTri2`, of which the corners are moved, or a `skfem.MeshTet`. The mesh is not
        modified.
    density
        Wanted nodes per area or volume up to a factor, >= 0 and not zero everywhere: an array of shape (nelements,), or
        a callable of points x, shape (2, n), in space (3, n), that returns shape (n,). Zeros are raised to 1e-6 of the
        largest value.
    schedule
        Schedule of the map. None means `Schedule.default` with a first radius that depends on how far the mesh is from
        the density, so that repeated calls, each with a new estimate, continue to improve the mesh. ``Schedule(())``
        moves nothing; with ``topology="flip"`` it makes each region constrained Delaunay. For tetrahedra, None means 8
        sweeps with "flip", 6 with "fixed" and 3 with "recycle". Stages, if any, are presented before the sweeps; rounds
        are refused. Without stages and sweeps elements are swapped, to raise the least quality, and recycled.
    topology, min_quality, pinned, curves, periodic, layers, surfaces
        Constraints on the nodes, see `Rules`. With ``topology="recycle"`` nodes do not keep their numbers.
    seed
        Seed of all random numbers. The same seed gives the same mesh, bit for bit, on one type of CPU.

    Returns
    -------
    MeshTri or MeshTet
        Mesh with the same number of nodes and the same names. Nodes stay in their region, and boundaries and interfaces
        keep their shape. If the input is a `skfem.MeshTri2` and a boundary or interface is curved, so is the result:
        its curved sides lie on arcs, where corners and midside nodes are on a circle, or else on splines through both.
        Midside nodes are put on these curves, or nearer to the chord where an element would be inverted. Curved sides
        on no boundary or interface are straightened.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, if an argument is out of range,
        or if the mesh has fewer layers than `layers` requests.

    Notes
    -----
    The density belongs to the input mesh throughout. A training point moves only nodes of its own region. Equation 1,
    the neighbourhood and the treatment of boundaries are from Lowther and Mai, "On Automatic Mesh Generation using
    Kohonen Maps". See `kernels/tetrahedron/swap.py` for the swaps of tetrahedra, and `kernels/tetrahedron/smooth.py`
    for the smoothing, which balances the mass of the density in every element and the shape of the element.

    The logger ``kohonen_adapt`` reports the reason if no node moves (WARNING), the distance between facets and the
    curves on which their nodes slide (INFO), and the arcs that are recognised (DEBUG).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(4)
    >>> finer_below = ka.relocate(mesh, lambda x: 1 / (0.1 + x[1]))
    >>> finer_below.p.shape == mesh.p.shape
    True
    """
    check_training(schedule, seed)
    rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces).guarded()
    check_kind(mesh, curved=True, space=True)
    method = method_of(mesh)
    check_for(rules, method.dim)
    layered = with_layers(mesh, rules)
    movable = method.open(layered, rules, None)
    if layered is not mesh and not callable(density) and np.shape(density) == mesh.t.shape[1:]:
        density = np.asarray(density)[find_elements(mesh, layered.p[:, layered.t].mean(axis=1))]
    expect(*method.moving_kernels(topology, schedule))
    moved = method.relocate(movable, density, schedule, topology, np.random.default_rng(seed), int(mesh.nvertices))
    report_sagitta(moved.before, movable)
    work = moved.work(movable)
    if not work.moved and schedule != Schedule(()):  # an empty schedule is used for its flips alone
        logger.warning("relocate moved no node: %s.", work.why_still)
    return movable.mesh()
