"""User-defined outputs of a solution, their validation and their convergence."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from kohonen_adapt.checks import check_tolerance

__all__ = ["Output", "check_outputs", "have_settled", "output_value"]

Output = Callable[[Any], float]


def check_outputs(outputs: Any, output_rtol: Any) -> dict[str, Output]:
    if outputs is not None and not isinstance(outputs, Mapping):
        raise ValueError(f"outputs must map names to functions of the solution, or be None; got {outputs!r}.")
    for name, function in (outputs or {}).items():
        if not isinstance(name, str):
            raise ValueError(f"the names of outputs must be strings; got {name!r}.")
        if not callable(function):
            raise ValueError(f"outputs[{name!r}] must be a function of the solution; got {function!r}.")
    check_tolerance("output_rtol", output_rtol)
    if output_rtol is not None and not outputs:
        raise ValueError("output_rtol requires outputs; add outputs={name: function}.")
    return dict(outputs or {})


def output_value(name: str, function: Output, solution: Any) -> float:
    value = np.asarray(function(solution))
    if value.dtype.kind not in "iuf":
        raise ValueError(f"outputs[{name!r}] must return a real number; got {value.dtype}.")
    if value.shape != ():
        raise ValueError(
            f"outputs[{name!r}] must return one number; got an array of shape {value.shape}: "
            "return one component, or add an output for each component."
        )
    if not np.isfinite(value):
        raise ValueError(f"outputs[{name!r}] must return a finite number; got {value}.")
    return float(value)


def have_settled(before: Mapping[str, float], after: Mapping[str, float], tolerance: float) -> bool:
    return all(abs(after[name] - value) <= tolerance * abs(value) for name, value in before.items())
