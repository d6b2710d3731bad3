"""Files of finished passes, from which an interrupted loop resumes."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Array, FilePath, Ints
from kohonen_adapt.files import remove_drafts, whole_file
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.growth import Growth, GrowthByTolerance
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import ONLY_ENDS, Settings
from kohonen_adapt.problem.protocol import CheckedProblem, Problem

FORMAT = 3  # version of the file format
DIGEST = "sha256 "

# Fields that files of earlier releases may lack.
ADDED: dict[str, Any] = dict.fromkeys(["unmoved", "refused_by_quality", "refused_by_reach", "held_in_polish"], 0)
ADDED |= {"order": 1, "output_errors": {}, "unimproved": "", "incomparable": "", "doubts": {}, "smooth": False}

STATE = "state "  # prefix of the names of mesh arrays


@dataclass(frozen=True)
class Checkpoint:
    """Folder with a file for every finished pass of a run.

    Attributes
    ----------
    folder
        Path of the folder.
    run
        Texts by name of everything that a pass depends on, see `fingerprint`. Passes of another run are refused.
    record
        Class of the passes. Every field is stored, except the mesh.
    """

    folder: Path
    run: dict[str, str]
    record: type[Pass] = Pass

    @classmethod
    def at(
        cls, folder: FilePath | None, mesh: Mesh, problem: CheckedProblem, settings: Settings
    ) -> "Checkpoint | None":
        """Return the checkpoint in a folder, or None for None.

        A missing folder is created. Raises ValueError if `folder` is no path, if a pass is missing, or if the first
        pass is damaged or of another run, and OSError if the folder cannot be created or read.
        """
        if folder is None:
            return None
        if not isinstance(folder, str | PathLike):
            raise ValueError(f"checkpoint must be the path of a folder, or None; got {folder!r}.")
        Path(folder).mkdir(parents=True, exist_ok=True)
        remove_drafts(Path(folder))
        checkpoint = cls(Path(folder), fingerprint(mesh, problem, settings))
        for file in checkpoint._files()[:1]:  # the loop reads the rest
            checkpoint._read(file)
        return checkpoint

    def passes(self, movable: MovableMesh | MovableSolid) -> Iterator[Pass]:
        """Yield the stored passes in order, with `movable` set to the mesh of each."""
        for file in self._files():
            values, state = self._read(file)
            try:
                movable.restore(state)
            except ValueError as error:
                raise self._damaged(file, error) from error
            mesh = movable.mesh() if values["number"] else movable.start()
            sizes = {"indicators": mesh.nelements, "nodes": mesh.nvertices}
            for name, size in sizes.items():
                if values[name].shape != (size,):
                    raise self._damaged(file, ValueError(f"{name} has shape {values[name].shape}, not ({size},)"))
            yield self.record(mesh=mesh, **values)

    def write(self, step: Pass, movable: MovableMesh | MovableSolid) -> None:
        """Write a pass and the current mesh to a new file, all or nothing.

        Raises OSError if the file cannot be written.
        """
        arrays = {f"{STATE}{name}": array for name, array in movable.state().items()}
        about: dict[str, Any] = {"format": FORMAT, "run": self.run}
        for name in self._names():
            value = getattr(step, name)
            (arrays if isinstance(value, np.ndarray) else about)[name] = value
        arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
        with whole_file(self._file(step.number)) as draft, draft.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    def _names(self) -> list[str]:
        return [field.name for field in fields(self.record) if field.name != "mesh"]

    def _file(self, number: int) -> Path:
        return self.folder / f"pass-{number:04d}.npz"

    def _files(self) -> list[Path]:
        files = set(self.folder.glob("pass-*.npz"))
        expected_files = [self._file(number) for number in range(len(files))]
        for file in expected_files:
            if file not in files:
                raise ValueError(
                    f"the checkpoint '{self.folder}' has '{max(files).name}' but no '{file.name}'. Delete the later "
                    "files to resume from the pass before, or use another folder."
                )
        return expected_files

    def _read(self, file: Path) -> tuple[dict[str, Any], dict[str, Array]]:
        stream_of_file = BytesIO(file.read_bytes())  # read first, so that later errors mean damage, not a disk error
        try:  # every array has a checksum in the file
            with np.load(stream_of_file, allow_pickle=False) as content:
                arrays = {name: content[name] for name in content.files}
            about = json.loads(arrays.pop("about").tobytes())
            if (about["format"], self._file(about["number"])) != (FORMAT, file):
                raise ValueError(f"found format {about['format']} and pass {about['number']}")
            stored = {**ADDED, **about, **arrays}
            values = {
                name: tuple(value) if isinstance(value := stored[name], list) else value for name in self._names()
            }
            state = {name.removeprefix(STATE): array for name, array in arrays.items() if name.startswith(STATE)}
        except Exception as error:  # zip, array and JSON readers raise many kinds on damage
            raise self._damaged(file, error) from error
        before, now = about["run"], self.run
        differing = [
            f"{name} differs" if now.get(name, "").startswith(DIGEST) else f"{name} was {was}, now {is_}"
            for name in dict.fromkeys([*before, *now])
            if (was := before.get(name, "none")) != (is_ := now.get(name, "none"))
        ]
        if differing:
            raise ValueError(
                f"the checkpoint in '{self.folder}' belongs to another run: {'; '.join(differing)}. Use the mesh, "
                "problem and arguments of that run, or another folder."
            )
        return values, state

    def _damaged(self, file: Path, error: Exception) -> ValueError:
        return ValueError(
            f"the checkpoint '{file}' is damaged ({type(error).__name__}: {error}). Delete this file and the later "
            "ones to resume from the pass before, or use another folder."
        )


def fingerprint(mesh: Mesh, given: Problem, settings: Settings) -> dict[str, str]:
    # The results of the problem and of the outputs are not included, nor the settings that only end the loop.
    problem = CheckedProblem(given)
    sides = {None: "", True: " on curved elements", False: " on straight elements"}[problem.is_curved]
    order = problem.at_grading_order.order
    texts = {
        "mesh": digest(mesh.p, mesh.t, *_set_arrays(mesh.boundaries), *_set_arrays(mesh.subdomains)),
        "problem": f"{problem.name} of order {order} in the {problem.norm} norm{sides}",
    }
    for group in (settings.rules, settings):
        for entry in fields(group):
            if entry.metadata != ONLY_ENDS and entry.name != "rules":
                name = entry.metadata.get("argument", entry.name)
                texts[name] = _text(getattr(group, entry.name), mesh)
    return texts


def _text(value: Any, mesh: Mesh) -> str:
    if value is None or isinstance(value, GrowthByTolerance):  # the passes so far serve any tolerance
        return "none"
    if isinstance(value, Growth):
        return f"{value.target} in {value.passes} passes" if value.target > value.start else "none"
    if isinstance(value, Mapping) and any(hasattr(item, "project") for item in value.values()):
        arrays = list[Array]()
        for name, curve in sorted(value.items()):
            ends = mesh.p[:, mesh.facets[:, np.asarray((mesh.boundaries or {})[name])]]
            arrays += [np.array(name), np.asarray(curve.project(ends.mean(axis=1)), float)]
        return digest(*arrays)
    if isinstance(value, Mapping):
        if all(callable(item) for item in value.values()):
            return str(sorted(value))
        return str({name: _without_type(item) for name, item in sorted(value.items())})
    if isinstance(value, list | tuple | range | np.ndarray):
        return str([_without_type(item) for item in value])
    return str(_without_type(value))


def _without_type(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else tuple(value) if isinstance(value, list) else value


def _set_arrays(sets: Mapping[str, Ints] | None) -> list[Array]:
    arrays: list[Array] = [np.array(sets is None)]
    for name, rows in (sets or {}).items():
        arrays += [
            np.array(name),
            np.asarray(rows, int),
            np.asarray(getattr(rows, "ori", []), int),
        ]
    return arrays


def digest(*arrays: Array) -> str:
    hashed = sha256()
    for array in map(np.ascontiguousarray, arrays):
        hashed.update(f"{array.dtype.str}{array.shape}".encode())
        hashed.update(array.tobytes())
    return f"{DIGEST}{hashed.hexdigest()[:32]}"
