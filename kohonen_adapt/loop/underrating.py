"""Errors that the estimate of a pass misses and another pass shows."""

import numpy as np

from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.measures import area

__all__ = ["error_measure", "underrating"]

# Ratio of a squared error to its estimate above which the mesh does not resolve the solution. In 578 runs with a finer
# reference (C-cores of 57 to 211 nodes, devices of 60 to 1024 nodes, orders 1 to 3) the warning after one pass is given
# for 11 of 50 results with an error above 1.2 times the estimate, and for 6 of the remaining 528; after two and three
# passes falsely for 1 of 542 and for 1 of 548.
UNRESOLVED = 2.0


def error_measure(step: Pass, other: Pass) -> float:
    """Return the error measure of a pass, with the error that `other` shows."""
    return step.worth * underrating(step, other)


def underrating(step: Pass, other: Pass) -> float:
    """Return the error over the estimate of a pass as shown by `other`, at least 1."""
    if step.estimate == 0.0:
        return 1.0
    if step.functional is None and other.functional is None:
        ratio = ratio_by_smaller_elements(step, other)
    else:
        ratio = ratio_by_functional(step, other)
    return float(np.sqrt(ratio)) if ratio > UNRESOLVED else 1.0


def ratio_by_functional(step: Pass, other: Pass) -> float:
    # A functional lies above its minimum by half the square of the error in the energy norm. Hence the squared error is
    # twice the decrease to the other pass, plus the squared error of the other pass.
    comparable = step.comparable and other.comparable and other.calibrated and other.share is None
    if not comparable or step.functional is None or other.functional is None:
        return 1.0
    return (2.0 * (step.functional - other.functional) + other.estimate**2) / step.estimate**2


def ratio_by_smaller_elements(step: Pass, other: Pass) -> float:
    # Smaller elements have less error. Elements whose error is contradicted by smaller ones inside have the error of
    # these, scaled to the larger size: squared errors over areas are proportional to h^(2 order).
    size, part = area(step.mesh), area(other.mesh)
    inside = find_elements(step.mesh, other.mesh.p[:, other.mesh.t].mean(axis=1))
    rows = np.flatnonzero((inside >= 0) & (part < size[inside]))
    around, part = inside[rows], part[rows]
    scale = step.indicators.max()
    squared, smaller = (step.indicators / scale) ** 2, (other.indicators[rows] / scale) ** 2
    scaled = smaller * (size[around] / part) ** (2.0 * step.order / step.mesh.dim())
    covered, found, total = (np.bincount(around, values, len(size)) for values in (part, smaller, scaled))
    own = squared * np.minimum(covered / size, 1.0)
    return float(1.0 + np.sum((total - own)[found > UNRESOLVED * own]) / np.sum(squared))
