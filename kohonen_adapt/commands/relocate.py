"""Relocate the nodes of a mesh file by a field file, for any solver."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.io import MSH_VERSION, read_groups, read_mesh, write_mesh
from kohonen_adapt.io.fields import FIELD_SUFFIXES, read_field
from kohonen_adapt.som.density import density_from_indicators, density_from_sizes
from kohonen_adapt.som.relocate import relocate

__all__ = ["MEANINGS", "field_source", "relocate_file"]


def _as_it_is(mesh: MeshTri, values: NDArray[Any]) -> NDArray[Any]:
    return values


MEANINGS: dict[str, Callable[[MeshTri, NDArray[Any]], NDArray[Any]]] = {
    "density": _as_it_is,
    "indicators": density_from_indicators,
    "sizes": density_from_sizes,
}
"""Meaning of a field to the function that makes a density of it."""

SOURCE = re.compile(rf"(.+?(?:{'|'.join(map(re.escape, FIELD_SUFFIXES))})):(.+)", re.IGNORECASE | re.DOTALL)


def field_source(text: str, option: str) -> tuple[Path, str]:
    """File and field of ``FIELD.vtu:name``.

    Parameters
    ----------
    text
        What the user wrote.
    option
        Where, for messages.

    Raises
    ------
    ValueError
        If it is none.
    """
    found = SOURCE.fullmatch(text)
    if not found:
        others = ", ".join(FIELD_SUFFIXES[1:])
        raise ValueError(f"{option} expected FIELD.vtu:name, a file (or {others}) and a field of it; got '{text}'.")
    return Path(found[1]), found[2]


def relocate_file(
    source: Path,
    field: tuple[Path, str],
    target: Path,
    *,
    scale: float = 1.0,
    meaning: str = "density",
    topology: str = "flip",
    min_quality: float = 0.3,
    pinned: Sequence[int | str] = (),
    seed: int = 0,
    periodic: Sequence[tuple[str, str]] = (),
    layers: Mapping[str, int] | None = None,
    progress: Callable[[str], Any] = lambda step: None,
) -> tuple[MeshTri, MeshTri]:
    """Read a mesh and a field on it, relocate, and write the mesh in the unit it came in, with the same groups.

    Physical groups keep their numbers, and points in a group their place.

    Parameters
    ----------
    source, target
        Mesh files.
    field
        File and name of a field, per element or per node.
    scale
        Units of the field file per unit of the mesh file: for a field in metres the metres per unit.
    meaning
        What it holds, a key of `MEANINGS`.
    topology, min_quality, pinned, seed, periodic, layers
        As `relocate` takes them.
    progress
        Called with the name of each step when it begins: "read", "relocate", "write".

    Returns
    -------
    tuple of MeshTri
        The mesh before and after.

    Raises
    ------
    ValueError
        If a file is damaged, the field is not on the mesh, or `relocate` refuses what it is given.
    OSError
        If a file cannot be read or written.
    """
    if target.suffix.lower() not in (*MSH_VERSION, ".vtu"):
        raise ValueError(f"--out expected a file that ends in {', '.join(MSH_VERSION)}, .vtu; got '{target.name}'.")
    progress("read")
    mesh, groups = read_mesh(source), read_groups(source)
    values = read_field(*field, mesh, scale)
    progress("relocate")
    after = relocate(
        mesh,
        MEANINGS[meaning](mesh, values),
        topology=topology,
        min_quality=min_quality,
        pinned=[*pinned, *groups.held(mesh)],
        seed=seed,
        periodic=periodic,
        layers=layers,
    )
    progress("write")
    write_mesh(target, after, groups=groups)
    return mesh, after
