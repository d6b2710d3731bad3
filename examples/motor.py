"""One pole of a permanent-magnet machine, its sides antiperiodic: torque over rotor angle on adapted meshes, figures.

The rotor turns on the ring of nodes in the middle of the gap, by whole steps of it, so the mesh of one angle turns into
one of the next as it is, and adapting goes on from there. The currents turn with the rotor, so that all repeats after
a slot pitch. Over it the energy stored does not change, so the mean torque must be the mean of I dlambda/dtheta over
rotor angles theta, added up over the slots (lambda: flux linkage). The one is told by the field in the gap, the other
by the potential in the slots.
"""

import argparse
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

MESH = Path(__file__).with_name("motor.msh")
POLE = np.pi / 4  # angle of the sector, counter-clockwise from "right" to "left"
RING, STEPS = 0.0445, 72  # radius of the ring, and its facets
ANGLES = range(0, STEPS // 3 + 1, 2)  # of the rotor, in steps of the ring, up to one slot pitch
CURRENT = 4e6  # A/m^2, peak
SLOTS = {"coil_c_minus": -POLE / 3, "coil_a_plus": 0.0, "coil_b_minus": POLE / 3}  # angles from the pole's axis

IRON, AIR = Material(permeability=1000.0), Material()
TURNS = ["rotor", "magnet", "rotor_air", "gap_inside"]
PARTS = {"stator": IRON, "rotor": IRON} | dict.fromkeys(["slot_air", "gap", "rotor_air"], AIR)


def materials(step=0, peak=CURRENT):
    """Of the machine with its rotor at a step: the magnet turns with it, the currents are strongest over it."""
    angle = POLE * step / STEPS
    magnet = Material(permeability=1.05, remanence=(-1.2 * np.sin(angle), 1.2 * np.cos(angle)))
    density = {name: -peak * np.cos(np.pi / POLE * (angle - slot)) for name, slot in SLOTS.items()}
    return PARTS | {"magnet": magnet} | {name: Material(current_density=j) for name, j in density.items()}


def sector(materials):
    """The problem of one pole: A on "left" is -A on "right". The mesh is drawn fine enough for elements of order 1."""
    fixed, sides = {"outer": 0.0, "inner": 0.0}, [("right", "left")]
    return Magnetostatics(materials, potential=fixed, antiperiodic=sides, order=1)


def machine(mesh):
    """The mesh of the sector with both sides of the ring, its gap inside of that named, which turns with the rotor."""
    middle = np.hypot(*mesh.p[:, mesh.t].mean(axis=1))
    inside = np.intersect1d(mesh.subdomains["gap"], np.flatnonzero(middle < RING))
    ring = {"ring": np.asarray(mesh.boundaries["ring"])}
    return mesh.with_subdomains(mesh.subdomains | {"gap_inside": inside}).with_boundaries(mesh.boundaries | ring)


def turned(mesh, further):
    """The mesh with its rotor turned by so many steps; what then sticks out of the sector belongs to its sides."""
    new = ka.turned(mesh, TURNS, POLE / STEPS * further)
    rim = new.boundary_facets()
    out = np.intersect1d(new.boundaries["ring"], rim)
    right = new.p[0, new.facets[:, out]].mean(axis=0) > 0.0
    sides = {"right": out[right], "left": out[~right]}
    sides = {name: np.intersect1d(np.union1d(new.boundaries[name], more), rim) for name, more in sides.items()}
    return new.with_boundaries(new.boundaries | sides)


def torque(field):
    """Of one pole, in N m per metre of depth, counter-clockwise."""
    return field.torque(["rotor", "magnet"])


def electric_torque(field, step):
    """Minus the sum of lambda dI/dtheta, whose mean is that of I dlambda/dtheta, as both repeat after a slot pitch."""
    total = 0.0
    for name, at in SLOTS.items():
        slope = np.pi / POLE * CURRENT * np.sin(np.pi / POLE * (POLE * step / STEPS - at))
        total -= field.flux_linkage(name) * slope * field.volume[field.mesh.subdomains[name]].sum()
    return total


def torques(field, idle, step):
    """What the curves are of: with the currents by the field in the gap and by flux linkage, and without currents."""
    return torque(field), electric_torque(field, step), torque(idle)


def sweep(mesh):
    """The adapted result of every angle, started from the last, and `torques` of meshes only turned and adapted."""
    plain = adapted = machine(mesh)
    last, results, table = 0, [], []
    for step in ANGLES:
        plain, adapted = turned(plain, step - last), turned(adapted, step - last)
        last, loaded, idle = step, sector(materials(step)), sector(materials(step, peak=0.0))
        outputs = {"torque (N m/m)": torque}
        # The ring stays as it is, for the rotor to turn on; so there are always two layers of elements in the gap. The
        # sides stay matched, for the problem says that they are a pair.
        passes = 1 if results else 3
        result = ka.adapt(adapted, loaded, passes=passes, pinned=["ring"], outputs=outputs)
        adapted = result.mesh
        results.append(result)
        fields = (loaded.solve(plain), idle.solve(plain)), (result.solution, idle.solve(adapted))
        table.append([torques(*pair, step) for pair in fields])
    return results, np.array(table).transpose(1, 2, 0)


def draw(result, path):
    """Mesh before and after, and flux lines over |B|: the whole sector, and the gap at a slot opening."""
    from matplotlib.figure import Figure  # needs matplotlib, the rest does not

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh

    figure = Figure(figsize=(14.0, 10.0), dpi=90, layout="constrained")
    panels, field = figure.subplots(2, 3), result.solution
    for row, place in zip(panels, ("", " at a slot opening"), strict=True):
        for axes, word, mesh in zip(row, ("before", "after"), (result.history[0].mesh, result.mesh), strict=False):
            draw_mesh(axes, mesh, unit="mm")
            axes.set_title(f"Mesh {word}{place or f': {mesh.p.shape[1]} nodes'}")
        colours = draw_field_lines(row[2], result.mesh, field.potential, np.hypot(*field.flux_density), unit="mm")
        row[2].set_title(f"Flux lines after{place}")
    for axes in panels[1]:
        axes.set(xlim=(-15.5, -8.5), ylim=(40.5, 47.5))
    figure.colorbar(colours, ax=panels[:, 2], label="flux density |B| (T)", extend="max", aspect=50)
    figure.savefig(path)


def draw_torque(result, table, path):
    """Flux lines on a mesh that has turned; torque over angle, with the currents and without."""
    from matplotlib.figure import Figure

    from kohonen_adapt.plotting import draw_field_lines

    figure = Figure(figsize=(16.0, 5.0), dpi=80, layout="constrained")
    (sector, *panels), degrees = figure.subplots(1, 3), np.degrees(POLE / STEPS * np.array(ANGLES))
    field = result.solution
    colours = draw_field_lines(sector, result.mesh, field.potential, np.hypot(*field.flux_density), unit="mm")
    figure.colorbar(colours, ax=sector, label="flux density |B| (T)", extend="max")
    sector.set_title(f"Rotor turned by {degrees[degrees.size // 2]:g} degrees")
    for axes, rows, title in zip(panels, ([0, 1], [2]), ("Torque with currents", "Cogging torque"), strict=True):
        for mesh, mark, values in zip(("Gmsh's mesh", "adapted"), ("s--", "o-"), table, strict=True):
            axes.plot(degrees, values[rows[0]], mark, label=f"{mesh}, eggshell", markersize=5)
        for row in rows[1:]:
            axes.plot(degrees, table[1, row], "k:", label="adapted, flux linkage (mean only)")
        axes.set(title=title, xlabel="rotor angle (degrees)", ylabel="torque of a pole (N m per metre)")
        axes.legend()
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    results, table = sweep(ka.read_mesh(MESH, scale=1e-3))  # drawn in millimetres
    print(results[0])
    for name, values in zip(("meshes of Gmsh, turned", "adapted meshes"), table, strict=True):
        eggshell, electric, cogging = values[:, :-1].mean(axis=1)  # the last angle is the first again
        print(
            f"{name}: mean torque {eggshell:.3f} N m/m per pole, electric {electric:.3f}: "
            f"{eggshell / electric - 1:+.2%}; mean cogging {cogging:+.3f}"
        )
    draw(results[0], folder / "motor.png")
    draw_torque(results[len(results) // 2], table, folder / "motor_torque.png")
    return results, table


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
