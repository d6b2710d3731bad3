"""The files that a run leaves: mesh, fields, table of passes, pictures and report, each whole or not at all."""

import csv
from pathlib import Path
from typing import Any

from kohonen_adapt.cases import Case
from kohonen_adapt.commands.reporting import energy_unit, length_unit, magnitude, write_run_report
from kohonen_adapt.files import whole_file
from kohonen_adapt.io import write_mesh
from kohonen_adapt.loop.result import AdaptResult, Pass
from kohonen_adapt.som.density import density_from_indicators

__all__ = ["RESULTS", "write_history", "write_pictures", "write_results"]

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

RESULTS = (MESH, FIELDS, HISTORY)


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
    write_history(result.history, folder)
    return list(RESULTS)


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
        write_run_report(folder / REPORT, case, before, after, {})
        raise
    write_run_report(folder / REPORT, case, before, after, {CAPTIONS[name]: folder / name for name in names})
    return [*names, REPORT]


def _draw(case: Case, before: AdaptResult, after: AdaptResult, folder: Path) -> list[str]:
    from kohonen_adapt import plotting  # it needs matplotlib, the rest does not

    unit, problem = length_unit(after), case.problem
    names = [pin for pin in case.adapt.get("pinned", ()) if isinstance(pin, str)]  # nodes have other numbers now
    density = density_from_indicators(before.mesh, before.indicators, order=problem.order)
    figures = {
        PICTURE: plotting.adaptation_figure(
            before,
            after,
            potential=after.solution.unknown,
            magnitude=magnitude(after.solution),
            magnitude_label="flux density |B| (T)",
            indicator_label=f"error indicator of an element, $\\sqrt{{\\mathrm{{{energy_unit(case)}}}}}$",
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


def _save(path: Path, figure: Any) -> None:
    with whole_file(path) as draft:
        figure.savefig(draft, format="png")


def write_history(history: tuple[Pass, ...], folder: Path) -> None:
    """Write ``history.csv``, a row for every pass.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    rows = [_row(step) for step in history]
    with whole_file(folder / HISTORY) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
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
