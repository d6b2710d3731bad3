"""Movement and polish of the nodes of triangles and of tetrahedra, a module each.

Both modules have the same names:

PASSES_BY_DENSITY
    Number of passes with recycling by density; later passes recycle by energy alone. A density without directions moves
    a fifth of all nodes in every pass to positions from which the energy removes them again, if long elements have the
    lowest energy. With directions, too, further passes by density gain nothing.
ALWAYS_DIRECTED
    True if elements get directions with ``anisotropic="auto"`` beside a tolerance or a goal, too.
BEFORE_POLISH
    Schedule of the map in passes that recycle and polish, None for the default.
TRANSFER_KERNELS, moving_kernels, polish_kernels
    Groups of `kernels/entries.py` for the transfer of a solution, and functions of topology and schedule, or of the
    problem, that return such groups.
opened
    Function of the mesh, the rules and the sides, as in the input if None, that returns the movable mesh.
move
    Function that relocates to a density or to tensors, as `som.relocate.move`.
longest_sides
    Function that returns the largest length of sides on curves at each node, or None.
functional
    Function that returns the functional that the polish lowers, for a solution on a mesh.
value
    Function that returns the value of the functional, with the part between chords and curves or surfaces.
carry
    Function that transfers a solution to the moved mesh.
reasons, polish_reasons
    Functions that return why each node is held, always or by the polish alone, else an empty string.
held_in_polish
    Function that returns the mask (n,) of nodes held by the polish alone.
descent
    Function that returns the descent for the polish, which changes the movable mesh.
stalls
    Function of the passes that returns True if these do not improve the result.
"""

from types import ModuleType

from skfem import Mesh

from kohonen_adapt.loop.dimension import plane, space
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of

__all__ = ["method_of"]


def method_of(mesh: Mesh) -> ModuleType:
    """Return the module for the elements of a mesh."""
    return space if cell_of(mesh) is TETRAHEDRON else plane
