"""Number physical groups as other programs know them; a `MeshTri` has names only, and none for single points."""

import logging
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import DIMENSION, LARGEST_TAG, LINE, POINT, TETRAHEDRON, TRIANGLE, Content
from kohonen_adapt.mesh.host import is_own_name

__all__ = ["UNNAMED", "Groups", "by_group", "name_of", "numbers_for", "to_groups"]

logger = logging.getLogger("kohonen_adapt")

UNNAMED = {2: ("point_{}", "boundary_{}", "region_{}"), 3: ("point_{}", "curve_{}", "boundary_{}", "region_{}")}
"""Dimension of a mesh to what a group of each dimension is called where it has no name."""

GROUPED = {2: (POINT, LINE, TRIANGLE), 3: (POINT, TRIANGLE, TETRAHEDRON)}
"""Dimension of a mesh to the shapes whose groups it has a place for."""

SAME = 1e-9  # of the size of the mesh: nodes nearer than that are in the same place


@dataclass(frozen=True)
class Groups:
    """The physical groups of a Gmsh file.

    Attributes
    ----------
    names
        (dimension, number) to the name that the mesh has for the group: dimension 2 for ``subdomains``, 1 for
        ``boundaries``, of a solid 3 and 2, and 0 for points.
    points
        Number to the coordinates (2, n) of the nodes in a group of points, of a solid (3, n).
    version
        Of MSH, "2.2" or "4.1", in which `write_mesh` writes ``.msh``; empty for the newest.
    """

    names: Mapping[tuple[int, int], str] = field(default_factory=dict)
    points: Mapping[int, Floats] = field(default_factory=dict)
    version: str = ""

    @property
    def places(self) -> dict[str, Floats]:
        """Name to the coordinates (2, n) of a group of points, as `Magnetostatics` takes them for its ``points``.

        What is the name of a boundary, too, means that.
        """
        known = {(dimension, name) for (dimension, _), name in self.names.items()}
        found = {self.names[0, number]: x for number, x in self.points.items() if x.size}
        return {name: x for name, x in found.items() if (len(x) - 1, name) not in known}

    def nodes(self, mesh: MeshTri) -> dict[int, Ints]:
        """Nodes of the mesh where the groups of points are, by number; what has no node is left out.

        Parameters
        ----------
        mesh
            A mesh in the unit of the groups.
        """
        if not self.points:
            return {}
        corners = mesh.p[:, : mesh.nvertices]
        tree, size = cKDTree(corners.T), np.ptp(corners, axis=1).max()
        found = {number: tree.query(points.T) for number, points in sorted(self.points.items())}
        return {number: np.unique(node[off <= SAME * size]) for number, (off, node) in found.items()}

    def held(self, mesh: MeshTri) -> list[int]:
        """Nodes of the mesh in any group of points, which others find by their place: what must be pinned.

        Parameters
        ----------
        mesh
            A mesh in the unit of the groups.

        Returns
        -------
        list of int
            As `relocate` and `adapt` take them for `pinned`.
        """
        return sorted({int(node) for nodes in self.nodes(mesh).values() for node in nodes})


def name_of(content: Content, dimension: int, number: int) -> str:
    """The name of a group of a file."""
    return content.names.get((dimension, number)) or UNNAMED[content.dimension][dimension].format(number)


def to_groups(content: Content, path: Path, scale: float) -> Groups:
    """The groups that a file, `path`, has, whether or not anything of the mesh is in them."""
    dimensions = {DIMENSION[shape]: shape for shape in GROUPED[content.dimension]}
    keys = {key for key in content.names if key[0] in dimensions}
    for dimension, shape in dimensions.items():
        keys |= {(dimension, tag) for tag in np.unique(content.of_shape(shape).group).tolist() if tag > 0}
    names = {key: name for key in sorted(keys) if is_own_name(name := name_of(content, *key))}
    _report_shared(names, path)
    rows = content.of_shape(POINT)
    members = by_group(rows.group, rows.nodes[:, 0])
    nowhere = np.empty(0, np.int64)
    nodes = {number: members.get(number, nowhere) for dimension, number in names if dimension == 0}
    points = {number: scale * content.points[each, : content.dimension].T for number, each in nodes.items()}
    return Groups(names, points, content.version)


def by_group(group: Ints, item: Ints) -> dict[int, Ints]:
    """Items by the number of their group, in order; row k says that `item[k]` is in `group[k]`, 0 for none."""
    order = np.argsort(group, kind="stable")
    numbers, start = np.unique(group[order], return_index=True)
    parts = np.split(item[order], start[1:])
    return {number: part for number, part in zip(numbers.tolist(), parts, strict=False) if number > 0}


def _report_shared(names: Mapping[tuple[int, int], str], path: Path) -> None:
    first: dict[tuple[int, str], int] = {}
    for (dimension, number), name in names.items():
        kept = first.setdefault((dimension, name), number)
        if kept != number and dimension > 0:
            logger.warning(
                "groups %d and %d of '%s' have the name '%s' in common and become one, of number %d; give them two "
                "names to keep them apart.",
                *(kept, number, path, name, kept),
            )


def numbers_for(sets: Mapping[int, Iterable[str]], groups: Groups) -> dict[tuple[int, str], int]:
    """A number for every group by (dimension, name), no two of a dimension alike; `sets` are the names by dimension.

    The greatest dimension is that of the mesh. A number is the one in `groups`, else the one in a name such as
    ``region_7``, else a new one. New ones differ from all others, for readers that overlook the dimension of a group. A
    number in `groups` that is no positive integer is a ValueError.
    """
    known = _known(groups)
    keys = [(dimension, name) for dimension, names in sets.items() for name in names]
    numbers = {key: known[key] for key in keys if key in known}
    used = {(dimension, number) for (dimension, _), number in numbers.items()}
    for dimension, name in keys:
        number = _number_in(name, UNNAMED[max(sets)][dimension])
        if (dimension, name) not in numbers and number and (dimension, number) not in used:
            numbers[dimension, name] = number
    taken = {*numbers.values(), *(number for _, number in groups.names)}
    free = (number for number in count(1) if number not in taken)
    return {key: numbers[key] if key in numbers else next(free) for key in keys}


def _known(groups: Groups) -> dict[tuple[int, str], int]:
    known: dict[tuple[int, str], int] = {}
    for (dimension, number), name in groups.names.items():
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or not 0 < number <= LARGEST_TAG:
            raise ValueError(f"numbers of groups must be integers from 1 to {LARGEST_TAG}; '{name}' has {number!r}.")
        known.setdefault((dimension, name), int(number))
    return known


def _number_in(name: str, unnamed: str) -> int | None:
    """The number of a group that has no other name: 7 for ``region_7``."""
    found = re.fullmatch(unnamed.format("([1-9][0-9]{0,9})"), name)
    number = int(found[1]) if found else 0
    return number if 0 < number <= LARGEST_TAG else None
