"""Settings of a case, completed from its mesh file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from weakref import finalize

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.cases.drawing import Drawing
from kohonen_adapt.cases.tables import Quantity
from kohonen_adapt.cases.turning import Turn, turned_materials
from kohonen_adapt.geometry.plane.curves import Arc, Line
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.io import Groups, read_groups, read_mesh
from kohonen_adapt.io.read import curves_in_file
from kohonen_adapt.loop.settings import PASSES, PASSES_TO_TOLERANCE
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.bodies import bores
from kohonen_adapt.magnetostatics.quantities.goals import Goal, VectorGoal
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.cells import TETRAHEDRON, check_kind
from kohonen_adapt.mesh.curved import corners_of, is_second_order
from kohonen_adapt.mesh.motions import Pair

__all__ = ["Case", "error_in_plane", "keys_of_space"]

SHARED = ("materials", "potential", "estimator", "goal", "order")
"""Arguments of a problem with the same meaning in the plane and in space."""

OF_THREE = " of three components"

TOLERANCES = ("rtol", "atol", "output_rtol", "goal_rtol")


@dataclass(frozen=True)
class Case:
    """Checked settings of a case.

    Attributes
    ----------
    mesh
        The mesh file, or a drawing of the mesh.
    scale
        Metres per unit of the mesh file.
    base_problem
        The problem without the mesh file; `problem` is completed from the file.
    adapt
        Arguments of `kohonen_adapt.adapt` by name.
    outputs
        Name to a function of the field.
    turn
        Subdomains that turn together to the angle, in degrees, of their rotation about the origin.
    rim
        Name for the whole rim of the mesh; empty if the file has names for the rim.
    bracket
        True to bound the energy of the result by both potentials in space.
    file, text
        Name and text of the TOML file; empty for a case without a file.
    """

    mesh: Path | Drawing
    scale: float
    base_problem: Magnetostatics | MagneticScalarPotential
    adapt: dict[str, Any]
    outputs: dict[str, Quantity]
    turn: Turn = field(default_factory=dict)
    rim: str = ""
    bracket: bool = False
    file: str = ""
    text: str = ""

    @cached_property
    def mesh_file(self) -> Path:
        """Mesh file, temporary if the mesh is drawn.

        Raises
        ------
        ValueError
            If the mesh cannot be drawn.
        """
        if isinstance(self.mesh, Path):
            return self.mesh
        folder = Path(mkdtemp(prefix="kohonen-adapt-"))
        finalize(self, rmtree, folder, ignore_errors=True)
        file = folder / f"{self.mesh.file.stem}.msh"
        self.mesh.write_mesh(file)
        return file

    @cached_property
    def groups(self) -> Groups:
        """Physical groups of the mesh file, in its unit.

        The file is read once, so it may be deleted after the mesh is read.

        Raises
        ------
        ValueError
            If the file is damaged.
        OSError
            If the file cannot be read.
        """
        return read_groups(self.mesh_file)

    @cached_property
    def problem(self) -> Magnetostatics | MagneticScalarPotential:
        """Problem of the case, completed from the mesh file.

        Points in the potential get their positions from the file, and magnets in turned subdomains are turned. On
        tetrahedra, a case that is also valid in the plane is a problem for the scalar potential.

        Raises
        ------
        ValueError
            If only a part of a magnet is turned, or the file is damaged.
        OSError
            If the file cannot be read.
        """
        problem = self.base_problem
        if isinstance(problem, Magnetostatics) and self.mesh_file.is_file() and type(self.drawn) is TETRAHEDRON.mesh:
            problem = _in_space(problem)
        if isinstance(problem, MagneticScalarPotential):  # bounds need straight facets
            return replace(problem, curved=False) if self.bracket else problem
        points = problem.points or {}
        wanted = (problem.potential or {}).keys() - points.keys()
        if wanted and self.mesh_file.is_file():
            found = {name: self.scale * places for name, places in self.groups.places.items() if name in wanted}
            problem = replace(problem, points={**points, **found}) if found else problem
        if not self.turn:
            return problem
        return replace(problem, materials=turned_materials(problem.materials, self.drawn, self.turn))

    @property
    def goal(self) -> Goal | None:
        """Goal of the problem."""
        return self.problem.goal

    @cached_property
    def drawn(self) -> MeshTri:
        """Mesh of the file in metres, with the name of its rim.

        Midside nodes are dropped if all sides are straight, the order is 1 or a subdomain is turned.

        Raises
        ------
        ValueError
            If the file is damaged, or the name of the rim stands for something else.
        OSError
            If the file cannot be read.
        """
        mesh = read_mesh(self.mesh_file, scale=self.scale)
        check_kind(mesh)
        _check_turn(mesh, self.turn)
        mesh = corners_of(mesh) if self.turn or self.base_problem.order == 1 else mesh
        return _with_rim(mesh, self.rim) if self.rim else mesh

    @property
    def follows_tolerance(self) -> bool:
        return bool(self.adapt.keys() & set(TOLERANCES)) and "target_nodes" not in self.adapt

    @property
    def most_passes(self) -> int:
        """Maximum number of passes."""
        return self.adapt.get("passes", PASSES_TO_TOLERANCE if self.follows_tolerance else PASSES)

    @property
    def labelled_outputs(self) -> dict[str, Quantity]:
        """Outputs by name and unit, such as ``pull (N/m)``.

        Totals are per metre unless the problem has a depth or an axis of symmetry.
        """
        problem = self.problem
        potential = "Wb/m" if isinstance(problem, Magnetostatics) else "A"
        is_flat = isinstance(problem, Magnetostatics) and problem.depth is None and not problem.axisymmetric
        per_metre = "/m" if is_flat else ""
        return {
            f"{name} ({(each.unit or potential) if each.local else each.unit + per_metre})": each
            for name, each in self.outputs.items()
        }

    @property
    def energy_unit(self) -> str:
        """Unit of squared indicators, for any depth."""
        return "J/m" if isinstance(self.problem, Magnetostatics) and not self.axisymmetric else "J"

    @property
    def axisymmetric(self) -> bool:
        return getattr(self.problem, "axisymmetric", False)

    @property
    def coils(self) -> Mapping[str, Coil]:
        return getattr(self.problem, "coils", None) or {}

    @property
    def pairs(self) -> Sequence[Pair]:
        return self.adapt.get("periodic", getattr(self.base_problem, "pairs", ()))

    @property
    def pinned(self) -> list[int | str]:
        """Names and node numbers of pinned nodes."""
        given = self.adapt.get("pinned", [])
        return [given] if isinstance(given, str) else given

    def pins(self, mesh: MeshTri) -> list[int | str]:
        """Return pinned names and nodes, including the nodes in groups of points.

        Parameters
        ----------
        mesh
            The mesh of `fitting_mesh`, in metres.

        Returns
        -------
        list of int and str
            Valid as ``pinned`` of `adapt`.
        """
        return [*self.pinned, *self.groups.held(mesh.scaled(1.0 / self.scale))]

    def options(self, mesh: MeshTri) -> dict[str, Any]:
        """Return the arguments of `adapt` for a mesh, with pinned nodes and curves.

        Curves of the mesh file and the bores of bodies with a torque as output are added, except on periodic boundaries
        and on facets that already have a curve. The curves of a file of order 2 to 5 are those of the
        nodes of its sides, if nothing is turned.

        Parameters
        ----------
        mesh
            The mesh of `fitting_mesh`.

        Returns
        -------
        dict
            Arguments by name.
        """
        given = {**self.adapt, "pinned": self.pins(mesh)}
        if isinstance(self.adapt.get("output_rtol"), dict):
            labels = dict(zip(self.outputs, self.labelled_outputs, strict=True))
            given["output_rtol"] = {labels[name]: value for name, value in self.adapt["output_rtol"].items()}
        if not isinstance(self.problem, Magnetostatics):
            return given
        curves = dict(self.adapt.get("curves") or {})
        taken = np.concatenate([[], *(np.asarray((mesh.boundaries or {}).get(name, [])) for name in curves)])
        bore_curves = dict[str, Arc | Line | Spline]()
        for each in self.outputs.values():
            bore_curves |= bores(mesh, each.bodies, each.centre) if each.centre is not None else {}
        paired = {name for pair in self.pairs for name in pair[:2]}
        file_curves = {} if self.turn or is_second_order(mesh) else curves_in_file(self.mesh_file, mesh, self.scale)
        for name, curve in (file_curves | bore_curves).items():
            facets = np.asarray(mesh.boundaries[name])
            if name not in paired and not np.isin(facets, taken).any():
                curves[name], taken = curve, np.append(taken, facets)
        return given | ({"curves": curves} if curves else {})


def _check_turn(mesh: Mesh, turn: Turn) -> None:
    if turn and type(mesh) is TETRAHEDRON.mesh:
        raise ValueError("turn is for meshes of triangles only; draw the turned part at its angle.")


def _with_rim(mesh: MeshTri, name: str) -> MeshTri:
    rim, known = mesh.boundary_facets(), (mesh.boundaries or {}).get(name)
    if known is not None and np.array_equal(np.sort(np.asarray(known)), rim):
        return mesh  # in a mesh written by `run`
    if known is not None or name in (mesh.subdomains or {}):
        raise ValueError(
            f"rim must be a new name for the whole rim of the mesh, which already has another {name!r}. Choose another "
            "name, or leave rim out."
        )
    return mesh.with_boundaries({name: rim})


def _in_space(problem: Magnetostatics) -> MagneticScalarPotential:
    default = Magnetostatics(problem.materials, problem.potential or {"": 0.0}, estimator=problem.estimator)
    pairs = {each.name: (getattr(problem, each.name), getattr(default, each.name)) for each in fields(problem)}
    plane_only = [
        name
        for name, (value, expected) in pairs.items()
        if name not in SHARED and not (value == expected and type(value) is type(expected))
    ]
    if plane_only:
        raise ValueError(f"{', '.join(plane_only)}: for meshes of triangles only, but the mesh is one of tetrahedra.")
    return MagneticScalarPotential(**{name: getattr(problem, name) for name in SHARED})


def keys_of_space(given: Mapping[str, Any]) -> list[str]:
    vectors = {
        f"materials.{name}.{kind}": getattr(material, kind)
        for name, material in given["materials"].items()
        for kind in ("remanence", "coercivity")
    }
    vectors["applied_field"] = given.get("applied_field")
    found = [key for key, each in vectors.items() if isinstance(each, tuple) and len(each) == 3]
    goal = given.get("goal")
    found += [f"goal.{goal.vector}"] if isinstance(goal, VectorGoal) and goal.dimension == 3 else []
    found = [f"{key}{OF_THREE}" for key in found]
    found += ["the estimator 'bracket'"] if given.get("estimator") == "bracket" else []
    return found + [key for key in ("symmetry", "coils") if key in given]


def error_in_plane(keys: list[str], reason: str) -> ValueError:
    vectors = [key.removesuffix(OF_THREE) for key in keys if key.endswith(OF_THREE)]
    if vectors and len(vectors) == len(keys):
        return ValueError(f"{', '.join(vectors)}: expected [x, y], because {reason}; got three components.")
    remedy = (
        " A coil in the plane is a subdomain with ampere_turns; in space ampere_turns is a key of [coils.NAME], "
        "and the coil has no subdomain."
    )
    return ValueError(
        f"{reason}, but the case has {', '.join(keys) or 'symmetry'}, for tetrahedra.{remedy * ('coils' in keys)}"
    )
