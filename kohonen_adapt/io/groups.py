"""Numbers and names of the physical groups of mesh files."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, grouped
from kohonen_adapt.io.content import DIMENSION, LARGEST_TAG, LINE, POINT, TETRAHEDRON, TRIANGLE, Content, union
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.host import is_own_name

__all__ = ["UNNAMED", "Groups", "by_group", "name_of", "numbers_for", "to_groups"]


UNNAMED = {2: ("point_{}", "boundary_{}", "region_{}"), 3: ("point_{}", "curve_{}", "boundary_{}", "region_{}")}
"""Dimension of a mesh to the default names of groups of dimension 0, 1, ..."""

GROUPED = {2: (POINT, LINE, TRIANGLE), 3: (POINT, TRIANGLE, TETRAHEDRON)}
"""Dimension of a mesh to the shapes whose groups are read."""

SAME = 1e-9  # tolerance for equal positions, relative to the size of the mesh


GroupNumbers = dict[tuple[int, str], int]
"""Dimension and name of a group to its number."""


@dataclass(frozen=True)
class Groups:
    """Physical groups of a Gmsh file.

    Attributes
    ----------
    names
        (dimension, number) to the name of the group in the mesh: dimension 2 for ``subdomains``, 1 for ``boundaries``,
        of a solid 3 and 2, and 0 for points.
    points
        Number to the coordinates (2, n) of the nodes in a group of points, of a solid (3, n).
    version
        Version of MSH, "2.2" or "4.1", in which `write_mesh` writes ``.msh``; empty for the newest.
    """

    names: Mapping[tuple[int, int], str] = field(default_factory=dict)
    points: Mapping[int, Floats] = field(default_factory=dict)
    version: str = ""

    @property
    def places(self) -> dict[str, Floats]:
        """Coordinates (2, n) of the groups of points by name.

        Valid as ``points`` of `Magnetostatics`. Names that boundaries have, too, are left out, because they stand for
        the boundary.
        """
        known = {(dimension, name) for (dimension, _), name in self.names.items()}
        found = {self.names[0, number]: x for number, x in self.points.items() if x.size}
        return {name: x for name, x in found.items() if (len(x) - 1, name) not in known}

    def nodes(self, mesh: MeshTri) -> dict[int, Ints]:
        """Return the nodes of the mesh at the groups of points, by number.

        Parameters
        ----------
        mesh
            A mesh in the unit of the groups.

        Returns
        -------
        dict
            Number of the group to its nodes; points without a node are left out.
        """
        if not self.points:
            return {}
        corners = mesh.p[:, : mesh.nvertices]
        tree, size = cKDTree(corners.T), np.ptp(corners, axis=1).max()
        found = {number: tree.query(points.T) for number, points in sorted(self.points.items())}
        return {number: np.unique(node[off <= SAME * size]) for number, (off, node) in found.items()}

    def held(self, mesh: MeshTri) -> list[int]:
        """Return the nodes of the mesh in any group of points, which must be pinned.

        Other programs find these nodes by their position.

        Parameters
        ----------
        mesh
            A mesh in the unit of the groups.

        Returns
        -------
        list of int
            Valid as ``pinned`` of `relocate` and `adapt`.
        """
        return union(self.nodes(mesh).values()).tolist()


def name_of(content: Content, dimension: int, number: int) -> str:
    return content.names.get((dimension, number)) or UNNAMED[content.dimension][dimension].format(number)


def to_groups(content: Content, path: Path, scale: float) -> Groups:
    dimensions = {DIMENSION[shape]: shape for shape in GROUPED[content.dimension]}
    keys = {key for key in content.names if key[0] in dimensions}
    for dimension, shape in dimensions.items():
        keys |= {(dimension, tag) for tag in np.unique(content.of_shape(shape).group).tolist() if tag > 0}
    names = {key: name for key in sorted(keys) if is_own_name(name := name_of(content, *key))}
    first: GroupNumbers = {}
    for (dimension, number), name in names.items():
        kept = first.setdefault((dimension, name), number)
        if kept != number and dimension > 0:
            logger.warning(
                "groups %d and %d of '%s' have the same name '%s' and are merged into group %d; give them different "
                "names to keep both.",
                *(kept, number, path, name, kept),
            )
    rows = content.of_shape(POINT)
    members = by_group(rows.group, rows.nodes[:, 0])
    nowhere = np.empty(0, int)
    nodes = {number: members.get(number, nowhere) for dimension, number in names if dimension == 0}
    points = {number: scale * content.points[each, : content.dimension].T for number, each in nodes.items()}
    return Groups(names, points, content.version)


def by_group(group: Ints, item: Ints) -> dict[int, Ints]:
    return {int(group[rows[0]]): item[rows] for rows in grouped(group) if group[rows[0]] > 0}


def numbers_for(sets: Mapping[int, Iterable[str]], groups: Groups) -> GroupNumbers:
    """Return a number for every group by (dimension, name), unique per dimension.

    The number is that in `groups`, else that in a name such as ``region_7``, else a new one. New numbers differ from
    all others, for readers that ignore the dimension of a group.

    Parameters
    ----------
    sets
        Names by dimension; the largest dimension is that of the mesh.
    groups
        Groups with known numbers.

    Raises
    ------
    ValueError
        If a number in `groups` is not a positive integer.
    """
    known = _known(groups)
    keys = [(dimension, name) for dimension, names in sets.items() for name in names]
    numbers = {key: known[key] for key in keys if key in known}
    used = {(dimension, number) for (dimension, _), number in numbers.items()}
    for dimension, name in keys:
        found = re.fullmatch(UNNAMED[max(sets)][dimension].format("([1-9][0-9]{0,9})"), name)
        number = int(found[1]) if found else 0
        if (dimension, name) not in numbers and 0 < number <= LARGEST_TAG and (dimension, number) not in used:
            numbers[dimension, name] = number
    taken = {*numbers.values(), *(number for _, number in groups.names)}
    free = (number for number in count(1) if number not in taken)
    return {key: numbers[key] if key in numbers else next(free) for key in keys}


def _known(groups: Groups) -> GroupNumbers:
    known: GroupNumbers = {}
    for (dimension, number), name in groups.names.items():
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or not 0 < number <= LARGEST_TAG:
            raise ValueError(f"numbers of groups must be integers from 1 to {LARGEST_TAG}; '{name}' has {number!r}.")
        known.setdefault((dimension, name), int(number))
    return known
