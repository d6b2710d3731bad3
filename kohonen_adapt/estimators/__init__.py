"""A posteriori error estimators: indicators per element in the energy norm, for any P1 solution."""

from kohonen_adapt.estimators.averaging import recovery
from kohonen_adapt.estimators.dual_weighting import goal_error, goal_oriented
from kohonen_adapt.estimators.duality import duality_gap
from kohonen_adapt.estimators.equilibration import equilibrated, equilibrated_flux
from kohonen_adapt.estimators.jumps import residual

__all__ = ["duality_gap", "equilibrated", "equilibrated_flux", "goal_error", "goal_oriented", "recovery", "residual"]
