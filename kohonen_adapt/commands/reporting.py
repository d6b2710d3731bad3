"""The report of a run: what was asked for, which fields are shown, how to run it again."""

import shlex
from collections.abc import Mapping
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.cases import Case
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.report import FieldOf, write_report

__all__ = ["energy_unit", "length_unit", "magnitude", "write_run_report"]

MILLIMETRES = 1.0  # m: smaller meshes are drawn in millimetres
PASSES = signature(adapt).parameters["passes"].default


def write_run_report(
    path: Path, case: Case, before: AdaptResult, after: AdaptResult, pictures: Mapping[str, Path]
) -> None:
    """Write the report of a run.

    Parameters
    ----------
    path
        The file; the name of its folder stands in the command that it shows.
    case
        What was asked for.
    before, after
        The input, solved and estimated, and the result.
    pictures
        Caption to file.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    command = shlex.join(["kohonen-adapt", "run", case.file or "CASE.toml", "--out", path.parent.name or "."])
    write_report(
        path,
        after,
        before=before,
        title=f"Adaptation of {case.mesh.name}",
        asked=_asked(case, before),
        point_data=_potentials(case),
        cell_data={"flux density |B| (T)": magnitude},
        indicator_label=f"error indicator of an element (√({energy_unit(case)}))",
        unit=length_unit(after),
        pictures=pictures,
        settings={"Command": command, "Case": case.text, "Seed": str(case.adapt.get("seed", 0))},
    )


def magnitude(field: Any) -> Floats:
    """|B| of every element, (nelements,), T."""
    return np.hypot(*field.flux_density)


def length_unit(result: AdaptResult) -> str:
    """In which unit a mesh is shown."""
    return "mm" if np.ptp(result.mesh.p, axis=1).max() < MILLIMETRES else "m"


def energy_unit(case: Case) -> str:
    """Unit of energies: of squared indicators."""
    return "J" if case.problem.axisymmetric else "J/m"


def _potentials(case: Case) -> dict[str, FieldOf]:
    """What is shown per node; the contours of the first are the flux lines."""
    flux: dict[str, FieldOf] = {"flux function r A (Wb)": lambda field: field.unknown}
    return {
        **(flux if case.problem.axisymmetric else {}),
        "vector potential A (Wb/m)": lambda field: field.potential,
    }


def _asked(case: Case, before: AdaptResult) -> str:
    """What was to be done, in words."""
    options, problem = case.adapt, case.problem
    target = f" and grow it to {options['target_nodes']} nodes" if "target_nodes" in options else ""
    limits = [f"{key} = {options[key]:g}" for key in ("rtol", "atol", "output_rtol") if key in options]
    until = f", until {' or '.join(limits)}" if limits else ""
    passes = options.get("passes", PASSES)
    outputs = f" Outputs: {', '.join(case.labelled_outputs)}." if case.outputs else ""
    return (
        f"Asked for: adapt {case.mesh.name} ({before.mesh.p.shape[1]} nodes, {before.mesh.t.shape[1]} elements)"
        f"{target} in at most {passes} pass{'es' * (passes != 1)}{until}, by the {problem.estimator} estimate of "
        f"the magnetic field in {', '.join(problem.materials)}.{outputs}"
    )
