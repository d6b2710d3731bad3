"""Computation of one case, with its outputs or its error, in any process."""

import pickle
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from traceback import format_exc
from typing import Any, SupportsFloat

from kohonen_adapt.sweeps.cases import SECONDS, Case

__all__ = ["VALUE", "Outcome", "compute"]

VALUE = "value"  # name of the output of a function that returns a single number


@dataclass(frozen=True)
class Outcome:
    """Outputs, duration and error of a case.

    Attributes
    ----------
    outputs
        Values by name; empty after an error.
    seconds
        Duration in seconds.
    error
        The exception raised by the function, or None.
    """

    outputs: dict[str, float]
    seconds: float
    error: Exception | None = None


def compute(function: Callable[..., Any], case: Case) -> Outcome:
    start = time.perf_counter()
    try:
        outputs = _outputs(function(**case), case)
    except (Exception, SystemExit) as error:
        return Outcome({}, time.perf_counter() - start, _portable(error))
    return Outcome(outputs, time.perf_counter() - start)


def _outputs(returned: Any, case: Case) -> dict[str, float]:
    given = returned if isinstance(returned, Mapping) else {VALUE: returned}
    for name, value in given.items():
        if not isinstance(name, str) or not isinstance(value, SupportsFloat):
            raise TypeError(f"the function must return a number, or names and their numbers; got {returned!r}.")
        if name in ("", SECONDS, *case):
            raise ValueError(f"the function must name its outputs otherwise than parameters and seconds; got {name!r}.")
    return {name: float(value) for name, value in given.items()}


def _portable(error: BaseException) -> Exception:
    """Return an exception that can be pickled, with the traceback as a note."""
    error.add_note(format_exc())
    try:
        sent = pickle.loads(pickle.dumps(error))
    except Exception:  # pickling can raise anything
        sent = None
    if isinstance(sent, Exception) and type(sent) is type(error):
        return sent
    replacement = RuntimeError(f"{type(error).__name__}: {error}")
    replacement.add_note(format_exc())
    return replacement
