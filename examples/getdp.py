"""Adapt the mesh of a GetDP model through files: GetDP solves, `kohonen-adapt relocate` moves nodes, and again."""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

import kohonen_adapt as ka

MESH, MODEL = (Path(__file__).with_name(name) for name in ("getdp.msh", "getdp.pro"))
ROUNDS = 4
COLOURS = {"region_100": "0.55", "region_101": "white", "region_102": "tab:orange", "region_103": "tab:orange"}


def solve(mesh, folder, *post):
    """Let GetDP solve on a mesh file: the energy in J/m. Further PostOperations leave their files in the folder."""
    run = ["getdp", MODEL, "-msh", mesh, "-name", folder / "getdp", "-v", "1"]
    subprocess.run([*run, "-solve", "Field", "-pos", "Energy", *post], check=True)
    return float((folder / "energy.txt").read_text().split()[1])


def relocate(mesh, indicators, target):
    """What a shell does with `kohonen-adapt relocate MESH --indicators eta.pos:eta --out MESH2 --topology recycle`."""
    command = [sys.executable, "-m", "kohonen_adapt", "relocate", mesh, "--indicators", f"{indicators}:eta"]
    subprocess.run([*command, "--out", target, "--topology", "recycle", "--quiet"], check=True)


def refined(mesh, folder, times=3):
    """The same mesh with every triangle cut in four, several times; GetDP finds its groups by their numbers."""
    fine = folder / "fine.msh2"
    ka.write_mesh(fine, ka.read_mesh(mesh).refined(times), groups=ka.read_groups(mesh))
    return fine


def draw(meshes, errors, folder):
    """Both meshes, with the iron grey and the coil orange."""
    from matplotlib.colors import ListedColormap  # needs matplotlib, the rest does not
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.4), dpi=80, layout="constrained")
    axes = figure.subplots(1, len(meshes), sharey=True)
    for axis, mesh, error in zip(axes, map(ka.read_mesh, meshes), errors, strict=True):
        region = np.zeros(mesh.t.shape[1])
        for number, name in enumerate(COLOURS):
            region[mesh.subdomains[name]] = number
        palette = ListedColormap(list(COLOURS.values()))
        axis.tripcolor(*(1e3 * mesh.p), mesh.t.T, facecolors=region, cmap=palette, edgecolors="k", linewidth=0.25)
        axis.set(aspect="equal", xlabel="x (mm)", title=f"{mesh.p.shape[1]} nodes, energy error {100 * error:.1f} %")
    axes[0].set_ylabel("y (mm)")
    figure.savefig(folder / "getdp.png")


def main(folder="."):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    meshes, energies = [MESH], [solve(MESH, folder, "Indicator")]
    for number in range(1, ROUNDS + 1):
        target = folder / f"getdp_{number}.msh2"  # MSH 2.2: GetDP reads 4.1 only if it was built with Gmsh
        relocate(meshes[-1], folder / "eta.pos", target)
        meshes.append(target)
        energies.append(solve(target, folder, "Indicator"))
    # Of a potential that vanishes on the rim, the squared error in the energy norm is twice what the energy lacks.
    reference = solve(refined(meshes[-1], folder), folder)
    errors = np.sqrt(1.0 - np.array(energies) / reference)
    print(f"energy {reference:.5g} J/m on the last mesh refined three times")
    for number, (mesh, energy, error) in enumerate(zip(meshes, energies, errors, strict=True)):
        nodes = ka.read_mesh(mesh).p.shape[1]
        print(f"round {number}: {nodes} nodes, energy {energy:.5g} J/m, energy error {100 * error:.2f} %")
    draw([meshes[0], meshes[-1]], [errors[0], errors[-1]], folder)
    return meshes, errors


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
