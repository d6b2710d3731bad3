"""The materials of a case: a table of keys to a `Material`, its curve from points, from a file or by a law."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from kohonen_adapt.cases.kinds import Kind, about, checked, choice, number, table, text, vector
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Law, Material, Table, read_bh

__all__ = ["material_in"]

LAWS: dict[str, tuple[Callable[..., Law], dict[str, Kind]]] = {
    "brauer": (Brauer, {"k1": number(least=0.0), "k2": number(above=0.0), "k3": number(above=0.0)}),
    "froehlich": (Froehlich, {"permeability": number(above=1.0), "saturation": number(above=0.0)}),
    "arctan": (Arctan, {"permeability": number(above=1.0), "saturation": number(above=0.0)}),
}
"""Name of a law to its class and what its parameters may be."""


def material_in(folder: Path) -> Kind:
    """What a table under ``materials`` may hold; files of curves are sought from the folder."""
    kinds: dict[str, Kind] = {
        "permeability": number(above=0.0),
        "remanence": vector,
        "coercivity": vector,
        "current_density": number(),
        "bh": lambda given, place: _law(given, place, folder),
    }

    def check(given: Any, place: str) -> Material:
        return _made(place, Material, checked(given, kinds, place))

    return check


def _law(given: Any, place: str, folder: Path) -> Law:
    if isinstance(given, list):
        return _made(place, Table, {"points": [list(vector(row, f"{place}[{k}]")) for k, row in enumerate(given)]})
    if isinstance(given, str):
        return _read(folder / text(given, place), place)
    if not isinstance(given, dict):
        raise ValueError(
            f'{place} must be a list of [B, H], the name of a file, or a law as {{law = "brauer", ...}}; got {given!r}.'
        )
    entries = table(given, place)
    name = choice(*LAWS)(entries.pop("law", None), f"{place}.law")
    law, kinds = LAWS[name]
    return _made(place, law, checked(entries, kinds, place, required=tuple(kinds)))


def _read(path: Path, place: str) -> Table:
    # Nothing but a plain file: a device or a pipe would never end.
    try:
        if path.is_file():
            return read_bh(path)
    except (OSError, ValueError) as error:
        raise ValueError(f"{place}: {error}") from None
    raise ValueError(f"{place} must name a file with a table of B and H; there is none at '{path}'.")


def _made(place: str, kind: Callable[..., Any], values: dict[str, Any]) -> Any:
    with about(place):
        try:
            return kind(**values)
        except (ArithmeticError, RuntimeError) as error:  # extreme parameters overflow, or end no iteration
            raise ValueError(str(error)) from None
