"""Drive and energy of a vector potential on edge elements."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.applied_field import Drive, total_potential
from kohonen_adapt.magnetostatics.equations.edge_elements import EdgeElements
from kohonen_adapt.magnetostatics.equations.given_field import AppliedField, circulations, field_at
from kohonen_adapt.mesh.cells import centroids_of
from kohonen_adapt.mesh.elements.rules import tabled_rule

__all__ = ["EdgeDrive", "edge_drive"]

DEGREE = 4  # of the quadrature rule of the difference: 2 is too coarse in elements that a winding cuts


@dataclass(frozen=True, eq=False)
class EdgeDrive(Drive):
    # T with edge elements in place of Hs outside iron. Their curl has the current of Hs through every facet, is
    # constant in every element, and is 0 where no current flows, where T is constant, too. In contrast to `Drive`, T is
    # continuous along the surfaces of iron.

    edges: EdgeElements
    circulation: Floats  # (nedges,) in A

    def _given(self, x: Floats, point: Ints, element: Ints) -> Floats:
        return self.edges.at(self.circulation, x[:, point], element)

    @property
    def mean(self) -> Floats:
        # (3, nelements)
        return self.at(centroids_of(self.edges.mesh), np.arange(self.iron.size))

    def work_of_difference(self, density: Floats) -> float:
        """Return ``int (Hs - T) . B`` in J for a B without divergence, (3, nelements)."""
        if self.function is None:
            return 0.0
        every, rule = np.arange(density.shape[1]), tabled_rule(3, DEGREE)
        x, element, volumes = self.elements.shape.quadrature(every, rule)
        difference = field_at(self.function, x) - self.edges.at(self.circulation, x, element)
        return float(np.sum(volumes * difference * density[:, element]))


def edge_drive(edges: EdgeElements, iron: Mask, function: AppliedField | None) -> EdgeDrive:
    mesh, elements, zeros = edges.mesh, edges.elements, np.zeros(edges.mesh.nvertices)
    if function is None:
        none = np.zeros(edges.count)
        return EdgeDrive(elements, None, np.zeros_like(iron), zeros, zeros, np.zeros((3, iron.size)), edges, none)
    circulation, _ = circulations(mesh.p, edges.nodes, function)
    of_iron = edges.unknowns[:, iron]
    chi, layer = total_potential(mesh, iron, circulation[np.unique(of_iron)])
    start, end = edges.nodes[:, of_iron]
    direction = mesh.p[:, end] - mesh.p[:, start]
    circulation[of_iron] = chi[start] - chi[end] + np.sum(direction * layer[:, None, iron], axis=0)
    return EdgeDrive(elements, function, iron, chi, zeros, layer, edges, circulation)
