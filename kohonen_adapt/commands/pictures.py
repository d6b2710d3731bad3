"""Pictures and report of a run.

An OSError names the file that could not be written. A ModuleNotFoundError is raised without matplotlib.
"""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats, Texts
from kohonen_adapt.cases.case import Case
from kohonen_adapt.commands.plan import plan_sentence
from kohonen_adapt.display import lattice
from kohonen_adapt.files import save_figure
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.space.surfaces import Plane
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.single_steps import reasons_at
from kohonen_adapt.magnetostatics.hypercircle import Bracket
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.mesh.cells import centroids_of, width_of
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.report.scene import FieldOf
from kohonen_adapt.report.writing import write_report
from kohonen_adapt.som.density import density_from_indicators

__all__ = ["write_overview", "write_pictures"]

PICTURE, DENSITY, QUALITY, ESTIMATE = "adaptation.png", "density.png", "quality.png", "estimate.png"
OUTLINES, SURFACE, CUT = "outlines.png", "surface.png", "cut.png"
ANIMATION, REPORT = "passes.gif", "report.html"

CAPTIONS = {
    PICTURE: "Meshes, error indicators before and after on one scale, flux lines over |B|, estimate over the passes",
    DENSITY: "Density of nodes from the error indicators of the first mesh",
    QUALITY: "Quality of the elements before and after",
    ESTIMATE: "Estimate over the number of nodes, with the slope of optimal refinement",
    OUTLINES: "Boundaries and interfaces of the adapted mesh, with the freedom of nodes",
    CUT: "Flux density in a cut through its maximum, constant in every element",
    SURFACE: "Flux density on the surface of the mesh",
    ANIMATION: "The mesh, pass by pass",
}
"""Picture to caption, in the order of the report."""

BY_CORNERS = 3  # highest order shown by its values at corners in the view of a report
MILLIMETRES = 1.0  # m: smaller meshes are drawn in millimetres


def write_pictures(
    case: Case,
    before: AdaptResult,
    after: AdaptResult,
    folder: Path,
    options: Sequence[str] = (),
    bracket: Bracket | None = None,
) -> list[str]:
    """Draw the pictures, write the report and return the names of the files.

    If they cannot be drawn, as without matplotlib, the report has none. `options` are those of the command.
    """
    command = shlex.join(["kohonen-adapt", "run", case.file or "CASE.toml", *options, "--out", folder.name or "."])
    names = list[str]()
    try:
        names += _draw(case, before, after, folder)
    finally:
        pictures = {CAPTIONS[name]: folder / name for name in names}
        _write_report(folder / REPORT, case, before, after, pictures, command, bracket)
    return [*names, REPORT]


def write_overview(
    case: Case, before: AdaptResult, after: AdaptResult, picture: Path, report: Path, command: str
) -> None:
    save_figure(picture, _overview(case, before, after))
    _write_report(report, case, before, after, {CAPTIONS[PICTURE]: picture}, command)


def _draw(case: Case, before: AdaptResult, after: AdaptResult, folder: Path) -> list[str]:
    from kohonen_adapt import plotting  # needs matplotlib

    view, order = _view(case, after), CheckedProblem(case.problem).at_grading_order.order
    slope = -order / len(after.mesh.p) * (1 if case.goal is None else 2)  # the error of a goal has twice the order
    density = density_from_indicators(before.mesh, before.indicators, order=order)
    figures = {
        PICTURE: _overview(case, before, after),
        DENSITY: plotting.plot_density(before.mesh, density, **view).figure,
        QUALITY: plotting.plot_qualities({"before": before.mesh, "after": after.mesh}).figure,
        ESTIMATE: plotting.plot_convergence({"passes": after.history}, slope=slope).figure,
    }
    plane, unit = view["plane"], view["unit"]
    if plane is None:
        rules = _rules(case, before, after)
        figures[OUTLINES] = plotting.plot_outlines(
            after.mesh,
            pinned=rules.pinned,
            curves=rules.curves,
            periodic=rules.periodic,
            unit=unit,
            axisymmetric=case.axisymmetric,
        ).figure
    else:
        size, label = _magnitude(after.solution), "flux density |B| (T)"
        look: Any = {"label": label, "unit": unit, "coils": case.coils.values()}
        figures[SURFACE] = plotting.plot_surface(after.mesh, size, **look).figure
        figures[CUT] = plotting.plot_slice(after.mesh, plane, values=size, **look).figure
    for name, figure in figures.items():
        save_figure(folder / name, figure)
    plotting.animate_passes(folder / ANIMATION, after.history, **view)
    return [*figures, ANIMATION]


