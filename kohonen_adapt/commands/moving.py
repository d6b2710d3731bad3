"""A mesh file and a density file in, a better mesh file out: the map for any solver."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skfem import MeshTri

from ..io import MSH_VERSION, read_mesh, write_mesh
from ..io.fields import read_field
from ..relocation import relocate

__all__ = ["STEPS", "density_source", "relocate_file"]

STEPS = ("read", "relocate", "write")


def density_source(text: str) -> tuple[Path, str]:
    """File and field of ``FIELD.vtu:name``.

    Raises
    ------
    ValueError
        If it is none.
    """
    file, found, name = text.partition(".vtu:")
    if not (file and found and name):
        raise ValueError(f"--density expected FIELD.vtu:name, a file and a field of it; got '{text}'.")
    return Path(f"{file}.vtu"), name


def relocate_file(
    source: Path,
    density: tuple[Path, str],
    target: Path,
    *,
    topology: str = "flip",
    min_quality: float = 0.3,
    pinned: Sequence[int | str] = (),
    seed: int = 0,
    periodic: Sequence[tuple[str, str]] = (),
    layers: Mapping[str, int] | None = None,
    progress: Callable[[int, str], Any] = lambda number, step: None,
) -> tuple[MeshTri, MeshTri]:
    """Read a mesh and a density on it, relocate, and write the mesh in the unit it came in.

    Parameters
    ----------
    source, target
        Mesh files.
    density
        VTU file and name of a field, per element or per node.
    topology, min_quality, pinned, seed, periodic, layers
        As `relocate` takes them.
    progress
        Called with number and name of each of the `STEPS` when it begins.

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
    progress(0, STEPS[0])
    mesh = read_mesh(source)
    wanted = read_field(*density, mesh)
    progress(1, STEPS[1])
    after = relocate(
        mesh,
        wanted,
        topology=topology,
        min_quality=min_quality,
        pinned=pinned,
        seed=seed,
        periodic=periodic,
        layers=layers,
    )
    progress(2, STEPS[2])
    write_mesh(target, after)
    return mesh, after
