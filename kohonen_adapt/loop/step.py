"""How a pass improves a mesh: the map learns the density of the error, then the polish descends the energy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.outline.rules import Limits
from kohonen_adapt.polish.functional import Functional, VariesInside
from kohonen_adapt.polish.polish import SWEEPS, descend
from kohonen_adapt.polish.transfer import Carrier
from kohonen_adapt.problem.protocol import NotOffered, Problem, norm_of, order_of, ritz_of
from kohonen_adapt.problem.ritz import Ritz, functional_value
from kohonen_adapt.som.density import density_from_indicators
from kohonen_adapt.som.relocate import Trained, guarded_map, trained_map
from kohonen_adapt.som.schedule import Schedule

__all__ = ["Improvement", "Settings"]


@dataclass(frozen=True)
class Settings:
    """What every pass is improved with; see `adapt`."""

    schedule: Schedule | None
    limits: Limits
    seed: int
    polish: bool


class Improvement:
    """Map and polish for the passes of one problem.

    Attributes
    ----------
    skipped
        Why there is no polish, or empty.
    comparable
        Whether the functional says which of two meshes is better: the admissible functions are the same on both.
    """

    def __init__(self, problem: Problem, settings: Settings) -> None:
        self._problem = problem
        self._settings = settings
        self.skipped = why_skipped(problem) if settings.polish else "it is switched off"
        self.comparable = False
        self._ritz: Ritz | None = None  # of the last mesh that was solved

    def functional(self, mesh: MeshTri, solution: Any) -> float | None:
        """The Ritz functional of a mesh's own solution, or None where there is no polish.

        It is seen whether the functional can be descended, and compared. Where one value is given all round no other
        mesh can change that; elsewhere new nodes may see what the old ones did not.
        """
        if self.skipped:
            return None
        first = self._ritz is None
        try:
            self._ritz = ritz_of(self._problem, mesh, solution)
        except NotOffered as reason:
            self.skipped = str(reason)
            return None
        value = functional_value(mesh, self._ritz)
        given = np.asarray(self._ritz.values)[np.asarray(self._ritz.fixed)]
        if first or (self.comparable and np.ptp(given) > 0.0):
            self._examine(mesh, self._ritz)
        return None if self.skipped else value

    def recall(self, comparable: bool, skipped: str) -> None:
        """Take over what another process found out about the functional."""
        self.comparable, self.skipped = comparable, skipped

    def resume(self, mesh: MeshTri, solution: Any) -> None:
        """Go on from the last mesh that another process solved."""
        if not self.skipped:
            self._ritz = ritz_of(self._problem, mesh, solution)

    def _examine(self, mesh: MeshTri, ritz: Ritz) -> None:
        som = guarded_map(mesh, self._settings.limits)
        try:
            self.comparable = Functional.of(ritz, som.triangulation, som.outline).comparable
        except VariesInside:
            self.skipped = "its coefficients vary inside a region of the mesh"

    def train(self, mesh: MeshTri, indicators: Floats, number: int, nodes: int) -> Trained:
        """Let the map learn where the error of pass `number` wants nodes, `nodes` of them at least."""
        settings, problem = self._settings, self._problem
        return trained_map(
            mesh,
            density_from_indicators(mesh, indicators, order=order_of(problem), norm=norm_of(problem)),
            schedule=settings.schedule,
            limits=settings.limits,
            seed=int(np.random.SeedSequence((settings.seed, number)).generate_state(1)[0]),
            target=nodes,
        )

    def polish(self, trained: Trained) -> float:
        """Carry the last solution to the trained map and descend its functional there; returns what that gained."""
        if self._ritz is None or self.skipped:
            return 0.0
        ritz, som = self._ritz, trained.som
        functional = Functional.of(ritz, trained.triangulation, trained.outline)
        carrier = Carrier.of(ritz, functional, trained.triangulation, trained.outline)
        values, fixed = carrier.onto(som.triangulation, som.outline, trained.recycled.hint)
        limits = self._settings.limits
        flips, floor = limits.topology != "fixed", float(limits.min_quality)
        return descend(
            som.triangulation, som.outline, functional, values, fixed, sweeps=SWEEPS, flips=flips, floor=floor
        )

    @property
    def remark(self) -> str:
        """What a user should know about the polish of this problem, or empty."""
        if not self._settings.polish or (self.comparable and not self.skipped):
            return ""
        if self.skipped:
            return f"there was no polish: {self.skipped}"
        return (
            "values given on outlines are not linear along them, or given inside, or outlines are curved, so their "
            "nodes were not polished, and passes were compared by the estimate"
        )


def why_skipped(problem: Problem) -> str:
    """Why a problem's energy is not polished, or empty: `ritz_of` has reasons of its own."""
    return "" if norm_of(problem) == "energy" else f"its norm is {norm_of(problem)!r}, not 'energy'"
