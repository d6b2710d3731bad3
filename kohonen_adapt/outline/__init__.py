"""Former paths of the public names of `geometry`."""

import sys
import warnings

from kohonen_adapt.geometry import rules
from kohonen_adapt.geometry.plane import curves, spline
from kohonen_adapt.geometry.space import surfaces

warnings.warn("kohonen_adapt.outline is kohonen_adapt.geometry now.", DeprecationWarning, stacklevel=2)
sys.modules.update(
    {f"{__name__}.{part.__name__.rpartition('.')[2]}": part for part in (rules, curves, spline, surfaces)}
)
