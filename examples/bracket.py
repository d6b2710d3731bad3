"""Heat through a part drawn in Gmsh: tetrahedra move in it, with names, and nodes stay on its cylinders."""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, BilinearForm, ElementTetP0, ElementTetP1, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka

HERE = Path(__file__).parent
CONDUCTIVITY = {"pin": 390.0, "plate": 16.0}  # W/(m K): copper in stainless steel
HOT, COLD = "top of the pin", "bore"  # 1 K between them
PLANE = ka.Plane(point=(0.0, 0.01, 0.0), normal=(0.0, 1.0, 0.0))


@BilinearForm
def conduction(u, v, w):
    return w.conductivity * dot(grad(u), grad(v))


def conductivity_of(mesh):
    """Of every element, in W/(m K)."""
    values = np.zeros(mesh.t.shape[1])
    for name, value in CONDUCTIVITY.items():
        values[mesh.subdomains[name]] = value
    return values


def solved(mesh):
    """The temperature of the nodes, and the heat that flows through the part, in W for 1 K."""
    basis = Basis(mesh, ElementTetP1())
    values = basis.with_element(ElementTetP0()).interpolate(conductivity_of(mesh))
    stiffness = conduction.assemble(basis, conductivity=values)
    hot, cold = (basis.get_dofs(name).flatten() for name in (HOT, COLD))
    temperature = np.zeros(mesh.nvertices)
    temperature[hot] = 1.0
    temperature = solve(*condense(stiffness, x=temperature, D=np.append(hot, cold)))
    return temperature, temperature @ stiffness @ temperature


def draw(meshes, temperatures, path):
    """From outside and in a cut, before and after."""
    from matplotlib.figure import Figure  # needed for the picture only

    from kohonen_adapt.plotting import plot_slice, plot_surface

    figure = Figure(figsize=(12.0, 7.0), dpi=160, layout="constrained")
    for mesh, temperature, column in zip(meshes, temperatures, figure.subplots(2, 2).T, strict=True):
        plot_surface(mesh, "subdomains", view=(-60.0, 35.0), ax=column[0], unit="mm")
        plot_slice(mesh, PLANE, temperature, label="temperature (K)", ax=column[1], unit="mm")
    figure.savefig(path)


def main(folder=".", passes=5):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh = before = ka.read_mesh(HERE / "bracket.msh", scale=1e-3)
    groups = ka.read_groups(HERE / "bracket.msh", scale=1e-3)
    temperature, heat = solved(mesh)
    temperatures, heats = [temperature], [heat]
    for number in range(passes):
        indicators = ka.estimators.residual(mesh, temperature, conductivity_of(mesh))
        mesh = ka.relocate(mesh, ka.density_from_indicators(mesh, indicators), topology="recycle", seed=number)
        temperature, heat = solved(mesh)
        temperatures.append(temperature)
        heats.append(heat)
        print(f"pass {number + 1}: {mesh.nvertices} nodes, {heat:.5f} W for 1 K")
    ka.write_mesh(folder / "bracket.msh", mesh, groups=groups)
    ka.write_mesh(folder / "bracket.vtu", mesh, point_data={"temperature (K)": temperature})
    draw([before, mesh], [temperatures[0], temperature], folder / "bracket.png")
    return mesh, heats


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
