"""Script that meshes a drawing by Gmsh.

Its arguments are ``DRAWING MESH [NAME VALUE ...]``.

Gmsh has a single state per process, and commands of a drawing can end the process, so it needs a process of its own.
"""

import sys
from collections.abc import Mapping
from difflib import get_close_matches

import gmsh

# With several threads, some algorithms of Gmsh are not reproducible.
THREADS = ("General.NumThreads", *(f"Mesh.MaxNumThreads{dimension}D" for dimension in (1, 2, 3)))

Numbers = dict[str, list[float]]


def main(drawing: str, mesh: str, *given: str) -> None:
    values = {name: float(value) for name, value in zip(given[::2], given[1::2], strict=True)}
    try:
        before = open_drawing(drawing, {})
        for name in values:
            if name not in before:
                near = get_close_matches(name, list(before), 1)
                hint = f"Did you mean {near[0]!r}?" if near else "Define it there: DefineConstant[ NAME = VALUE ];"
                raise SystemExit(f"the drawing has no parameter {name!r}. {hint}")
        if values:
            check_effect(drawing, values, before)
            open_drawing(drawing, values)
        dimension = gmsh.model.getDimension()
        if dimension < 2:
            raise SystemExit("the drawing has no surface to mesh.")
        for option in THREADS:
            gmsh.option.setNumber(option, 1)
        gmsh.model.mesh.generate(dimension)
        gmsh.write(mesh)
    except Exception as error:  # the type of errors of Gmsh
        raise SystemExit(f"Gmsh reports: {error}") from None


def open_drawing(drawing: str, values: Mapping[str, float]) -> Numbers:
    if gmsh.isInitialized():
        gmsh.finalize()
    options = [text for name, value in values.items() for text in ("-setnumber", name, repr(value))]
    gmsh.initialize(["gmsh", *options], readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(drawing)
    return {name: gmsh.parser.getNumber(name).tolist() for name in gmsh.parser.getNames()}


def check_effect(drawing: str, values: Mapping[str, float], before: Numbers) -> None:
    # Gmsh reports no error if the drawing assigns the constant again.
    after = open_drawing(drawing, values)
    doubtful = {name: value + 1.0 for name, value in values.items() if after[name] == before[name] != [value]}
    if not doubtful:
        return
    try:  # the drawing may scale a constant that was given its default value
        shifted = open_drawing(drawing, {**values, **doubtful})
    except Exception:  # an effect, too
        return
    for name in doubtful:
        if shifted[name] == after[name]:
            raise SystemExit(
                f"{name} has no effect, because the drawing sets {name}. Write DefineConstant[ {name} = ... ]; there."
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
