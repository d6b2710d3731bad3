"""Error indicators of a magnetic field: the scalar problem that stands for it, and the estimators of that."""

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators import duality_gap, equilibrated, equilibrated_flux, recovery, residual
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, fixed_values
from kohonen_adapt.magnetostatics.equations.joints import joints_of
from kohonen_adapt.magnetostatics.equations.system import Scalar, scalar_of
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quadratic_residual import quadratic_residual
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.quadratic_field import QuadraticField
from kohonen_adapt.mesh.measures import gradient

__all__ = ["ESTIMATORS", "RESIDUAL_SCALE", "estimated"]


# What the residual indicators are multiplied by, so that the root of their sum of squares is near the error.
# The ratio of that root to the true error, unscaled, measured by test_magnetostatics.py and benchmark M:
#     cylinder in a disk, rings, 817 to 12 481 nodes                  3.61 - 3.78
#     rectangle in free space, squares / Gmsh, 400 to 9 500 nodes     3.57 - 3.77 / 3.24 - 3.64
#     benchmark M, permeability 1 / 1000, squares, 441 to 25 921      3.58 - 3.78 / 3.56 - 3.59
#     the same after one to three relocations                         3.51 - 3.66
# With 1 / 3.6 all of them come within 10 %.
RESIDUAL_SCALE = 1.0 / 3.6
# The same for elements of order 2: smooth fields on squares and random meshes 5.9 - 6.4, a rectangle magnet 6.0 - 6.1,
# corners of iron 6.0 - 6.2 (test_quadratic.py). With 1 / 6.1 all of them come within 5 %.
QUADRATIC_SCALE = 1.0 / 6.1
ESTIMATORS = ("residual", "recovery", "equilibrated")


def estimated(
    mesh: MeshTri,
    given: Coefficients,
    field: Field,
    estimator: str,
    boundaries: Boundaries,
    kinds: NDArray[np.int64] | None,
) -> Floats:
    """Indicators by the estimator of that name, (nelements,), unsquared.

    `kinds` (nmaterials,) numbers the materials that are alike, where reluctivity or flux change inside one; None where
    these themselves tell regions apart.
    """
    joined = None
    if boundaries.periodic or boundaries.antiperiodic:
        joined = joints_of(mesh, boundaries.periodic, boundaries.antiperiodic).facets
    if isinstance(field, QuadraticField):
        return QUADRATIC_SCALE * quadratic_residual(field.problem, field.values, joined)
    if estimator == "equilibrated":
        return bound(mesh, given, field, boundaries)
    scalar, unknown = scalar_of(mesh, field.symmetry, given), field.unknown
    if given.pieces:
        scalar = linearised(mesh, field, scalar, estimator)
    if estimator == "residual":
        bare = residual(mesh, unknown, scalar.reluctivity, source=scalar.source, flux=scalar.flux, joined=joined)
        return RESIDUAL_SCALE * bare
    region = None if kinds is None else kinds[given.number]
    return recovery(mesh, unknown, scalar.reluctivity, source=scalar.source, flux=scalar.flux, region=region)


def bound(mesh: MeshTri, given: Coefficients, field: Field, boundaries: Boundaries) -> Floats:
    """Guaranteed indicators of a planar field: the duality gap, which for linear material are the equilibrated ones."""
    fixed, _ = fixed_values(mesh, boundaries.potential)
    source, flux = given.current_density, given.flux
    if not given.pieces:
        return equilibrated(mesh, field.potential, given.reluctivity, source=source, flux=flux, fixed=fixed)
    balanced = equilibrated_flux(mesh, field.potential, field.reluctivity, source=source, flux=flux, fixed=fixed)
    return duality_gap(mesh, field.potential, balanced, given.stored, given.costored, flux=flux)


def linearised(mesh: MeshTri, field: Field, scalar: Scalar, estimator: str) -> Scalar:
    """The scalar problem that a nonlinear solution solves, with a reluctivity that weights its error.

    Its flux makes ``nu grad u - flux`` the field strength of the solution, whatever the weight nu. A scalar has to
    stand for the tensor of nonlinear material, differential along B and secant across it. Where B changes along itself,
    H is off its average along B, which the differential reluctivity weights. Jumps are of any direction: the root of
    the determinant weights them. On the tube of test_nonlinear.py, iron at 1.9 to 2.0 T with a ratio of 16 of the
    two, this gives 0.85 - 0.88 of the error by recovery and 0.96 - 1.25 by the residual, which with the differential
    reluctivity has 0.55 - 0.69.
    """
    weight = field.differential_reluctivity
    if estimator == "residual":
        weight = np.sqrt(field.reluctivity * weight)
    reluctivity = field.symmetry.reluctivity(mesh, weight)
    flux = reluctivity * gradient(mesh, field.unknown) - field.symmetry.flux(field.field_strength)
    return Scalar(reluctivity, flux, scalar.source)
