"""Settings of an adaptation, with its tolerances."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator

from kohonen_adapt.checks import check_fraction, check_tolerance
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.loop.figures import GOAL, values_of
from kohonen_adapt.loop.growth import NodeCounts
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.som.schedule import Schedule, check_training

PASSES, PASSES_TO_TOLERANCE = 4, 12

ONLY_ENDS = {"only ends": True}  # metadata of a setting that ends the loop, and changes no pass

CHANCE = 0.05  # least error of a goal, relative to the sum of the magnitudes of its parts: less is chance
GRADED = 3  # passes after which the errors of a goal are less than its value, unless that is zero
UNCERTAIN = 1.0 / 3.0  # error of a goal relative to its value, above which the value may be zero
VANISHING = 0.1  # error of an output relative to its value, below which the value is known not to be zero
# With more unknowns the relative error of other values falls to less than this part within three passes.
KEPT = 1.0 / 3.0
UNKNOWN = 0.5  # factor of the estimate for outputs of unknown error, which makes at least twice the unknowns

ZERO_GOAL = (
    "the goal is smaller than the sum of its estimated errors, as by a symmetry, so that no goal_rtol can be met. "
    "Give atol instead, the root of the allowed error."
)
ZERO_OUTPUTS = (
    "the estimated errors of {} remain as large as the values, as of a value that is zero by a symmetry, so that no "
    "output_rtol can be met. Give output_rtol as a mapping from the names of the others to fractions."
)


@dataclass(frozen=True)
class Settings:
    rules: Rules
    schedule: Schedule | None
    seed: int
    polish: bool
    growth: NodeCounts = field(metadata={"argument": "target_nodes"})
    outputs: Mapping[str, Output]
    anisotropic: bool | str = "auto"
    tolerance: "Tolerance" = field(default_factory=lambda: Tolerance(), metadata=ONLY_ENDS)

    def __post_init__(self) -> None:
        check_training(self.schedule, self.seed)
        if not isinstance(self.polish, bool | np.bool_):
            raise ValueError(
                f"polish must be True or False; got {self.polish!r}. kohonen_adapt.polish polishes without a map."
            )
        if not isinstance(self.anisotropic, bool | np.bool_) and self.anisotropic != "auto":
            raise ValueError(f"anisotropic must be 'auto', True or False; got {self.anisotropic!r}.")

    def rng(self, number: int) -> Generator:
        return np.random.default_rng(int(np.random.SeedSequence((self.seed, number)).generate_state(1)[0]))


@dataclass(frozen=True)
class Tolerance:
    rtol: float | None = None
    atol: float | None = None
    output_rtol: float | Mapping[str, float] | None = None
    goal_rtol: float | None = None

    def __post_init__(self) -> None:
        check_fraction("rtol", self.rtol)
        check_tolerance("atol", self.atol)
        check_fraction("goal_rtol", self.goal_rtol)

    def __bool__(self) -> bool:
        return any(each is not None for each in vars(self).values())

    def of_energy(self, norm: float | None) -> float | None:
        # allowed error in the energy norm, None without a tolerance
        if self.rtol is None and self.atol is None:
            return None
        return (self.atol or 0.0) + (self.rtol or 0.0) * (norm or 0.0)

    def only_outputs(self, outputs: Iterable[str]) -> list[str]:
        """Return the outputs with a tolerance if nothing else has one."""
        return [] if replace(self, output_rtol=None) else list(self._fractions(outputs))

    def unreachable_text(self, passes: Sequence[Pass]) -> str:
        """Return a sentence on values that stay below their errors, or an empty string."""
        last, graded = passes[-1], passes[-GRADED:]
        if last.number < GRADED:
            return ""
        if self.goal_rtol is not None and _is_zero_goal(last):
            return ZERO_GOAL
        names = [repr(name) for name in self._fractions(last.outputs) if _vanishes(name, graded)]
        return ZERO_OUTPUTS.format(" and ".join(names)) if names else ""

    def knows_errors(self, last: Pass) -> bool:
        return self._fractions(last.outputs).keys() <= last.output_errors.keys()

    def of_values(self, last: Pass) -> dict[str, float]:
        # allowed errors of outputs by name, and of the goal under "goal", in their units
        found = {name: fraction * abs(last.outputs[name]) for name, fraction in self._fractions(last.outputs).items()}
        if self.goal_rtol is not None and last.goal is not None:
            found["goal"] = self.goal_rtol * abs(last.goal)
        return found

    def missed_values(self, last: Pass) -> list[str]:
        errors = {name: value.error for name, value in values_of(last).items()}
        return [
            name
            for name, allowed in self.of_values(last).items()
            if (error := errors[name]) is None or abs(error) > allowed
        ]

    def missed(self, last: Pass) -> list[str]:
        """Return the names of missed tolerances, "energy" for the energy norm."""
        of_energy = self.of_energy(last.energy_norm)
        over = of_energy is not None and last.estimate > of_energy
        return (["energy"] if over else []) + self.missed_values(last)

    def estimate(self, last: Pass) -> float | None:
        """Return the allowed estimate of a pass, None without a tolerance.

        The error of goals and outputs falls like the square of the estimate, so that their tolerances are stated as
        estimates, too. An output of unknown error takes twice the unknowns.
        """
        of_energy = self.of_energy(last.energy_norm)
        allowed = [] if of_energy is None else [of_energy]
        if self.goal_rtol is not None and last.goal is not None and last.goal_error is not None:
            error = max(abs(last.goal_error), CHANCE * last.estimate**2)
            allowed.append(last.estimate * np.sqrt(self.goal_rtol * abs(last.goal) / error) if error else np.inf)
        for name, tolerance in self._fractions(last.outputs).items():
            ratio = UNKNOWN
            if name in last.output_errors:
                error = abs(last.output_errors[name])
                ratio = np.sqrt(tolerance * abs(last.outputs[name]) / error) if error > 0.0 else np.inf
            allowed.append(last.estimate * ratio if ratio < np.inf else np.inf)
        return float(min(allowed)) if allowed else None

    def _fractions(self, outputs: Iterable[str]) -> dict[str, float]:
        if isinstance(self.output_rtol, Mapping):
            return dict(self.output_rtol)
        return {} if self.output_rtol is None else dict.fromkeys(outputs, self.output_rtol)

    def reached_text(self, last: Pass) -> str:
        doubt = "" if last.calibrated or last.goal is not None else " (not calibrated)"
        reached = [
            f"estimate {last.estimate_text}{doubt} within the tolerance {text}" for text in self._of_estimate(last)
        ]
        return " and ".join([*reached, *self.errors_text(last)])

    def _of_estimate(self, last: Pass) -> list[str]:
        if (tolerance := self.of_energy(last.energy_norm)) is None:
            return []
        return [f"{tolerance:.4g}" if last.goal is None else f"{tolerance**2:.4g} {last.goal_unit} (atol squared)"]

    def errors_text(self, last: Pass) -> list[str]:
        texts, values = list[str](), values_of(last)
        asked = {} if self.goal_rtol is None or last.goal_error is None else {GOAL: self.goal_rtol}
        for name, tolerance in {**asked, **self._fractions(last.outputs)}.items():
            value, relative = values[name], values[name].relative_error
            text = "error unknown" if value.error is None else f"estimated error {abs(value.error):.3g}"
            if relative is not None:
                text = f"estimated error {abs(relative):.4g} %"
            texts.append(f"{name} {value.texts()[0]}, {text} (asked {percent(tolerance)})")
        return texts

    def missed_text(self, last: Pass) -> str:
        missed = [f"the tolerance {text} (estimate {last.estimate_text})" for text in self._of_estimate(last)]
        missed += [f"the tolerance of {text}" for text in self.errors_text(last)]
        return f" without reaching {' and '.join(missed)}" if missed else ""


def _is_zero_goal(last: Pass) -> bool:
    if last.goal is None or last.goal_error is None:
        return False
    return bool(abs(last.goal) < min(last.estimate**2, abs(last.goal_error) / UNCERTAIN))


def _vanishes(name: str, passes: Sequence[Pass]) -> bool:
    errors = [abs(step.output_errors.get(name, 0.0)) for step in passes]
    values = [abs(step.outputs[name]) for step in passes]
    large = all(error > VANISHING * value for error, value in zip(errors, values, strict=True))
    return large and errors[-1] * values[0] >= KEPT * errors[0] * values[-1]


def percent(fraction: float) -> str:
    return f"{100.0 * fraction:.4g} %"
