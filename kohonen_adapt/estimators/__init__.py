"""A posteriori error estimators: indicators per element in the energy norm, for any P1 solution."""

from kohonen_adapt.estimators.recovery import recovery
from kohonen_adapt.estimators.residual import residual

__all__ = ["recovery", "residual"]
