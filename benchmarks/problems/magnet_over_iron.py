"""A magnet 2 mm above a block of iron, half past its edge, and moved along it: meshes of Gmsh."""

from skfem import MeshTri

from benchmarks.problems.drawing import meshed
from benchmarks.problems.geometry import Gmsh
from kohonen_adapt.magnetostatics import Magnetostatics, Material

STEP = 0.05e-3  # m
FAR = 6e-3  # edge length at the box
PROBLEM = Magnetostatics(
    {"magnet": Material(1.05, remanence=(0.0, 1.2)), "iron": Material(1000.0), "air": Material()},
    potential={"outer": 0.0},
    order=1,
)


def gmsh_mesh(step: int, size: float) -> MeshTri:
    """The mesh with the magnet moved by so many steps, and edges of that length at magnet and iron."""

    def draw(gmsh: Gmsh) -> dict[str, list[int]]:
        box = gmsh.model.occ.addRectangle
        return {
            "air": [box(-0.04, -0.03, 0.0, 0.08, 0.06)],
            "iron": [box(0.0, -0.012, 0.0, 0.02, 0.01)],
            "magnet": [box(step * STEP - 0.007, 0.0, 0.0, 0.01, 0.005)],
        }

    return meshed(draw, {"air": FAR, "iron": size, "magnet": size}, lambda *box: "outer")
