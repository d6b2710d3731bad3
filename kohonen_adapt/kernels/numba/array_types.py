"""Types of arrays in records and in arguments of loops.

The letter is the type of the entries (real, long, integer, short and bool), the digit the number of axes.
"""

from typing import Annotated

from numba.types import boolean, float64, int8, int32, int64

from kohonen_adapt.arrays import Array

__all__ = ["B1", "B2", "I1", "I2", "I3", "L1", "R1", "R2", "R3", "R4", "S1"]

R1 = Annotated[Array, float64, 1]
R2 = Annotated[Array, float64, 2]
R3 = Annotated[Array, float64, 3]
R4 = Annotated[Array, float64, 4]
L1 = Annotated[Array, int64, 1]
I1 = Annotated[Array, int32, 1]
I2 = Annotated[Array, int32, 2]
I3 = Annotated[Array, int32, 3]
S1 = Annotated[Array, int8, 1]
B1 = Annotated[Array, boolean, 1]
B2 = Annotated[Array, boolean, 2]