def _overview(case: Case, before: AdaptResult, after: AdaptResult) -> Any:
    from kohonen_adapt import plotting

    field = after.solution
    if len(after.mesh.p) == 3:
        potential, size = field.potential[: field.mesh.nvertices], _magnitude(field)
    else:
        potential = _potential(field, flux=field.axisymmetric, by_corners=1)
        size = _magnitude(field, field.elements.order)
    unit = (case.problem.goal_unit or case.energy_unit).replace(" ", r"\ ")  # mathtext drops spaces
    return plotting.adaptation_figure(
        before,
        after,
        potential=potential,
        magnitude=size,
        magnitude_label="flux density |B| (T)",
        indicator_label=f"error indicator of an element, $\\sqrt{{\\mathrm{{{unit}}}}}$",
        lines_title="Flux lines" if len(after.mesh.p) == 2 else "Potential",
        **_view(case, after),
    )


def _write_report(
    path: Path,
    case: Case,
    before: AdaptResult,
    after: AdaptResult,
    pictures: Mapping[str, Path],
    command: str,
    bracket: Bracket | None = None,
) -> None:
    write_report(
        path,
        after,
        before=before,
        title=f"Adaptation of {case.mesh.name}",
        asked=plan_sentence(case, before.mesh),
        point_data=_potentials(case),
        cell_data={"flux density |B| (T)": _magnitude},
        indicator_label=f"error indicator of an element (√({case.problem.goal_unit or case.energy_unit}))",
        held=lambda result: _why_held(case, before, result),
        coils=case.coils.values(),
        **_view(case, after),
        pictures=pictures,
        settings={"Command": command, "Case": case.text, "Seed": str(case.adapt.get("seed", 0))},
        bracket=bracket,
    )


def _rules(case: Case, before: AdaptResult, result: AdaptResult) -> Rules:
    options = case.options(before.mesh)
    names = [pin for pin in options["pinned"] if isinstance(pin, str)]
    numbers = [pin for pin in options["pinned"] if not isinstance(pin, str)]
    return Rules(
        pinned=[*names, *np.flatnonzero(np.isin(result.nodes, numbers)).tolist()],
        curves=options.get("curves"),
        periodic=options.get("periodic", CheckedProblem(case.problem).pairs),
        surfaces=options.get("surfaces"),
    )


def _why_held(case: Case, before: AdaptResult, result: AdaptResult) -> Texts:
    why = reasons_at(result.mesh, CheckedProblem(case.problem), _rules(case, before, result), result.solution)
    why[why == f"polish: {result.best.unpolished}"] = ""  # for all nodes, and in the summary
    return why


def _potentials(case: Case) -> dict[str, FieldOf]:
    if not isinstance(case.problem, Magnetostatics):
        return {"scalar potential (A)": lambda field: field.potential[: field.mesh.nvertices]}
    flux: dict[str, FieldOf] = {"flux function r A (Wb)": lambda field: _potential(field, flux=True)}
    return {**(flux if case.axisymmetric else {}), "vector potential A (Wb/m)": _potential}


def _potential(field: Any, flux: bool = False, by_corners: int = BY_CORNERS) -> Floats:
    order = field.elements.order
    if order <= by_corners:
        return field.unknown[: field.mesh.nvertices] if flux else field.potential
    share, _ = lattice(order)
    values = field.potential_at_each(share)
    return values * field.at_each(share).x[0].reshape(values.shape) if flux else values


def _magnitude(field: Any, divisions: int = 0) -> Floats:
    # in T, (nelements,), or above order 1 (k, nelements) on a lattice
    order = field.elements.order
    if order == 1 or len(field.mesh.p) == 3:
        return magnitude(field.flux_density)
    share, _ = lattice(divisions or (order - 1 if order > BY_CORNERS else 1))
    return np.hypot(*field.at_each(share).flux_density).reshape(share.shape[1], -1)


def _view(case: Case, result: AdaptResult) -> dict[str, Any]:
    # arguments of drawings; solids are cut through the maximum of the flux density
    mesh, plane = result.mesh, None
    if len(mesh.p) == 3:
        x, y, z = centroids_of(mesh, np.argmax(_magnitude(result.solution))).tolist()
        plane = Plane((x, y, z), (0.0, 1.0, 0.0))
    unit = "mm" if width_of(mesh) < MILLIMETRES else "m"
    return {"plane": plane, "unit": unit, "axisymmetric": case.axisymmetric}
