"""Relocation of tetrahedra: nodes where a density wants them, and everything that must stay as it was."""

import numpy as np
import pytest
from helpers.solids import box, volumes

import kohonen_adapt as ka


def shell(x):
    """A sphere about the middle of the cube, with twenty times the density of the rest."""
    return 1.0 + 20.0 / np.cosh(20.0 * (((x - 0.5) ** 2).sum(axis=0) - 0.16)) ** 2


def spread(mesh, density):
    """Coefficient of variation of the mass of elements, from the density at their nodes."""
    mass = np.abs(volumes(mesh)) * density(mesh.p)[mesh.t].mean(axis=0)
    return mass.std() / mass.mean()


@pytest.mark.parametrize(("topology", "most"), [("recycle", 0.35), ("flip", 0.65), ("fixed", 0.65)])
def test_mass_is_shared_out(topology, most):
    """From 0.90; what only moves cannot carry nodes far."""
    mesh = box(12)
    found = ka.relocate(mesh, shell, topology=topology)
    assert found.nvertices == mesh.nvertices and found.is_valid()
    assert spread(found, shell) < most < spread(mesh, shell)
    assert ka.quality(found).min() >= 0.2 and ka.quality(found).mean() > 0.8
    assert np.abs(volumes(found)).sum() == pytest.approx(1.0, rel=1e-12)


def test_rounds_of_transport_are_refused():
    with pytest.raises(ValueError, match="rounds of transport are for triangles only"):
        ka.relocate(box(2), shell, schedule=ka.Schedule((), rounds=1))
