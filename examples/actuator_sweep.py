"""Force over gap of the plunger actuator: 30 gaps, each with a mesh of its own, in processes that share the cores.

A mesh is drawn for every millimetre; for a gap in between the plunger of the nearest is shifted, and the nodes in the
air follow by Laplace's equation. What is computed is kept: begun again after a break, the script computes the rest.
"""

import argparse
from pathlib import Path

import numpy as np
from actuator import GAPS, PROBLEM, pull
from skfem import Basis, ElementTriP1, MeshTri, condense, solve
from skfem.models.poisson import laplace

import kohonen_adapt as ka

CASES = {"gap_mm": np.linspace(GAPS[0], GAPS[-1], 30).round(3)}


def with_gap(gap_mm):
    """A mesh with that gap."""
    drawn = GAPS[np.abs(GAPS - gap_mm).argmin()]
    mesh = ka.read_mesh(Path(__file__).with_name(f"actuator_{drawn}.msh"), scale=1e-3)  # drawn in millimetres
    nodes = {name: np.unique(mesh.t[:, mesh.subdomains[name]]) for name in ("plunger", "core", "coil")}
    outer = np.unique(mesh.facets[:, mesh.boundaries["outer"]])
    up = np.zeros(mesh.p.shape[1])
    up[nodes["plunger"]] = (gap_mm - drawn) * 1e-3
    given = np.unique(np.concatenate([outer, *nodes.values()]))
    up = solve(*condense(laplace.assemble(Basis(mesh, ElementTriP1())), x=up, D=given))
    moved = MeshTri(mesh.p + [np.zeros_like(up), up], mesh.t)
    return moved.with_subdomains(mesh.subdomains).with_boundaries(mesh.boundaries)


def adapted(gap_mm):
    """The outputs of one case; other processes find the function, for it stands at the top level."""
    result = ka.adapt(with_gap(gap_mm), PROBLEM, passes=1)
    return {"force (N)": pull(result.solution), "co-energy (J)": result.solution.coenergy}


def main(folder=".", every=1):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    cases = {name: values[::every] for name, values in CASES.items()}
    result = ka.sweep(adapted, cases, folder=folder / "actuator_cases")
    print(result)
    result.to_csv(folder / "actuator_sweep.csv")
    from kohonen_adapt.plotting import sweep_figure  # needs matplotlib, the rest does not

    sweep_figure(result).savefig(folder / "actuator_sweep.png", dpi=80)
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    parser.add_argument("--every", type=int, default=1, help="2 leaves out every other of the 30 gaps")
    arguments = parser.parse_args()
    main(arguments.out, arguments.every)
