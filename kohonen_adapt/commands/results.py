"""The files that a run leaves: mesh, fields, table of passes, pictures and report, each whole or not at all."""

import csv
import shlex
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cases import Case
from ..density import density_from_indicators
from ..io import write_mesh
from ..io.whole_file import whole_file
from ..loop import adapt
from ..report import FieldOf, write_report
from ..result import AdaptResult, Pass

__all__ = ["write_pictures", "write_results"]

MILLIMETRES = 1.0  # m: smaller meshes are drawn in millimetres

PASSES_BY_DEFAULT = signature(adapt).parameters["passes"].default

MESH, FIELDS, HISTORY, REPORT = "adapted.msh", "adapted.vtu", "history.csv", "report.html"
PICTURE, DENSITY, QUALITY, ESTIMATE = "adaptation.png", "density.png", "quality.png", "estimate.png"
OUTLINES, PASSES = "outlines.png", "passes.gif"

CAPTIONS = {
    PICTURE: "Meshes, error indicators before and after on one scale, flux lines over |B|, estimate over the passes",
    DENSITY: "Density of nodes that the error indicators of the first mesh ask for",
    QUALITY: "Quality of the elements before and after",
    ESTIMATE: "Estimate over the number of nodes, with the slope of the best refinement",
    OUTLINES: "Outlines of the adapted mesh: where nodes may go",
    PASSES: "The mesh, pass by pass",
}
"""Of the pictures in a report, in its order."""


def write_results(case: Case, result: AdaptResult, folder: Path) -> list[str]:
    """Write ``adapted.msh``, ``adapted.vtu`` and ``history.csv``.

    The Gmsh file has the unit of the mesh that came in, so that it can take its place; the VTU file is in metres.

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
    write_mesh(folder / MESH, result.mesh.scaled(1.0 / case.scale))
    write_mesh(
        folder / FIELDS,
        result.mesh,
        point_data={"A (Wb per m)": field.potential},
        cell_data={"B (T)": field.flux_density, "H (A per m)": field.field_strength, "indicator": result.indicators},
    )
    _write_history(folder / HISTORY, result.history)
    return [MESH, FIELDS, HISTORY]


def write_pictures(case: Case, before: AdaptResult, after: AdaptResult, folder: Path) -> list[str]:
    """Draw the pictures and write the report that shows them; without matplotlib a report without them.

    Returns
    -------
    list of str
        The names of the files.

    Raises
    ------
    ModuleNotFoundError
        Without matplotlib, when the report is written.
    OSError
        If one cannot be written.
    """
    try:
        names = _draw(case, before, after, folder)
    except ModuleNotFoundError:
        _write_report(case, before, after, folder, [])
        raise
    _write_report(case, before, after, folder, names)
    return [*names, REPORT]


def _draw(case: Case, before: AdaptResult, after: AdaptResult, folder: Path) -> list[str]:
    from .. import plotting  # it needs matplotlib, the rest does not

    unit, problem = _unit(after), case.problem
    names = [pin for pin in case.adapt.get("pinned", ()) if isinstance(pin, str)]  # nodes have other numbers now
    density = density_from_indicators(before.mesh, before.indicators, order=problem.order)
    figures = {
        PICTURE: plotting.adaptation_figure(
            before,
            after,
            potential=after.solution.unknown,
            magnitude=_magnitude(after.solution),
            magnitude_label="flux density |B| (T)",
            indicator_label=f"error indicator of an element, $\\sqrt{{\\mathrm{{{_energy_unit(case)}}}}}$",
            lines_title="Flux lines",
            unit=unit,
        ),
        DENSITY: plotting.plot_density(before.mesh, density, unit=unit).figure,
        QUALITY: plotting.plot_qualities({"before": before.mesh, "after": after.mesh}).figure,
        ESTIMATE: plotting.plot_convergence({"passes": after.history}, slope=-0.5 * problem.order).figure,
        OUTLINES: plotting.plot_outlines(
            after.mesh, pinned=names, periodic=case.adapt.get("periodic", ()), unit=unit
        ).figure,
    }
    for name, figure in figures.items():
        _save(folder / name, figure)
    plotting.animate_passes(folder / PASSES, after.history, unit=unit)
    return [*figures, PASSES]


def _write_report(case: Case, before: AdaptResult, after: AdaptResult, folder: Path, pictures: list[str]) -> None:
    command = shlex.join(["kohonen-adapt", "run", case.file or "CASE.toml", "--out", folder.name or "."])
    write_report(
        folder / REPORT,
        after,
        before=before,
        title=f"Adaptation of {case.mesh.name}",
        asked=_asked(case, before),
        point_data=_potentials(case),
        cell_data={"flux density |B| (T)": _magnitude},
        indicator_label=f"error indicator of an element (√({_energy_unit(case)}))",
        unit=_unit(after),
        pictures={CAPTIONS[name]: folder / name for name in pictures},
        settings={"Command": command, "Case": case.text, "Seed": str(case.adapt.get("seed", 0))},
    )


def _potentials(case: Case) -> dict[str, FieldOf]:
    """What is shown per node; the contours of the first are the flux lines."""
    flux: dict[str, FieldOf] = {"flux function r A (Wb)": lambda field: field.unknown}
    return {
        **(flux if case.problem.axisymmetric else {}),
        "vector potential A (Wb/m)": lambda field: field.potential,
    }


def _asked(case: Case, before: AdaptResult) -> str:
    """A sentence: what was to be done."""
    options, problem = case.adapt, case.problem
    target = f" and grow it to {options['target_nodes']} nodes" if "target_nodes" in options else ""
    until = [f"{key} = {options[key]:g}" for key in ("rtol", "atol", "output_rtol") if key in options]
    stop = f", until {' or '.join(until)}" if until else ""
    outputs = f" Outputs asked for: {', '.join(case.outputs)}." if case.outputs else ""
    return (
        f"Asked for: adapt {case.mesh.name} ({before.mesh.p.shape[1]} nodes, {before.mesh.t.shape[1]} elements)"
        f"{target} in at most {options.get('passes', PASSES_BY_DEFAULT)} passes{stop}, by the {problem.estimator} "
        f"estimate of the magnetic field with {len(problem.materials)} materials.{outputs}"
    )


def _magnitude(field: Any) -> NDArray[np.float64]:
    return np.hypot(*field.flux_density)


def _unit(result: AdaptResult) -> str:
    return "mm" if np.ptp(result.mesh.p, axis=1).max() < MILLIMETRES else "m"


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
