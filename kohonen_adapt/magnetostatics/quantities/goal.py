"""Interface of goals, single numbers of a field with their derivatives."""

from abc import abstractmethod
from typing import Any, ClassVar, Protocol, runtime_checkable

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.quantities.forces import checked_point
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["POINT", "SIZES", "Goal", "VectorGoal", "unit_vector"]

VECTOR, POINT = "vector (x, y), in space (x, y, z)", "point (x, y), in space (x, y, z), in m"
SIZES = (2, 3)


@runtime_checkable
class Goal(Protocol):
    """Number J of a field with its derivative, for the argument `goal` of a problem.

    `Magnetostatics` and, in space, `MagneticScalarPotential` take goals. A change w of ``field.unknown`` (planar of A,
    axisymmetric of r A, in space of the scalar potential) changes J by ``int source w + flux . grad w`` over the plane
    of the mesh, or its volume.

    Tables, files and reports show values with the string ``unit`` of a goal, if the goal has one.
    """

    def __call__(self, field: Any) -> float:
        """Return J of a field.

        `Magnetostatics.goal_error` also evaluates J of fields of up to three orders more.
        """

    def derivative(self, field: Any) -> tuple[Floats, Floats]:
        """Return `source` (nelements,) and `flux` (d, nelements) at a field.

        Both are constant in every element. If B varies within elements (order 2 and 3, around an axis, and in space
        with an applied field or magnets that vary), the flux may be at the quadrature points of
        ``field.at_quadrature``, (d, npoints).
        """


class VectorGoal(Goal):
    vector: ClassVar[str]  # name of an attribute with as many components as the field has dimensions

    @property
    def dimension(self) -> int:
        return len(getattr(self, self.vector))

    def check_dimension(self, dim: int) -> None:
        if self.dimension != dim:
            kind = "(x, y, z) in space" if dim == 3 else "(x, y) in the plane"
            raise ValueError(f"a {type(self).__name__} must have vectors {kind} as a goal; got {self}.")

    def check_on(self, field: Any) -> None:
        self._place(field)

    @abstractmethod
    def _place(self, field: Any) -> Any:
        """Return the data of the value at a field, or raise a ValueError."""


def unit_vector(name: str, value: tuple[float, ...]) -> tuple[float, ...]:
    along = checked_point(name, value, VECTOR, SIZES)
    if not along.any():
        raise ValueError(f"{name} must not be zero; got {value!r}.")
    return tuple((along / magnitude(along)).tolist())
