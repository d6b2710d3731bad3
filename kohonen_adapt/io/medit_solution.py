"""Solutions of Medit and Mmg at the vertices of a mesh."""

import re
from pathlib import Path

import numpy as np
from skfem import Mesh

from kohonen_adapt.io.content import EXACT_INTEGERS, CellFields, Field, as_value_error, in_space, parse_numbers
from kohonen_adapt.io.meshio_reader import read_arrays
from kohonen_adapt.mesh.cells import cell_of

__all__ = ["SOLUTION", "read_solution"]

SOLUTION = ".sol"
BESIDE = ".mesh"  # suffix of the mesh of a solution

KEYWORD = re.compile(rb"\b(MeshVersionFormatted|Dimension|SolAt[A-Za-z]+|End)\b")
COMMENT = re.compile(rb"#[^\n]*")

# Symmetric tensors are stored by rows of the lower triangle.
LOWER = {2: (0, 1, 1, 2), 3: (0, 1, 3, 1, 2, 4, 3, 4, 5)}


def read_solution(path: Path, mesh: Mesh) -> CellFields:
    """Return the solutions of a text file, called "solution 1", "solution 2", ...

    Their nodes are those of the Medit mesh of the same name in the folder, or else those of `mesh`.
    """
    with as_value_error(
        path, f"read_field expected a solution of Medit or Mmg as text; '{path}' cannot be read: {{}}."
    ):
        fields = _fields(path.read_bytes())
    count, beside = len(fields[0].values), path.with_suffix(BESIDE)
    if beside.is_file():
        content, owner = read_arrays(beside, cell_of(mesh).name), f"vertices of '{beside}'"
    else:
        content, owner = CellFields(in_space(mesh.p.T), mesh.t.T, []), "nodes of the mesh, in their order"
    if len(content.points) != count:
        raise ValueError(
            f"read_field expected a solution at the {len(content.points)} {owner}; '{path}' has {count} vertices. Put "
            f"the mesh of the solution beside it, as '{beside.name}', and read the mesh from this file."
        )
    return CellFields(content.points, content.cells, fields)


def _fields(data: bytes) -> list[Field]:
    _, *parts = KEYWORD.split(COMMENT.sub(b"", data))
    sections = dict(zip(parts[::2], parts[1::2], strict=True))
    missing = [word for word in (b"MeshVersionFormatted", b"Dimension", b"SolAtVertices") if word not in sections]
    if missing:
        others = [word.decode() for word in sections if word.startswith(b"SolAt")]
        raise ValueError(f"{missing[0].decode()} is missing{f', its values are {others[0]}' if others else ''}")
    dim = int(parse_numbers(sections[b"Dimension"])[0])
    if dim not in LOWER:
        raise ValueError(f"its dimension is {dim}")
    numbers = parse_numbers(sections[b"SolAtVertices"])
    if len(numbers) < 2 or not np.all(np.abs(numbers[:2]) < EXACT_INTEGERS):
        raise ValueError("its number of vertices or of solutions is missing")
    count, solutions = numbers[:2].astype(int)
    kinds, values = numbers[2 : 2 + solutions].astype(int), numbers[2 + solutions :]
    width = {1: 1, 2: dim, 3: dim * (dim + 1) // 2, 4: dim**2}
    widths = [width.get(kind, 0) for kind in kinds.tolist()]
    if 0 in widths:
        raise ValueError(f"its solutions have the types {kinds.tolist()}; 1 to 4 are known")
    if not widths or len(values) != count * sum(widths):
        raise ValueError(f"it announces {count * sum(widths)} values at {count} vertices and has {len(values)}")
    columns = np.split(values.reshape(count, -1), np.cumsum(widths)[:-1], axis=1)
    full = [own[:, LOWER[dim]] if kind == 3 else own for kind, own in zip(kinds, columns, strict=True)]
    return [Field(f"solution {k}", True, own) for k, own in enumerate(full, 1)]
