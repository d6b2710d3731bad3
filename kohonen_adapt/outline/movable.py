"""Take a mesh apart into what moves: its triangulation, and its outlines, layers and quality rule, which hold nodes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import check_state
from kohonen_adapt.kernels.arrays import HELD, JUNCTION, Constraints, Elements, Neurons
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.flip import flip_edges, mark_doubtful
from kohonen_adapt.mesh.curved import facet_displacements, is_second_order, with_displacements
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.facets import facet_of_edge
from kohonen_adapt.outline.isoparametric import bent_sides
from kohonen_adapt.outline.layers import lay
from kohonen_adapt.outline.outline import Outline
from kohonen_adapt.outline.rules import Rules, check_for, floor_of

__all__ = ["BY_ELEMENT", "STATE_NAMES", "MovableMesh", "Work", "shown", "with_state"]

FLIPS = 2_000_000  # per compiled call: Python hears Ctrl-C at least every half second

# The arrays that change when nodes move: (m, ...) by element, the others (n, ...) by node.
BY_ELEMENT = ("elements.node", "elements.neighbour", "elements.region", "elements.chain")
STATE_NAMES = (
    *("position", "pinned", *BY_ELEMENT, "elements.level", "twins.partner", "twins.motion"),
    *("constraints.kind", "constraints.chain", "constraints.parameter", "constraints.inner"),
)


def shown(title: str, form: str) -> dict[str, str]:
    """Metadata of a field that is a column in tables of passes, with this title and format."""
    return {"title": title, "form": form}


@dataclass(frozen=True, kw_only=True)
class Work:
    """The figures of moving a mesh; `Pass` has them, and says what they are, of the relocation that made its mesh."""

    quantization_errors: tuple[float, ...] = field(default=(), repr=False)
    max_displacement: float = 0.0
    moved: int = 0
    why_still: str = ""
    polish_gain: float = field(default=0.0, metadata=shown("gain of polish", ".2g"))
    splits: int = field(default=0, metadata=shown("splits", "d"))
    collapses: int = field(default=0, metadata=shown("collapses", "d"))


@dataclass
class MovableMesh:
    """A mesh with where its nodes may go; map, recycling, transport and polish each change it in place.

    Attributes
    ----------
    triangulation
        Nodes and elements, with the levels that keep layers.
    outline
        What the outlines allow every node, and the names that they carry.
    floor
        The quality that no change may leave anything below, unless it was there before.
    flips
        Whether edges may flip.
    curved
        Whether it is given back with bent sides, as a `MeshTri2`: that is wanted, and some outline is curved.
    """

    triangulation: Triangulation
    outline: Outline
    floor: float
    flips: bool
    curved: bool = False

    @classmethod
    def of(cls, mesh: MeshTri, rules: Rules, curved: bool | None = None) -> "MovableMesh":
        """Take a mesh apart, which is not modified; refused unless valid and with all that the rules name.

        Bent sides are wanted back if `curved`, and with None if the mesh is a `MeshTri2`. Of that its corners move; its
        bent outlines are curves: those given, arcs, or splines through corners and mid-side nodes. Sides that are bent
        on no outline become straight.
        """
        check_for(rules, 2)
        triangulation = Triangulation.of(mesh)
        second_order = is_second_order(mesh)
        outline = Outline.of(triangulation, rules, facet_displacements(mesh) if second_order else None)
        lay(triangulation, outline.constraints, rules.layers)
        floor = floor_of(rules, 2)
        bends = (second_order if curved is None else curved) and not outline.straight.all()
        return cls(triangulation, outline, floor, rules.flips, bends)

    @property
    def nnodes(self) -> int:
        """Number of nodes."""
        return self.triangulation.nnodes

    @property
    def constraints(self) -> Constraints:
        """What the outlines allow every node, for the kernels."""
        return self.outline.constraints

    @property
    def tessellation(self) -> Triangulation:
        """Nodes and elements, by the name that those of all kinds of movable meshes have."""
        return self.triangulation

    def neurons(self) -> Neurons:
        """The mesh as loops that train it take it."""
        tri = self.triangulation
        return Neurons(tri.position, tri.elements, tri.star, self.constraints)

    @property
    def came_from(self) -> MeshTri:
        """The mesh that was taken apart, of a `MeshTri2` its corners."""
        return self.triangulation.mesh

    def mesh(self) -> MeshTri:
        """The mesh as it is now, with every name it came with; a `MeshTri2` where it is `curved`."""
        mesh = self.outline.with_boundaries(self.triangulation.to_mesh(), self.triangulation)
        if not self.curved:
            return mesh
        facet, off = facet_of_edge(mesh, self.triangulation.elements.node), np.zeros((2, mesh.facets.shape[1]))
        off[:, facet] = np.moveaxis(self.bent_sides(), 2, 0)
        return with_displacements(mesh, off)

    def start(self) -> MeshTri:
        """The mesh to start from, before anything has moved: the one it came from, bent where it is to be `curved`."""
        return self.mesh() if self.curved else self.came_from

    def bent_sides(self) -> Floats:
        """How far the mid-side nodes of all sides are off their chords, (m, 3, 2), as `isoparametric` says.

        Rows are those of ``triangulation.elements``, and side k is opposite to corner k. 0 where it is not `curved`.
        """
        if not self.curved:
            return np.zeros((*self.triangulation.elements.node.shape, 2))
        return bent_sides(self.triangulation, self.constraints)

    def copy(self) -> "MovableMesh":
        """The mesh as it is now, which later changes leave alone."""
        return replace(self, triangulation=self.triangulation.copy(), outline=self.outline.copy())

    def state(self) -> dict[str, NDArray[Any]]:
        """All that changes when nodes move, by name: with the mesh it came from and the rules this is the whole."""
        records = {
            "elements": self.triangulation.elements,
            "constraints": self.constraints,
            "twins": self.constraints.twins,
        }
        named = {name: name.split(".") for name in STATE_NAMES if "." in name}
        arrays = {name: getattr(records[record], array) for name, (record, array) in named.items()}
        return {"position": self.triangulation.position, "pinned": self.outline.pinned, **arrays}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Become the mesh whose `state` that was; it came from the same mesh by the same rules.

        What cannot be the state of such a mesh is refused, and nothing changed.
        """
        self._check_state(state)
        self.become({name: state[name].copy() for name in STATE_NAMES})

    def become(self, own: Mapping[str, NDArray[Any]]) -> None:
        """Take over the arrays of a state that needs no check."""
        tri = self.triangulation
        elements, self.outline.constraints = with_state(tri.elements, self.constraints, own)
        tri.become(own["position"], elements)
        self.outline.pinned = own["pinned"]

    def _check_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Refuse arrays of other types and shapes, and numbers of what is not there."""
        n, m = (len(state.get(name, ())) for name in ("position", "elements.node"))
        chains, motions = len(self.constraints.chains.length), len(self.constraints.twins.motions)
        numbers = {
            "elements.node": (0, n),
            "elements.neighbour": (-1, m),
            "elements.region": (0, len(self.triangulation.elements.layered)),
            "elements.chain": (-1, chains),
            "constraints.chain": (JUNCTION, chains),
            "twins.partner": (-1, n),
            "twins.motion": (-1, motions),
        }
        rows = {name: m if name in BY_ELEMENT else n for name in STATE_NAMES}
        check_state(self.state(), state, rows, numbers)

    def settle(self) -> None:
        """Put the nodes that slide on curves exactly there, as far as the quality rule lets them."""
        self.outline.settle(self.triangulation, self.floor)

    def flip(self) -> int:
        """Make every region constrained Delaunay as far as the quality rule allows; returns the number of flips."""
        if not self.flips:
            return 0
        tri, m = self.triangulation, len(self.triangulation.elements.node)
        doubtful, stack, waiting = np.empty(m, dtype=np.bool_), np.empty(m, dtype=np.int32), np.zeros(m, dtype=np.bool_)

        def mark(thread: int, first: int, last: int) -> None:
            mark_doubtful(tri.position, tri.elements, first, last, doubtful)

        total, flips = 0, FLIPS
        while flips >= FLIPS:
            shared(mark, even_cuts(m, LIGHT))
            flips = flip_edges(tri.position, tri.elements, self.floor, doubtful, stack, waiting, FLIPS)
            total += flips
            if flips:
                tri.refill_star()
        return total

    def sagitta(self) -> float:
        """How far at most a curve is from the facets on it, in mesh units; what lies between is no part of the mesh."""
        return self.outline.sagitta(self.triangulation)

    def can_move(self) -> bool:
        """Whether any node is free to move or to slide; a corner is only left to one that slides."""
        return bool(np.any(self.constraints.kind != HELD))


def with_state(
    elements: Elements, constraints: Constraints, state: Mapping[str, NDArray[Any]]
) -> tuple[Elements, Constraints]:
    """Elements and constraints with the arrays of a state in place of theirs."""

    def arrays(record: str) -> dict[str, Any]:
        return {name.removeprefix(record): array for name, array in state.items() if name.startswith(record)}

    twins = constraints.twins._replace(**arrays("twins."))
    return elements._replace(**arrays("elements.")), constraints._replace(twins=twins, **arrays("constraints."))
