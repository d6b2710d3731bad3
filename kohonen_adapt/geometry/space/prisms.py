"""Prisms of plane strips, which may be coarse cylinders."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.geometry.plane.arcs import SHARPEST, naming
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.patches import constrained_faces, edges_of, seams_of
from kohonen_adapt.geometry.space.recognition import Skin, rounds_of_set
from kohonen_adapt.kernels.tetrahedron.arrays import CYLINDER, PLANE

__all__ = ["PossibleCylinder", "possible_cylinders"]


class PossibleCylinder(NamedTuple):
    names: list[str]  # names of boundaries that contain the prism
    strips: int
    turn: float  # largest turn between two strips in radians
    point: Floats  # (3,) on the axis
    axis: Floats  # (3,) unit vector
    radius: float

    def advice(self) -> str:
        key, called, first = naming(self.names, "surfaces")
        point, axis = ("({:.9g}, {:.9g}, {:.9g})".format(*each) for each in (self.point, self.axis))
        return (
            f"{called} has {self.strips} plane strips, with all nodes on a cylinder of radius {self.radius:.6g} about "
            f"the axis {axis} through {point}, that turn by up to {np.rad2deg(self.turn):.3g} degrees. It is treated "
            f"as a prism, with new nodes in its strips. If it is a cylinder, {first}adapt with "
            f'surfaces={{"{key}": ka.Cylinder({point}, {axis}, {self.radius:.9g})}}, in a case adapt.surfaces.{key} = '
            f'{{surface = "cylinder", point = [{point[1:-1]}], axis = [{axis[1:-1]}], radius = {self.radius:.9g}}}.'
        )


def possible_cylinders(movable: MovableSolid) -> Iterator[PossibleCylinder]:
    tet, patches = movable.tetrahedralization, movable.patches
    faces = constrained_faces(tet.mesh, tet.elements)
    seams = seams_of(faces, edges_of(faces, tet.nnodes), tet.position)
    plane = (patches.shape[patches.of_face] == PLANE) & (patches.surface_index[patches.of_face] < 0)
    skin = Skin.of(tet.position, faces.nodes, seams, seams.same_label & (seams.turn < SHARPEST), patches.of_face)
    for part in skin.sets(plane):
        for own, each in rounds_of_set(skin, part):
            if each.shape == CYLINDER:
                names = [name for name, side in faces.sides.items() if np.all(side[own] != 0)]
                turn = skin.turn[np.isin(skin.pairs, own).all(axis=1)].max()
                strips = len(np.unique(patches.of_face[own]))
                yield PossibleCylinder(names, strips, float(turn), each.origin, each.axis, each.size)
