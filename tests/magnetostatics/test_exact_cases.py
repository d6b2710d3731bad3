"""Known numbers of planar magnetostatics: the inductance of a coaxial cable, and the exponents of iron corners."""

import numpy as np
import pytest
from helpers.exact_fields import Corner
from helpers.tensor_meshes import disk, equal_rings

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

MU0 = 4e-7 * np.pi


def coax_mesh(rings):
    """A core of 0.25 mm in a sheath from 0.76 to 0.99 mm, of `rings` circles; a multiple of 4."""
    radii = np.interp(equal_rings(rings, 1.0), [0.0, 0.25, 0.75, 1.0], [0.0, 0.25e-3, 0.76e-3, 0.99e-3])
    return disk(radii, {"core": rings // 4, "gap": 3 * rings // 4, "sheath": rings})


COAX = Magnetostatics(
    dict.fromkeys(("core", "gap", "sheath"), Material()),
    potential={"outer": 0.0},
    ampere_turns={"core": 1.0, "sheath": -1.0},
    order=1,
)
COAX_INDUCTANCE = 2.923978157561e-7 / 1.25663706212e-6 * MU0


EXPONENTS = {10.0: 0.731692, 100.0: 0.673921, 1000.0: 0.667401}


@pytest.mark.parametrize("permeability", EXPONENTS)
def test_uniform_meshes_converge_as_the_corner_of_the_iron_lets_them(permeability):
    corner, counts, errors = Corner(permeability), (8, 16, 32), []
    assert corner.exponent == pytest.approx(EXPONENTS[permeability], abs=5e-7)
    problem = Magnetostatics(corner.materials, potential={"rim": corner.potential})
    for n in counts:
        mesh = corner.mesh(n)
        errors.append(corner.error(mesh, problem.solve(mesh)))
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(corner.exponent, abs=0.03)


def test_adapting_the_cable_beats_a_uniform_mesh_of_as_many_nodes():
    """scikit-fem's example 35 finds 2.9059561564e-7 H/m with 688 nodes; both are below the exact one."""
    result = ka.adapt(coax_mesh(12), COAX, target_nodes=688)
    assert result.mesh.p.shape[1] == 688
    assert 2.9059561564e-7 / 2.923978157561e-7 < 2.0 * result.solution.energy / COAX_INDUCTANCE < 1.0
