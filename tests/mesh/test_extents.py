"""Meshes, indicators and sizes so large or small that areas, volumes and sums of squares are no numbers."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.stand_ins import MESH, Script
from numpy.testing import assert_allclose
from skfem import MeshTet, MeshTri, MeshTri2

import kohonen_adapt as ka

TRIANGLES, SOLID = MeshTri().refined(2), MeshTet().refined(1)


class Unsolved:
    """A problem that must not be solved."""

    def solve(self, mesh):
        raise AssertionError

    def indicators(self, mesh, solution):
        raise AssertionError

    def ritz(self, mesh, solution):
        raise AssertionError


class Huge(Script):
    def indicators(self, mesh, solution):
        return np.full(mesh.nelements, 1e308)


ENTRIES = {
    "relocate": lambda mesh: ka.relocate(mesh, np.ones(mesh.nelements)),
    "adapt": lambda mesh: ka.adapt(mesh, Unsolved()),
    "polish": lambda mesh: ka.polish(mesh, Unsolved()),
    "KohonenMap": ka.KohonenMap,
    "density_from_indicators": lambda mesh: ka.density_from_indicators(mesh, np.ones(mesh.nelements)),
    "density_from_sizes": lambda mesh: ka.density_from_sizes(mesh, np.ones(mesh.nelements)),
    "residual": lambda mesh: ka.estimators.residual(mesh, mesh.p[0], np.ones(mesh.nelements)),
    "recovery": lambda mesh: ka.estimators.recovery(mesh, mesh.p[0], np.ones(mesh.nelements)),
}


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize(
    ("mesh", "scale"),
    [(TRIANGLES, 1e-160), (TRIANGLES, 1e150), (SOLID, 1e-70), (SOLID, 1e60), (TRIANGLES, 1e-21), (SOLID, 1e21)],
)
def test_a_mesh_whose_areas_or_volumes_are_lost_is_refused(mesh, scale, entry):
    said = rf"^mesh must be from 1e-20 to 1e\+20 wide, in its own units; it is {scale:.3g} wide\. Choose another unit: "
    with pytest.raises(ValueError, match=said.replace("e+1", r"e\+1").replace("e+2", r"e\+2").replace("e+6", r"e\+6")):
        ENTRIES[entry](mesh.scaled(scale))


@pytest.mark.parametrize("scale", [1e-310, 1e308])
def test_indicators_at_the_ends_of_the_range_of_numbers(scale):
    indicators = np.linspace(0.1, 1.0, TRIANGLES.nelements)
    expected = ka.density_from_indicators(TRIANGLES, indicators)
    assert_allclose(ka.density_from_indicators(TRIANGLES, indicators * scale), expected, rtol=1e-12)


def test_sizes_whose_density_is_no_number():
    sizes = np.full(TRIANGLES.nelements, 1.0)
    for wrong, density in ((1e-160, "inf"), (1e160, "0.0")):
        sizes[5] = wrong
        said = rf"^sizes must be edge lengths in mesh units; element 5 has {wrong}, whose density is {density}\."
        with pytest.raises(ValueError, match=said.replace("+", r"\+")):
            ka.density_from_sizes(TRIANGLES, sizes)


def test_indicators_whose_squares_have_no_sum():
    with pytest.raises(ValueError, match=r"^indicators of the problem must be small enough for the sum of their squ"):
        ka.adapt(MESH, Huge([1.0]), passes=0)


@pytest.mark.parametrize("estimator", [ka.estimators.residual, ka.estimators.recovery])
@pytest.mark.parametrize("mesh", [TRIANGLES, SOLID], ids=["tri", "tet"])
@pytest.mark.parametrize("scale", [1e-160, 1e160])
def test_a_potential_whose_energy_is_no_number(scale, mesh, estimator):
    potential, reluctivity = mesh.p[0] ** 2, np.ones(mesh.nelements)
    with pytest.raises(
        ValueError, match=r"^nu grad u - flux must be 0, or from 1e-100 to 1e\+100 at most; its largest"
    ):
        estimator(mesh, scale * potential, reluctivity)
    assert estimator(mesh, 1e-90 * potential, reluctivity).any()
    assert not estimator(mesh, 0.0 * potential, reluctivity).any()


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e150, 1e300])
@pytest.mark.parametrize("mesh", [TRIANGLES, MeshTri2.from_mesh(TRIANGLES), SOLID], ids=["tri", "tri2", "tet"])
def test_quality_does_not_depend_on_the_unit(mesh, scale):
    given = replace(mesh, doflocs=mesh.doflocs * scale)
    assert_allclose(ka.quality(given), ka.quality(mesh), rtol=1e-12)
