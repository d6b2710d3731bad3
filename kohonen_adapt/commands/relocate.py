"""Relocation of the nodes of a mesh file by a field file, for any solver."""

import argparse
import re
from collections import ChainMap
from collections.abc import Callable
from typing import Any

from skfem import MeshTri

from kohonen_adapt.arrays import Array
from kohonen_adapt.commands.arguments import writable_folder
from kohonen_adapt.commands.terminal import Terminal
from kohonen_adapt.files import remove_drafts
from kohonen_adapt.io import (
    FIELD_SUFFIXES,
    WRITTEN,
    check_names_written,
    read_field,
    read_groups,
    read_mesh,
    write_mesh,
)
from kohonen_adapt.loop.single_steps import relocate
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.som.density import density_from_indicators, density_from_sizes

__all__ = ["relocate_file"]


MEANINGS: dict[str, Callable[[MeshTri, Array], Array]] = {
    "density": lambda mesh, values: values,
    "indicators": density_from_indicators,
    "sizes": density_from_sizes,
}
"""Meaning of a field to its conversion to a density."""

# The binary form of a .sol file is refused by `read_field`, with the remedy.
SOURCE = re.compile(
    rf"(.+?(?:{'|'.join(map(re.escape, (*FIELD_SUFFIXES, '.solb')))}))(?::(.+))?", re.IGNORECASE | re.DOTALL
)


def relocate_file(arguments: argparse.Namespace, terminal: Terminal) -> int:
    out = arguments.out
    remove_drafts(writable_folder(out.parent))
    meaning, text = next((key, text) for key in MEANINGS if (text := getattr(arguments, key)) is not None)
    if not (source := SOURCE.fullmatch(text)):
        others = ", ".join(FIELD_SUFFIXES[1:])
        raise ValueError(
            f"--{meaning} expected FIELD.vtu:name, a file (.vtu, {others}) and the name of a field; got '{text}'."
        )
    if out.suffix.lower() not in (*WRITTEN, ""):
        raise ValueError(f"--out expected a file that ends in {', '.join(WRITTEN)}; got '{out.name}'.")
    terminal.show("read")
    mesh, groups = read_mesh(arguments.mesh), read_groups(arguments.mesh)
    check_names_written(mesh)
    density = MEANINGS[meaning](mesh, read_field(source[1], mesh, source[2], scale=arguments.scale))
    terminal.show("relocate")
    after = relocate(
        mesh,
        density,
        topology=arguments.topology,
        min_quality=arguments.min_quality,
        pinned=[*map(_number_or_name, arguments.pinned), *groups.held(mesh)],
        seed=arguments.seed,
        periodic=[(one, other) for one, other in arguments.periodic],
        layers={name: _number_or_name(count) for name, count in arguments.layers} or None,
        surfaces=dict(ChainMap(*arguments.surfaces)) or None,
    )
    terminal.show("write")
    write_mesh(out, after, groups=groups)
    worst = [f"{quality(each).min():.2f}" for each in (mesh, after)]
    terminal.say(f"Wrote {out}: {after.nvertices} nodes, worst quality {worst[1]}; before {worst[0]}.")
    return 0


def _number_or_name(word: str) -> Any:
    return int(word) if word.isdecimal() else word
