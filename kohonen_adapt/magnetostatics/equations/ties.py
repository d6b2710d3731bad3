"""Join the unknowns of periodic and antiperiodic boundaries: classes that share a value up to its sign."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import Elements
from kohonen_adapt.outline.pairs import image_nodes

__all__ = ["Ties", "ties_of"]

Names = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Ties:
    """``u[i] = sign[i] u[master[i]]``.

    Attributes
    ----------
    master
        (nunknowns,): one for each class of unknowns that are one; most are their own.
    sign
        (nunknowns,) 1.0 or -1.0.
    zero
        (nunknowns,) bool: those of classes that hold their own negative, so that u = 0 there.
    one, other, between
        Unknowns that are one, (k,) each, and the sign between them, (k,): 1.0 for periodic, -1.0 for antiperiodic.
    facets
        Facets that are one, and the sign between them: three arrays (f,).
    """

    master: Ints
    sign: Floats
    zero: Mask
    one: Ints
    other: Ints
    between: Floats
    facets: tuple[Ints, Ints, Floats]


def ties_of(elements: Elements, periodic: Names, antiperiodic: Names) -> Ties:
    """Join the unknowns of every pair of boundaries, and those that several pairs join, as the corners of a cell.

    Raises
    ------
    ValueError
        If a name is no boundary, or the nodes of a pair do not match.
    """
    mesh, names = elements.mesh, [*periodic, *antiperiodic]
    try:
        found = image_nodes(mesh, names)
    except ValueError as error:
        raise ValueError(f"{error} In kohonen_adapt.adapt: name the pair as periodic, too, or pin both.") from None
    signs = np.repeat([1.0, -1.0], [len(periodic), len(antiperiodic)])
    facets = [np.asarray(mesh.boundaries[name]) for name, _ in names]
    images = [_image_facets(mesh, rows, *nodes) for rows, nodes in zip(facets, found, strict=True)]
    along = np.concatenate(facets), np.concatenate(images), np.repeat(signs, [len(rows) for rows in facets])
    inside, beyond = (elements.on_facets(rows)[2:].ravel() for rows in along[:2])
    one = np.concatenate([*(nodes for nodes, _ in found), inside])
    other = np.concatenate([*(images for _, images in found), beyond])
    between = np.append(np.repeat(signs, [len(nodes) for nodes, _ in found]), along[2][: inside.size])
    return Ties(*_classes(elements.places.shape[1], one, other, between), one, other, between, along)


def _classes(count: int, one: Ints, other: Ints, between: Floats) -> tuple[Ints, Floats, Mask]:
    """`master`, `sign` and `zero` of `Ties`."""
    master, sign = np.arange(count), np.ones(count)
    while True:
        before = master.copy()
        for a, b in ((one, other), (other, one)):
            lower = master[b] < master[a]
            master[a[lower]], sign[a[lower]] = master[b[lower]], (between * sign[b])[lower]
        if np.array_equal(master, before):
            break
    zero = np.zeros(count, dtype=bool)
    zero[master[one[sign[one] != between * sign[other]]]] = True
    return master, sign, zero[master]


def _image_facets(mesh: MeshTri, facets: Ints, nodes: Ints, images: Ints) -> Ints:
    """The facets between the images of the ends of these facets."""
    count = mesh.p.shape[1]
    image = np.arange(count)
    image[nodes] = images
    ends = np.sort(image[mesh.facets[:, facets]], axis=0).astype(np.int64)
    first, second = np.sort(mesh.facets, axis=0).astype(np.int64)
    key = first * count + second
    order = np.argsort(key)
    return order[np.searchsorted(key[order], ends[0] * count + ends[1])]
