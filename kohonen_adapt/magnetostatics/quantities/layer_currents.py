"""Force on the parts of windings around a body."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.coils.motion import images_of
from kohonen_adapt.magnetostatics.coils.rules import currents_of
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid

__all__ = ["LayerCurrents", "free_flux_density", "layer_currents"]


class LayerCurrents(NamedTuple):
    x: Floats  # (3, n) in m
    element: Ints  # (n,)
    moment: Floats  # (3, n) in A m

    def force(self, field: LocalSolid) -> Floats:
        return np.cross(self.moment, field.reaction_at(self.x, self.element), axis=0)


def layer_currents(field: LocalSolid, weight: Floats) -> LayerCurrents:
    mesh, images, points, moments = field.mesh, images_of(field.mesh, field.mirrors), [], []
    for coil in field.drive.sources.coils.values():
        x, moment = currents_of(coil.winding)
        x, moment = images.folded(x, coil.ampere_turns / len(images.sign) * moment)
        points.append(x)
        moments.append(moment)
    x, moment = np.concatenate(points, axis=1), np.concatenate(moments, axis=1)
    element = field.elements_at(x)
    rows = np.flatnonzero(element >= 0)
    x, moment, element = x[:, rows], moment[:, rows], element[rows]
    factor = np.sum(weight[mesh.t[:, element]] * field.elements.barycentric(x, element), axis=0)
    rows = np.flatnonzero(factor != 0.0)
    return LayerCurrents(x[:, rows], element[rows], factor[rows] * moment[:, rows])


def free_flux_density(field: LocalSolid) -> Floats:
    drive = field.drive
    return VACUUM_PERMEABILITY * (drive.at_points - drive.elements.gradient_at_points(drive.potential))
