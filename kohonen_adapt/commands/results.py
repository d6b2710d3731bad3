"""The files that a run leaves: mesh, fields, table of passes and pictures, each whole or not at all."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

from ..cases import Case
from ..io import write_mesh
from ..io.whole_file import whole_file
from ..result import AdaptResult, Pass

__all__ = ["write_pictures", "write_results"]

MILLIMETRES = 1.0  # m: smaller meshes are drawn in millimetres

MESH, FIELDS, HISTORY, PICTURE, OUTLINES = "adapted.msh", "adapted.vtu", "history.csv", "adaptation.png", "outlines.png"


def write_results(case: Case, result: AdaptResult, folder: Path) -> list[str]:
    """Write ``adapted.msh``, ``adapted.vtu`` and ``history.csv``.

    The Gmsh file has the unit and the numbers of groups of the mesh that came in, so that it can take its place; the
    VTU file is in metres.

    Returns
    -------
    list of str
        The names of the files.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    field = result.solution
    write_mesh(folder / MESH, result.mesh.scaled(1.0 / case.scale), groups=case.groups)
    write_mesh(
        folder / FIELDS,
        result.mesh,
        point_data={"A (Wb per m)": field.potential},
        cell_data={"B (T)": field.flux_density, "H (A per m)": field.field_strength, "indicator": result.indicators},
    )
    _write_history(folder / HISTORY, result.history)
    return [MESH, FIELDS, HISTORY]


def write_pictures(case: Case, before: AdaptResult, after: AdaptResult, folder: Path) -> list[str]:
    """Draw ``adaptation.png`` and ``outlines.png``.

    Returns
    -------
    list of str
        The names of the files.

    Raises
    ------
    ModuleNotFoundError
        Without matplotlib.
    OSError
        If one cannot be written.
    """
    from ..plotting import adaptation_figure, plot_outlines  # they need matplotlib, the rest does not

    unit = "mm" if np.ptp(after.mesh.p, axis=1).max() < MILLIMETRES else "m"
    meshes = adaptation_figure(
        before,
        after,
        potential=after.solution.unknown,
        magnitude=np.hypot(*after.solution.flux_density),
        magnitude_label="flux density |B| (T)",
        indicator_label=f"error indicator of an element, $\\sqrt{{\\mathrm{{{_energy_unit(case)}}}}}$",
        lines_title="Flux lines",
        unit=unit,
    )
    names = [pin for pin in case.adapt.get("pinned", ()) if isinstance(pin, str)]  # nodes have other numbers now
    outlines = plot_outlines(after.mesh, pinned=names, periodic=case.adapt.get("periodic", ()), unit=unit)
    _save(folder / PICTURE, meshes)
    _save(folder / OUTLINES, outlines.figure)
    return [PICTURE, OUTLINES]


def _save(path: Path, figure: Any) -> None:
    with whole_file(path) as draft:
        figure.savefig(draft, format="png")


def _energy_unit(case: Case) -> str:
    return "J" if case.problem.axisymmetric else "J/m"


def _write_history(path: Path, history: tuple[Pass, ...]) -> None:
    rows = [_row(step) for step in history]
    with whole_file(path) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _row(step: Pass) -> dict[str, object]:
    numbers = ("estimate", "energy_norm", "functional", "polish_gain", "min_quality", "mean_quality")
    counts = ("max_displacement", "collapses", "splits")
    return {
        "pass": step.number,
        "nodes": step.mesh.p.shape[1],
        "elements": step.mesh.t.shape[1],
        **{name: getattr(step, name) for name in (*numbers, *counts)},
        **{f"seconds {name}": step.seconds.get(name, 0.0) for name in ("solve", "estimate", "relocate", "polish")},
        **{f"output {name}": value for name, value in step.outputs.items()},
    }
