"""A posteriori error estimators: indicators per element in the energy norm, for any P1 solution."""

from kohonen_adapt.estimators.averaging import recovery
from kohonen_adapt.estimators.jumps import residual

__all__ = ["recovery", "residual"]
