"""Error estimators, in the energy norm and for a functional of the solution."""

from kohonen_adapt.estimators.dual_weighting import goal_error, goal_oriented
from kohonen_adapt.estimators.equilibration import duality_gap, equilibrated, equilibrated_flux
from kohonen_adapt.estimators.recovery_estimator import recovery
from kohonen_adapt.estimators.residual_estimator import residual

__all__ = ["duality_gap", "equilibrated", "equilibrated_flux", "goal_error", "goal_oriented", "recovery", "residual"]
