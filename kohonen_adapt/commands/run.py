"""Adapt a case in a folder: write what is best after every pass, and go on with a run that was cut short."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from skfem import MeshTri

from kohonen_adapt.cases import Case
from kohonen_adapt.commands.results import write_history, write_results
from kohonen_adapt.files import remove_drafts, whole_file, whole_files
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.passes import Status
from kohonen_adapt.loop.result import AdaptResult

__all__ = ["CaseRun"]

PASSES = "passes"  # folder of the finished passes, below that of the results
ENDED = "ended.txt"  # in it: says that the run came to its end, and how


class CaseRun:
    """One run of a case.

    Parameters
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

    def __init__(
        self,
        case: Case,
        mesh: MeshTri,
        folder: Path,
        *,
        progress: Callable[[int, str], Any],
        told: Callable[[AdaptResult], Any],
    ) -> None:
        self._case, self._mesh, self._folder = case, mesh, folder
        self._progress, self._told = progress, told
        self._written: MeshTri | None = None

    @property
    def passes(self) -> Path:
        """The folder of the finished passes."""
        return self._folder / PASSES

    def start_anew(self) -> int:
        """Make room for a run from the input on; passes of a run that has not ended are worth keeping.

        Returns
        -------
        int
            The number of finished passes: 0.

        Raises
        ------
        FileExistsError
            If there are such.
        OSError
            If files cannot be removed.
        """
        files = self._files()
        if files and not (self.passes / ENDED).exists():
            raise FileExistsError(
                f"'{self._folder}' has passes of a run that has not ended: go on with --resume "
                f"{self._folder}, or delete '{self.passes}' to start anew."
            )
        for file in reversed(files):  # the last one first: what is left if this is cut short is a run, too
            file.unlink()
        (self.passes / ENDED).unlink(missing_ok=True)
        return self._open()

    def go_on(self) -> int:
        """Make ready for a run from the last finished pass on.

        Returns
        -------
        int
            The number of finished passes.

        Raises
        ------
        FileNotFoundError
            If nobody has begun one in the folder.
        OSError
            If files cannot be removed.
        """
        if not self.passes.is_dir():
            raise FileNotFoundError(
                f"--resume expected the folder of a run that was begun; '{self._folder}' has no '{PASSES}'. Begin with "
                f"--out {self._folder}."
            )
        return self._open()

    def _files(self) -> list[Path]:
        return sorted(self.passes.glob("pass-*.npz"))

    def _open(self) -> int:
        self.passes.mkdir(exist_ok=True)
        for folder in (self._folder, self.passes):
            remove_drafts(folder)  # of a process that was killed
        return len(self._files())

    def result(self) -> AdaptResult:
        """Adapt, and write the mesh, the fields and the table of passes of the result; groups of points stay.

        Raises
        ------
        ValueError
            If the finished passes are damaged or of another run, or what `adapt` refuses.
        OSError
            If a file cannot be written.
        """
        case = self._case
        held = case.groups.held(self._mesh.scaled(1.0 / case.scale))
        result = adapt(
            self._mesh,
            case.problem,
            outputs=case.labelled_outputs or None,
            interim=self._interim,
            progress=self._progress,
            checkpoint=self.passes,
            **{**case.adapt, "pinned": [*case.pinned, *held]},
        )
        if self._written is not result.mesh:  # all its passes are of a run before
            self._write(result)
        if result.status is not Status.FAILED:
            with whole_file(self.passes / ENDED) as draft:
                draft.write_text(f"{result.message}\n", encoding="utf-8")
        return result

    def _interim(self, result: AdaptResult) -> None:
        (self.passes / ENDED).unlink(missing_ok=True)
        self._write(result)
        self._told(result)

    def _write(self, result: AdaptResult) -> None:
        """Write what is new: the best pass if it is another, and the history."""
        self._progress(result.history[-1].number, "write")
        if self._written is result.mesh:
            write_history(result.history, self._folder)
            return
        with whole_files(self._folder) as draft:
            write_results(self._case, result, draft)
        self._written = result.mesh
