"""Known numbers of planar magnetostatics: the inductance of a coaxial cable, and the exponents of iron corners."""

import numpy as np
import pytest
from helpers.exact_fields import Corner

from kohonen_adapt.magnetostatics import Magnetostatics

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
