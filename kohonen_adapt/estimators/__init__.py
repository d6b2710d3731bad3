"""Estimate the error of any P1 solution in the energy norm, and of a functional of one of order 1 to 3, by element."""

from kohonen_adapt.estimators.dual_weighting import goal_error, goal_oriented
from kohonen_adapt.estimators.equilibration import duality_gap, equilibrated, equilibrated_flux
from kohonen_adapt.estimators.explicit import recovery, residual

__all__ = ["duality_gap", "equilibrated", "equilibrated_flux", "goal_error", "goal_oriented", "recovery", "residual"]
