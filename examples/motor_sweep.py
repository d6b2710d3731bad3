"""Torque over angle of the motor: 30 angles of the rotor, each adapted by itself, in processes that share the cores.

The currents turn with the rotor, so torques repeat after a slot pitch of 15 degrees: the last six angles are the first
six again, on other meshes. What is computed is kept: begun again after a break, the script computes the rest.
"""

import argparse
from pathlib import Path

from motor import MESH, machine, materials, sector, torque, turned

import kohonen_adapt as ka

STEP = 0.625  # degrees between nodes of the ring in the gap, on which the rotor turns
CASES = {"angle_degrees": [STEP * k for k in range(30)]}


def adapted(angle_degrees):
    """The outputs of one case; other processes find the function, for it stands at the top level."""
    step = round(angle_degrees / STEP)
    mesh = turned(machine(ka.read_mesh(MESH, scale=1e-3)), step)  # drawn in millimetres
    result = ka.adapt(mesh, sector(materials(step)), passes=1, pinned=["ring"])  # further passes give the same curve
    idle = sector(materials(step, peak=0.0)).solve(result.mesh)
    return {"torque (N m/m)": torque(result.solution), "torque without currents (N m/m)": torque(idle)}


def main(folder=".", every=1):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    cases = {name: values[::every] for name, values in CASES.items()}
    result = ka.sweep(adapted, cases, folder=folder / "motor_cases")
    print(result)
    result.to_csv(folder / "motor_sweep.csv")
    from kohonen_adapt.plotting import sweep_figure  # needs matplotlib, the rest does not

    sweep_figure(result).savefig(folder / "motor_sweep.png", dpi=80)
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    parser.add_argument("--every", type=int, default=1, help="2 leaves out every other of the 30 angles")
    arguments = parser.parse_args()
    main(arguments.out, arguments.every)
