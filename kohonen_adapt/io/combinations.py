"""Which combination of names every element or facet carries."""

from collections.abc import Sequence

import numpy as np

from ..triangulation import codes_of_names
from .content import Ints

__all__ = ["combinations"]


def combinations(sets: Sequence[Ints], count: int) -> tuple[Ints, list[Ints]]:
    """Number the distinct combinations of sets that items are in.

    Parameters
    ----------
    sets
        Items of every set, without repetition.
    count
        How many items there are.

    Returns
    -------
    ndarray (count,)
        Number of the combination of every item, from 0, in the order of the sets; no set at all comes first.
    list of ndarray
        Which sets make every combination.
    """
    codes = codes_of_names([(items, 0) for items in sets], count)
    _, example, combination = np.unique(codes, return_index=True, return_inverse=True)
    within = np.array([np.isin(example, items) for items in sets], dtype=bool).reshape(len(sets), len(example))
    members = [np.flatnonzero(column) for column in within.T]
    order = sorted(range(len(members)), key=lambda number: members[number].tolist())
    return np.argsort(order)[combination], [members[number] for number in order]
