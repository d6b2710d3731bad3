"""Model FEMM's torque benchmark: a bar magnet that is turned in a uniform field."""

import numpy as np
from skfem import MeshTri

from benchmarks.problems.drawing import meshed
from benchmarks.problems.geometry import Gmsh
from kohonen_adapt.magnetostatics import Magnetostatics, Material, Torque

LENGTH, WIDTH, DEPTH = 0.01, 0.005, 0.02  # metres
COERCIVITY, APPLIED = 1e6, 1.0  # A/m along the length, T along x
RIM = 0.02  # radius
TORQUE = "torque at ten angles (N m)"


class MagnetTorque:
    """Meeker, "(Anti)Periodic Air Gap Boundary Condition Torque Benchmark", femm.info, 2018: ``1 N m sin(angle)``.

    The moment of the magnet, of permeability 1, is Hc V = 1 A m^2, and the field 1 T. FEMM has it in a disk that is
    linked to another one for the air beyond (Kelvin). Here the disk ends where A is that of the field alone: what the
    magnet adds to it there is the same for all angles of the magnet, so there is no torque from it, and the law is
    exact in a disk of any size.
    """

    title = "FEMM, torque benchmark"
    settings = tuple(np.radians(np.arange(9.0, 91.0, 9.0)).tolist())
    goal = Torque("magnet")

    def start(self, setting: float) -> MeshTri:
        """Of Gmsh, each angle drawn afresh."""

        def draw(gmsh: Gmsh) -> dict[str, list[int]]:
            magnet = gmsh.model.occ.addRectangle(-LENGTH / 2, -WIDTH / 2, 0, LENGTH, WIDTH)
            gmsh.model.occ.rotate([(2, magnet)], 0, 0, 0, 0, 0, 1, setting)
            return {"air": [gmsh.model.occ.addDisk(0, 0, 0, RIM, RIM)], "magnet": [magnet]}

        return meshed(draw, {"air": 2e-3, "magnet": 8e-4}, lambda *box: "rim")

    def problem(self, setting: float) -> Magnetostatics:
        """The magnet's direction is that angle away from the field's."""
        direction = COERCIVITY * np.cos(setting), COERCIVITY * np.sin(setting)
        return Magnetostatics(
            {"air": Material(), "magnet": Material(coercivity=direction)},
            potential={"rim": lambda x: APPLIED * x[1]},
            depth=DEPTH,
            order=1,
        )

    def published(self, setting: float) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        return {TORQUE: np.array([-np.sin(setting)])}  # back towards the field

    def measured(self, mesh: MeshTri, setting: float) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        return {TORQUE: np.array([self.problem(setting).solve(mesh).torque("magnet")])}
