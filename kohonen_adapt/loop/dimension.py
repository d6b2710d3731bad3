"""Choice of the method for a mesh."""

from skfem import Mesh

from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.plane import PlaneMethod
from kohonen_adapt.loop.space import SpaceMethod
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of

__all__ = ["method_of"]


def method_of(mesh: Mesh) -> Method:
    return SpaceMethod() if cell_of(mesh) is TETRAHEDRON else PlaneMethod()
