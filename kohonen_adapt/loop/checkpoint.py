"""The finished passes of a loop as files, so that a loop that was cut short can go on from the last of them."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Ints
from kohonen_adapt.files import whole_file
from kohonen_adapt.loop.history import Finished
from kohonen_adapt.mesh.host import remade
from kohonen_adapt.som.relocate import Relocation

__all__ = ["Checkpoint", "digest"]

FORMAT = 1  # of the files; another number is another format

# What of a pass is a number or a text, and of the relocation that made its mesh.
NUMBERS = ("energy_norm", "functional", "outputs", "comparable", "skipped", "seconds")
MOVE_NUMBERS = ("quantization_errors", "max_displacement", "moved", "message", "splits", "collapses", "polish_gain")

Arrays = dict[str, NDArray[Any]]

DIGEST = "sha256 "


@dataclass(frozen=True)
class Checkpoint:
    """A folder with one file for every finished pass of one run; without a folder nothing is kept.

    Attributes
    ----------
    folder
        Where the files are, or None.
    mesh
        The input mesh.
    settings
        What every pass depends on, name to text: passes of a run with other settings are refused.
    """

    folder: Path | None
    mesh: MeshTri
    settings: dict[str, str]

    @classmethod
    def at(cls, folder: str | PathLike[str] | None, mesh: MeshTri, settings: dict[str, str]) -> "Checkpoint":
        """Create the folder if need be, and see that what is in it belongs to this run.

        Raises
        ------
        ValueError
            If `folder` is no path, its passes are of another run, or the first of them is damaged or missing.
        OSError
            If the folder cannot be created or read.
        """
        if folder is None:
            return cls(None, mesh, settings)
        if not isinstance(folder, str | PathLike):
            raise ValueError(f"checkpoint must be the path of a folder, or None; got {folder!r}.")
        Path(folder).mkdir(parents=True, exist_ok=True)
        checkpoint = cls(Path(folder), mesh, settings)
        for _ in checkpoint.passes():
            break
        return checkpoint

    def passes(self) -> Iterator[Finished]:
        """The passes that are there, in order, the input's first.

        Raises
        ------
        ValueError
            If one is damaged, missing between others, or of another run.
        OSError
            If one cannot be read.
        """
        if self.folder is None:
            return
        files = set(self.folder.glob("pass-*.npz"))
        for number in range(len(files)):
            file = self._file(number)
            if file not in files:
                raise ValueError(
                    f"the checkpoint has '{max(files).name}' but no '{file.name}': delete the passes after the missing "
                    f"one to go on from the one before it, or choose another folder than '{self.folder}'."
                )
            yield self._read(file, number)

    def keep(self, number: int, finished: Finished) -> None:
        """Write a pass, whole or not at all.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        if self.folder is None:
            return
        about = {"format": FORMAT, "number": number, "settings": self.settings, **_numbers(finished)}
        arrays = {"indicators": finished.indicators, **_move_arrays(finished.move)}
        arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        with whole_file(self._file(number)) as draft, draft.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    def _file(self, number: int) -> Path:
        return (self.folder or Path()) / f"pass-{number:04d}.npz"

    def _read(self, file: Path, number: int) -> Finished:
        whole = BytesIO(file.read_bytes())  # what goes wrong from here on is damage and not the disk
        try:
            with np.load(whole, allow_pickle=False) as content:
                arrays = {name: content[name] for name in content.files}
            about = json.loads(arrays["about"].tobytes())
            if (about["format"], about["number"]) != (FORMAT, number):
                raise ValueError(f"it says format {about['format']} and pass {about['number']}")
            settings, finished = about["settings"], _finished(self.mesh, about, arrays)
        except Exception as error:  # zip, array and JSON readers raise many kinds on damage
            raise ValueError(
                f"the checkpoint '{file}' is damaged ({type(error).__name__}: {error}): delete it and the passes after "
                "it to go on from the one before, or choose another folder."
            ) from error
        _check_settings(self.folder, settings, self.settings)
        return finished


def digest(*arrays: NDArray[Any]) -> str:
    """A text that tells arrays from others: of their types, shapes and bytes."""
    found = sha256()
    for array in map(np.ascontiguousarray, arrays):
        found.update(f"{array.dtype.str}{array.shape}".encode())
        found.update(array.tobytes())
    return f"{DIGEST}{found.hexdigest()[:32]}"


def _check_settings(folder: Path | None, before: Mapping[str, str], now: Mapping[str, str]) -> None:
    differing = [
        f"its {name} is another one" if now.get(name, "").startswith(DIGEST) else f"its {name} was {was}, not {is_}"
        for name in dict.fromkeys([*before, *now])
        if (was := before.get(name, "none")) != (is_ := now.get(name, "none"))
    ]
    if differing:
        raise ValueError(
            f"the checkpoint in '{folder}' is of another run: {'; '.join(differing)}. Go on with what it was begun "
            "with, or choose another folder."
        )


def _numbers(finished: Finished) -> dict[str, Any]:
    """What of a pass goes into JSON, whose floats are exact."""
    move = finished.move
    return {
        **{name: getattr(finished, name) for name in NUMBERS},
        "move": None if move is None else {name: getattr(move, name) for name in MOVE_NUMBERS},
        "boundaries": None if move is None else _names(move.mesh.boundaries),
        "subdomains": None if move is None else _names(move.mesh.subdomains),
    }


def _names(sets: Mapping[str, Ints] | None) -> list[str] | None:
    return None if sets is None else list(sets)


def _move_arrays(move: Relocation | None) -> Arrays:
    """The arrays of a relocation; the input has none, for it comes in anyhow."""
    if move is None:
        return {}
    arrays: Arrays = {"p": move.mesh.p, "t": move.mesh.t, "old": move.old}
    for number, facets in enumerate((move.mesh.boundaries or {}).values()):
        arrays[f"boundary {number}"] = np.asarray(facets)
        if isinstance(facets, OrientedBoundary):
            arrays[f"orientation {number}"] = np.asarray(facets.ori)
    for number, elements in enumerate((move.mesh.subdomains or {}).values()):
        arrays[f"subdomain {number}"] = np.asarray(elements)
    return arrays


def _finished(mesh: MeshTri, about: dict[str, Any], arrays: Arrays) -> Finished:
    """The pass that was kept."""
    move = None if about["move"] is None else _move(mesh, about, arrays)
    return Finished(
        mesh=mesh if move is None else move.mesh,
        indicators=arrays["indicators"],
        move=move,
        **{name: about[name] for name in NUMBERS},
    )


def _move(mesh: MeshTri, about: dict[str, Any], arrays: Arrays) -> Relocation:
    numbers = {name: about["move"][name] for name in MOVE_NUMBERS}
    numbers["quantization_errors"] = tuple(numbers["quantization_errors"])
    subdomains = about["subdomains"]
    moved = remade(
        mesh,
        arrays["p"],
        arrays["t"],
        boundaries=_boundaries(about["boundaries"], arrays),
        subdomains=None if subdomains is None else {k: arrays[f"subdomain {n}"] for n, k in enumerate(subdomains)},
    )
    return Relocation(mesh=moved, old=arrays["old"], **numbers)


def _boundaries(names: list[str] | None, arrays: Arrays) -> dict[str, Ints] | None:
    if names is None:
        return None
    found = {}
    for number, name in enumerate(names):
        facets, orientation = arrays[f"boundary {number}"], arrays.get(f"orientation {number}")
        found[name] = facets if orientation is None else OrientedBoundary(facets, orientation)
    return found
