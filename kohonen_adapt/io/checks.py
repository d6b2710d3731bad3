"""What `write_mesh` accepts beside the mesh: names that a file can carry, finite fields of the right shape."""

import logging
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["checked_fields", "checked_sets"]

logger = logging.getLogger(__name__)

LONGEST_NAME = 127
"""Bytes of a name that Gmsh reads."""


def checked_sets(sets: Mapping[str, Ints] | None, kind: str) -> dict[str, Ints]:
    """Named sets of elements or facets, sorted and without repetition; what scikit-fem calls ``gmsh:*`` is left out.

    Parameters
    ----------
    sets
        Indices by name, or None.
    kind
        "subdomain" or "boundary", for messages.

    Raises
    ------
    ValueError
        If a name cannot be stored.
    """
    checked: dict[str, Ints] = {}
    for name, indices in (sets or {}).items():
        _check_name(name, kind)
        if name.startswith("gmsh:"):
            continue
        items = np.unique(np.asarray(indices, dtype=np.int64))
        if len(items) == 0:
            logger.warning("%s '%s' is empty: Gmsh will not show it.", kind, name)
        checked[name] = items
    return checked


def checked_fields(
    fields: Mapping[str, ArrayLike] | None, count: int, kind: str, *, vectors: bool
) -> dict[str, Floats]:
    """Fields by name as float arrays (count,), or (2, count) where `vectors` allows it.

    Raises
    ------
    ValueError
        If a name cannot be stored, a shape is another, or a value is not finite.
    """
    expected = f"({count},) or (2, {count})" if vectors else f"({count},)"
    checked = {}
    for name, values in (fields or {}).items():
        _check_name(name, kind)
        array = np.asarray(values, dtype=float)
        if array.shape != (count,) and not (vectors and array.shape == (2, count)):
            raise ValueError(f"{kind} '{name}' must have shape {expected}; got {array.shape}.")
        if not np.all(np.isfinite(array)):
            number = np.sum(~np.isfinite(array))
            raise ValueError(f"{kind} '{name}' must be finite; {number} of its {array.size} values are not.")
        checked[name] = array
    return checked


def _check_name(name: object, kind: str) -> None:
    if not isinstance(name, str) or not name or not name.isprintable() or '"' in name:
        raise ValueError(
            f"the name of a {kind} must be printable text without a double quote, which Gmsh cannot read; got {name!r}."
        )
    if len(name.encode()) > LONGEST_NAME:
        raise ValueError(f"the name of a {kind} may have {LONGEST_NAME} bytes, more Gmsh cuts off; got {name!r}.")
