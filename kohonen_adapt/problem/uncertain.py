"""Numbers with an estimate of their own error."""

from collections.abc import Mapping
from math import copysign

__all__ = ["Uncertain", "corrected", "doubts_of", "error_of", "shifted"]


class Uncertain(float):
    # `doubt` is the estimated magnitude of the error of the number, in the same unit. A plain float has no doubt.
    doubt: float

    def __new__(cls, value: float, doubt: float) -> "Uncertain":
        number = super().__new__(cls, value)
        number.doubt = abs(float(doubt))
        return number

    def __reduce__(self) -> tuple[type["Uncertain"], tuple[float, float]]:
        return Uncertain, (float(self), self.doubt)


def error_of(value: float, better: float) -> Uncertain:
    # Differences that change their sign with the order are small by chance, and the magnitude is at least the doubt. If
    # the error of the better value is within its doubt, the result is at least half the error of `value`.
    change, doubt = float(better) - value, getattr(better, "doubt", 0.0)
    return Uncertain(copysign(max(abs(change), doubt), change), doubt)


def shifted(number: float, by: float) -> Uncertain:
    return Uncertain(number + by, getattr(number, "doubt", 0.0))


def corrected(value: float, error: float, doubt: float) -> float:
    # If the exact error is between ``error - doubt`` and ``error + doubt``, any correction from 0 to twice ``error -
    # doubt`` is an improvement.
    return value + copysign(min(abs(error), max(2.0 * (abs(error) - doubt), 0.0)), error)


def doubts_of(errors: Mapping[str, float | None]) -> dict[str, float]:
    return {name: error.doubt for name, error in errors.items() if isinstance(error, Uncertain) and error.doubt}
