"""Time large mesh files, and measure the memory that they take, each in a process of its own."""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.table import aligned

_MESH = """
import sys, time, numpy as np, kohonen_adapt as ka
from skfem import MeshTet, MeshTri
dimension, kind = {"triangles": (2, MeshTri), "tetrahedra": (3, MeshTet)}[sys.argv[3]]
mesh = kind.init_tensor(*[np.linspace(0.0, 1.0, int(sys.argv[2]))] * dimension)
mesh = kind(mesh.p + 1e-5 * np.random.default_rng(0).random(mesh.p.shape), mesh.t)
mesh = mesh.with_subdomains({"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] >= 0.5})
mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
start = time.perf_counter()
ka.write_mesh(sys.argv[1], mesh)
print(time.perf_counter() - start)
"""
_READ = """
import resource, sys, time, kohonen_adapt as ka
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.perf_counter()
mesh = ka.read_mesh(sys.argv[1])
seconds = time.perf_counter() - start
print(seconds, 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / mesh.p.shape[1])
"""
_BINARY = """
import sys, gmsh
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[1])
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.option.setNumber("Mesh.MshFileVersion", float(sys.argv[3]))
gmsh.write(sys.argv[2])
"""


def report(seeds: Sequence[int], quick: bool) -> str:
    """One run each, on a square grid of 10^6 nodes and a cube of 10^6 tetrahedra; binary files are Gmsh's.

    Both have two subdomains and their rim.
    """
    rows = []
    for shape, sides in SIDES.items():
        with tempfile.TemporaryDirectory() as folder:
            rows += [_text(Path(folder, f"mesh{suffix}"), name, shape, sides[quick]) for name, suffix in TEXT.items()]
            rows += [_binary(Path(folder), version, shape, sides[quick]) for version in ("4.1", "2.2")]
    header = [
        "files: format",
        "of",
        "nodes",
        "MB",
        "write, s",
        "read, s",
        "read, MB/s",
        "peak of reading, bytes per node",
    ]
    return aligned(header, rows)


SIDES = {"triangles": (1000, 300), "tetrahedra": (56, 26)}
"""Nodes on a side of the grid, and of a quick one."""

TEXT = {"MSH 4.1 text": ".msh", "MSH 2.2 text": ".msh2", "VTU": ".vtu"}


def _text(path: Path, name: str, shape: str, side: int) -> list[str | int | float | None]:
    (seconds,) = _run(_MESH, path, side, shape)
    return _row(path, name, shape, side, seconds)


def _binary(folder: Path, version: str, shape: str, side: int) -> list[str | int | float | None]:
    path = folder / "binary.msh"
    _run(_BINARY, folder / "mesh.msh", path, version)
    return _row(path, f"MSH {version} binary", shape, side, None)


def _row(path: Path, name: str, shape: str, side: int, written: float | None) -> list[str | int | float | None]:
    read, peak = _run(_READ, path)
    size = path.stat().st_size / 1e6
    nodes = side ** (2 if shape == "triangles" else 3)
    return [name, shape, nodes, size, written, read, size / read, round(peak)]


def _run(code: str, *arguments: object) -> list[float]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return [float(word) for word in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()]
