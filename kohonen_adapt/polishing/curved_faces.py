"""Count what lies between faces of tetrahedra and curved surfaces with the material that is there.

A P1 function on a mesh whose faces are chords of a sphere, cylinder or cone is a function in the true domain, too. Its
true functional is that of the mesh and for every sliver between face and surface ``S = volume (psi_true - psi_face)``
of the gradient of the element that covers the sliver, or goes on into it. Where values are given linearly on an outer
surface the linear function goes on, so that it is what is given on the surface itself. Counted is ``S + |S|``, as
`kernels/tetrahedron/slivers.py` says, where loops over stars have the same.
"""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, SPHERE, Tetrahedra
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.tetrahedralization import FACES, Tetrahedralization
from kohonen_adapt.outline.patches import Patches
from kohonen_adapt.problem.functional_value import density_in_space
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import looked_up

__all__ = ["CurvedFaces"]


@dataclass(frozen=True)
class CurvedFaces:
    """The curved patches of which slivers can be counted, wherever nodes and elements have gone.

    Attributes
    ----------
    patches
        Where all of them are.
    ritz, number
        The functional, and the number of every region in its tables, (nregions,).
    counted
        Those whose slivers are, (p,) bool.
    follows
        Those with given values, which go on as what they are, (p,) bool.
    rate
        Gradient of the given values, (p, 3).
    """

    patches: Patches
    ritz: Ritz
    number: Ints
    counted: Mask
    follows: Mask
    rate: Floats

    @classmethod
    def of(
        cls,
        tet: Tetrahedralization,
        patches: Patches,
        ritz: Ritz,
        number: Ints,
        linear: Mask,
        given: Mask,
        rate: Floats,
    ) -> "CurvedFaces":
        """Find out whose slivers can be counted: of spheres, cylinders and cones at which no source ends, for that of a
        given total is another one on every mesh; with given values of those that are linear, or zero beside a source,
        on the outer side of the mesh, and convex. `linear` are the patches without given values, or with such.
        """
        elements, values = tet.elements, np.asarray(ritz.values)
        counted = linear & np.isin(patches.shape, (SPHERE, CYLINDER, CONE))
        e, k = np.nonzero(np.append(counted, False)[elements.patch] & (elements.node[:, :1] >= 0))
        patch, across = elements.patch[e, k], elements.neighbour[e, k]
        outer = covered(tet.position, elements, patches, e, k)
        stated = np.nan if callable(ritz.source) else np.asarray(ritz.source)  # nan, as a function ends anywhere
        source = np.broadcast_to(looked_up(np.asarray(stated), number), number.shape)[elements.region]
        beyond = np.where(across >= 0, source[across], 0.0)
        ends = np.where(outer | (across >= 0), source[e] != beyond, source[e] != 0.0)
        level = np.abs(values[np.take_along_axis(elements.node[e], FACES[k], axis=1)]).max(axis=1, initial=0.0)
        where_given = (across >= 0) | outer | ((source[e] != 0.0) & (level > 0.0))
        counted[patch[np.where(given[patch], where_given, ends)]] = False
        return cls(patches, ritz, number, counted, counted & given, rate)

    def value(self, position: Floats, elements: Tetrahedra, values: Floats) -> float:
        """The sum of S + |S| of a function with these values at the nodes, (n,)."""
        e, k = np.nonzero(np.append(self.counted, False)[elements.patch] & (elements.node[:, :1] >= 0))
        outer, across = covered(position, elements, self.patches, e, k), elements.neighbour[e, k]
        has = outer | (across < 0)
        e, k, outer, across = e[has], k[has], outer[has], across[has]
        if not len(e):
            return 0.0
        corners, patch = position.T[:, elements.node[e].T], elements.patch[e, k]
        slope = np.einsum("dkm,km->dm", TETRAHEDRON.hat_gradients(corners), values[elements.node[e]].T)
        slope = np.where(~outer & self.follows[patch], self.rate[patch].T, slope)
        volume = volumes(position, elements, self.patches, e, k)
        volume = np.where(outer, np.minimum(volume, TETRAHEDRON.determinant(corners) / 6.0), volume)
        own, other = (self.number[elements.region[rows]] for rows in (e, across))
        change = np.where(across >= 0, density_in_space(slope, other, self.ritz), 0.0)
        own_density = density_in_space(slope, own, self.ritz)
        return float(2.0 * volume @ np.maximum(np.where(outer, change - own_density, own_density), 0.0))


def covered(position: Floats, elements: Tetrahedra, patches: Patches, e: Ints, k: Ints) -> Mask:
    """Whether elements are on the outer sides of the surfaces of their faces opposite to corners k, (f,)."""
    corners = position[np.take_along_axis(elements.node[e], FACES[k], axis=1)]
    middle = corners.mean(axis=1)
    out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.einsum("ij,ij->i", out, patches.project(elements.patch[e, k], middle) - middle) < 0.0


def volumes(position: Floats, elements: Tetrahedra, patches: Patches, e: Ints, k: Ints) -> Floats:
    """Volumes between faces and their surfaces, (f,): exact for a height that is a parabola."""
    corners, patch = position[np.take_along_axis(elements.node[e], FACES[k], axis=1)], elements.patch[e, k]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.zeros(len(e))
    for side in range(3):
        middle = 0.5 * (corners[:, side] + corners[:, side - 1])
        height += np.linalg.norm(patches.project(patch, middle) - middle, axis=1)
    return np.linalg.norm(normal, axis=1) * height / 6.0
