"""Adaptation of a case in a folder, with results after every pass.

Files are written whole or not at all. An OSError names the file that could not be written.
"""

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.cases.case import Case
from kohonen_adapt.commands.arguments import check_resumed
from kohonen_adapt.display import lattice_points
from kohonen_adapt.files import remove_drafts, whole_file, whole_files
from kohonen_adapt.io import write_mesh
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.figures import pass_figures
from kohonen_adapt.loop.passes import Passes
from kohonen_adapt.loop.result import AdaptResult

__all__ = ["CaseRun", "curve_sentence", "results_of", "write_fields"]

MESH, FIELDS, INSIDE, HISTORY = "adapted.msh", "adapted.vtu", "inside.vtu", "history.csv"
PASSES = "passes"  # subfolder of the finished passes
POTENTIAL = {2: "A (Wb per m)", 3: "phi (A)"}  # by dimension
HIGHEST_AT_NODES = 2  # order of potentials in space in the file of fields


@dataclass
class CaseRun:
    """Run of a case.

    Attributes
    ----------
    case, mesh
        The case and its mesh.
    folder
        Existing folder for the results.
    progress
        Function of pass and step, as for `adapt`, with the step "write" added.
    report
        Function of the result so far, called after the files of every pass are written.
    """

    case: Case
    mesh: MeshTri
    folder: Path
    progress: Callable[[int, str], Any]
    report: Callable[[AdaptResult], Any]
    _written: MeshTri | None = field(default=None, init=False)

    def begin(self, resume: bool, force: bool) -> int:
        """Prepare the folder for a new or a resumed run, and return the finished passes.

        Raises
        ------
        FileNotFoundError
            If there is no run to resume.
        FileExistsError
            If the folder has the result or the passes of a run, and neither `resume` nor `force` is set, or if the
            folder of the passes is a link.
        OSError
            If files cannot be removed.
        """
        passes = self.folder / PASSES
        check_resumed(passes, resume, "run")
        files = sorted(passes.glob("pass-*.npz"))
        if not resume:
            there = [name for name in (MESH, FIELDS, INSIDE, HISTORY) if (self.folder / name).exists()]
            if (files or there) and not force:
                raise FileExistsError(
                    f"'{self.folder}' has the result of a run: continue with --resume {self.folder}, overwrite with "
                    "--force, or choose another folder."
                )
            while files:  # in reverse, so that an interruption leaves a valid run
                files.pop().unlink()
        passes.mkdir(exist_ok=True)
        remove_drafts(self.folder)  # `adapt` cleans the folder of the passes
        return len(files)

    def result(self) -> AdaptResult:
        case = self.case
        result = adapt(
            self.mesh,
            case.problem,
            outputs=case.labelled_outputs or None,
            interim=self._interim,
            progress=self.progress,
            checkpoint=self.folder / PASSES,
            **case.options(self.mesh),
        )
        if self._written is not result.mesh or result.best.goal is not None:
            self._write(result)  # after resuming a finished run, or with the final errors beside a goal
        return result

    def _interim(self, result: AdaptResult) -> None:
        self._write(result)
        self.report(result)

    def _write(self, result: AdaptResult) -> None:
        self.progress(result.history[-1].number, "write")
        if self._written is result.mesh:
            _write_history(result.history, self.folder)
            return
        with whole_files(self.folder) as draft:
            write_fields(self.case, result, draft / MESH, draft / FIELDS)
            if result.solution.elements.order > 1:
                _write_inside(result.solution, draft / INSIDE)
            _write_history(result.history, draft)
        self._written = result.mesh


def write_fields(case: Case, result: AdaptResult, mesh: Path, fields: Path) -> None:
    # The Gmsh file has the unit and group numbers of the input. The file for ParaView is in metres, with B and H as
    # means of the elements.
    field = result.solution
    # higher orders are in the file with values inside elements
    above = field.elements.dim == 3 and field.elements.order > HIGHEST_AT_NODES
    potential = field.potential[: field.mesh.nvertices] if above else field.potential
    write_mesh(mesh, result.mesh.scaled(1.0 / case.scale), groups=case.groups)
    write_mesh(
        fields,
        result.mesh,
        point_data={POTENTIAL[len(result.mesh.p)]: np.asarray(potential)},
        cell_data={"B (T)": field.flux_density, "H (A per m)": field.field_strength, "indicator": result.indicators},
    )


def curve_sentence(case: Case, result: AdaptResult) -> str:
    before, now = (step.sagitta / case.scale for step in (result.history[0], result.best))
    if max(before, now) == 0.0:
        return ""
    sides = "facets" if len(result.mesh.p) == 2 else "faces"
    return f"Largest distance of curves from {sides}: {now:.3g}, before {before:.3g}, in the unit of {case.mesh.name}."


def results_of(result: AdaptResult) -> list[str]:
    return [MESH, FIELDS, *([INSIDE] if result.solution.elements.order > 1 else []), HISTORY]


def _write_inside(field: Any, path: Path) -> None:
    dim = field.elements.dim
    share = lattice_points(field.elements.order, dim)
    at, count = field.at_each(share), field.mesh.nelements
    data = {POTENTIAL[dim]: field.potential_at_each(share)}
    for name, unit, vector in (("B", "T", at.flux_density), ("H", "A per m", at.field_strength)):
        data |= {f"{name}_{axis} ({unit})": part.reshape(-1, count) for axis, part in zip("xyz", vector, strict=False)}
    write_mesh(path, field.mesh, point_data=data, positions=at.x)


def _write_history(history: Passes, folder: Path) -> None:
    rows = [
        {"pass": step.number, "nodes": step.mesh.nvertices, "elements": step.mesh.nelements, **pass_figures(step)}
        for step in history
    ]
    with whole_file(folder / HISTORY) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
        titles = list(dict.fromkeys(title for row in rows for title in row))  # errors may be unknown in the first row
        writer = csv.DictWriter(stream, titles)
        writer.writeheader()
        writer.writerows(rows)
