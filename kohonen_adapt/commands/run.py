"""Adapt a case in a folder: write what is best after every pass, and go on with a run that was cut short.

Files are whole or not there; an OSError says which could not be written.
"""

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skfem import MeshTri

from kohonen_adapt.cases.contents import Case
from kohonen_adapt.commands.arguments import refuse_link
from kohonen_adapt.display import divided, lattice
from kohonen_adapt.files import remove_drafts, whole_file, whole_files
from kohonen_adapt.io import write_mesh
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.table import pass_figures

__all__ = ["CaseRun", "curve_sentence", "results_of", "write_fields"]

MESH, FIELDS, INSIDE, HISTORY = "adapted.msh", "adapted.vtu", "inside.vtu", "history.csv"
PASSES = "passes"  # folder of the finished passes, below that of the results
ENDED = "ended.txt"  # in it: says that the run came to its end, and how


@dataclass
class CaseRun:
    """One run of a case.

    Attributes
    ----------
    case, mesh
        The case and its mesh.
    folder
        For the results; it exists.
    progress
        As `adapt` takes it; there is the step "write" besides.
    told
        Called after every pass with the result so far, when that is written.
    """

    case: Case
    mesh: MeshTri
    folder: Path
    progress: Callable[[int, str], Any]
    told: Callable[[AdaptResult], Any]
    _written: MeshTri | None = field(default=None, init=False)

    @property
    def passes(self) -> Path:
        """The folder of the finished passes."""
        return self.folder / PASSES

    def begin(self, resume: bool, force: bool) -> int:
        """Prepare the folder for a new run, or to go on from the last finished pass; return the finished passes.

        Raises
        ------
        FileNotFoundError
            If there is no run to go on with.
        FileExistsError
            If the folder has the result or the passes of a run, and neither `resume` nor `force` is given, or if the
            folder of the passes is a link.
        OSError
            If files cannot be removed.
        """
        refuse_link(self.passes)
        if not resume:
            self._remove_run(force)
        elif not self.passes.is_dir():
            raise FileNotFoundError(
                f"--resume expected the folder of a run that was begun; '{self.folder}' has no '{PASSES}'. Begin with "
                f"--out {self.folder}."
            )
        self.passes.mkdir(exist_ok=True)
        remove_drafts(self.folder)  # `adapt` does it in that of the passes
        return len(self._files())

    def _files(self) -> list[Path]:
        return sorted(self.passes.glob("pass-*.npz"))

    def _remove_run(self, force: bool) -> None:
        files, ended = self._files(), self.passes / ENDED
        there = [name for name in (MESH, FIELDS, INSIDE, HISTORY) if (self.folder / name).exists()]
        if (files or there) and not force:
            found = "the result of a run" if ended.exists() or not files else "passes of a run that has not ended"
            raise FileExistsError(
                f"'{self.folder}' has {found}: go on with --resume {self.folder}, write over it with --force, or "
                "choose another folder."
            )
        for file in reversed(files):  # the last one first: what is left if this is cut short is a run, too
            file.unlink()
        ended.unlink(missing_ok=True)

    def result(self) -> AdaptResult:
        """Adapt, and write the mesh, the fields and the table of passes of the result; groups of points stay.

        Raises
        ------
        ValueError
            If the finished passes are damaged or of another run, or what `adapt` refuses.
        OSError
            If a file cannot be written.
        """
        case = self.case
        result = adapt(
            self.mesh,
            case.problem,
            outputs=case.labelled_outputs or None,
            interim=self._interim,
            progress=self.progress,
            checkpoint=self.passes,
            **case.options(self.mesh),
        )
        if self._written is not result.mesh or result.best.goal_error is not None:
            self._write(result)  # all passes may be of a run before; the error of a goal is known at the end
        if result.status is not Status.FAILED:
            with whole_file(self.passes / ENDED) as draft:
                draft.write_text(f"{result.message}\n", encoding="utf-8")
        return result

    def _interim(self, result: AdaptResult) -> None:
        (self.passes / ENDED).unlink(missing_ok=True)
        self._write(result)
        self.told(result)

    def _write(self, result: AdaptResult) -> None:
        """Write what is new: the best pass if it is another, and the history."""
        self.progress(result.history[-1].number, "write")
        if self._written is result.mesh:
            _write_history(result.history, self.folder)
            return
        with whole_files(self.folder) as draft:
            write_fields(self.case, result, draft / MESH, draft / FIELDS)
            if self.case.problem.order > 1:
                _write_inside(result.solution, draft / INSIDE)
            _write_history(result.history, draft)
        self._written = result.mesh


def write_fields(case: Case, result: AdaptResult, mesh: Path, fields: Path) -> None:
    """Write the mesh for Gmsh, and in metres with the fields for ParaView.

    The Gmsh file has the unit and the numbers of groups of the mesh that came in, so that it can take its place. In the
    other B and H are the means of the elements.
    """
    field = result.solution
    write_mesh(mesh, result.mesh.scaled(1.0 / case.scale), groups=case.groups)
    write_mesh(
        fields,
        result.mesh,
        point_data={"A (Wb per m)" if len(result.mesh.p) == 2 else "phi (A)": field.potential},
        cell_data={"B (T)": field.flux_density, "H (A per m)": field.field_strength, "indicator": result.indicators},
    )


def curve_sentence(case: Case, result: AdaptResult) -> str:
    """Return how far curves are from their facets, in the unit of the mesh file; an empty string for no distance."""
    before, now = (step.sagitta / case.scale for step in (result.history[0], result.best))
    if max(before, now) == 0.0:
        return ""
    sides = "facets" if len(result.mesh.p) == 2 else "faces"
    return f"Curves are up to {now:.3g} away from their {sides}, before {before:.3g}, in the unit of {case.mesh.name}."


def results_of(case: Case) -> list[str]:
    """The names of the files that are there whatever can be drawn."""
    return [MESH, FIELDS, *([INSIDE] if case.problem.order > 1 else []), HISTORY]


def _write_inside(field: Any, path: Path) -> None:
    """Write a field of higher order for ParaView: its elements divided, with nodes of their own, so that B may jump."""
    share, _ = lattice(field.elements.order)
    at = field.at_each(share)
    data = {"A (Wb per m)": field.potential_at_each(share).ravel()}
    for name, unit, vector in (("B", "T", at.flux_density), ("H", "A per m", at.field_strength)):
        data |= {f"{name}_{axis} ({unit})": values for axis, values in zip("xy", vector, strict=True)}
    write_mesh(path, divided(field.mesh, field.elements.order), point_data=data)


def _write_history(history: tuple[Pass, ...], folder: Path) -> None:
    """Write ``history.csv``, a row for every pass."""
    rows = []
    for step in history:
        figures = pass_figures(step)
        shape = {"pass": figures.pop("number"), "nodes": step.mesh.nvertices, "elements": step.mesh.t.shape[1]}
        rows.append(shape | figures)
    with whole_file(folder / HISTORY) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
