"""Figures of a pass for tables, files, reports, progress and messages."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kohonen_adapt.display import by_error, significant
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.problem.uncertain import corrected

ERROR_DIGITS = 2
GOAL = "goal"
APART = ("number", "goal", "goal_error", "goal_unit", "output_errors", "doubts")  # fields with figures of other names


@dataclass(frozen=True)
class OutputValue:
    """Value of an output or goal with its estimated error.

    Attributes
    ----------
    value
        Value on the best mesh.
    error
        Estimated error with its sign, None if unknown. Its magnitude is at least `doubt`.
    doubt
        Estimated magnitude of what `error` misses.
    unit
        Unit of the value, or an empty string.
    """

    value: float
    error: float | None
    doubt: float = 0.0
    unit: str = ""

    @property
    def corrected(self) -> float | None:
        """Sum of value and error, None if the error is unknown.

        If the error is less than twice its doubt, a smaller part of the error is added, down to nothing where both are
        equal, so that a correction whose sign is uncertain is none.
        """
        return None if self.error is None else corrected(self.value, self.error, self.doubt)

    @property
    def relative_error(self) -> float | None:
        """Error in per cent of the value, None if either is unknown or zero."""
        return None if self.error is None or not self.value else 100.0 * self.error / abs(self.value)

    def texts(self) -> list[str]:
        """Return the value and, if known, error and corrected value, with units."""
        texts = [by_error(self.value, self.error)]
        if self.error is not None and self.corrected is not None:
            texts += [significant(self.error, ERROR_DIGITS), by_error(self.corrected, self.error)]
        return [f"{text} {self.unit}".rstrip() for text in texts]


def values_of(step: Pass) -> dict[str, OutputValue]:
    """Return the outputs of a pass by name, and the goal under "goal"."""
    errors, doubts = step.output_errors, step.doubts
    found = {name: OutputValue(value, errors.get(name), doubts.get(name, 0.0)) for name, value in step.outputs.items()}
    if step.goal is not None:
        found[GOAL] = OutputValue(step.goal, step.goal_error, doubts.get(GOAL, 0.0), step.goal_unit)
    return found


def pass_figures(step: Pass) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for name, value in vars(step).items():
        if name in APART:
            continue
        if isinstance(value, dict):
            singular = name.removesuffix("s") if name == "outputs" else name
            figures |= {f"{singular} {key}": number for key, number in value.items()}
        elif value is None or isinstance(value, int | float | str):
            figures[name] = value
    values = values_of(step)
    for name in step.output_errors:
        figures |= {f"error of output {name}": values[name].error, f"corrected output {name}": values[name].corrected}
    if step.goal is None:
        return figures
    goal = values[GOAL]
    of_goal = {"goal": goal.value, "goal error": goal.error, "goal + error": goal.corrected}
    of_goal["goal estimate"] = step.shown_estimate  # the sum of the errors of the elements
    return figures | {with_unit(name, step): value for name, value in of_goal.items()}


def goal_sentence(step: Pass) -> str:
    if step.goal is None:
        return ""
    texts = values_of(step)[GOAL].texts()
    if len(texts) == 1:
        return f"The goal is {texts[0]}; its error is not estimated."
    return "The goal is {}, with an estimated error of {}: the exact value is near {}.".format(*texts)


def with_unit(name: str, step: Pass) -> str:
    return f"{name} ({step.goal_unit})" if step.goal_unit else name


def energy_norm_error(step: Pass) -> float | None:
    return 100.0 * step.estimate / step.energy_norm if step.calibrated and step.energy_norm else None


def are_in_percent(steps: Sequence[Pass]) -> bool:
    return all(energy_norm_error(step) is not None for step in steps)


def energy_error(step: Pass) -> float | None:
    """Return the error of the energy in per cent, None if unknown.

    By Galerkin orthogonality the functional of a linear problem, int c/2 |grad u|^2 - f u, differs from its minimum by
    half the square of the error in the energy norm. Hence the relative error of the energy is (estimate / norm)^2. For
    nonlinear materials the estimate is in the norm of the linearised problem, and the relation holds near the solution.
    """
    error = energy_norm_error(step)
    return None if error is None else error**2 / 100.0


def error_text(step: Pass) -> str:
    error = energy_norm_error(step) if step.goal is None else None
    return f"estimate {step.estimate_text}" if error is None else f"estimated error {error:.3g} %"


def word_for_estimate(history: Sequence[Pass]) -> str:
    return with_unit(estimate_word(history), history[0])


def estimate_word(history: Sequence[Pass]) -> str:
    return "estimate" if all(step.calibrated or step.goal is not None for step in history) else "indicator"
