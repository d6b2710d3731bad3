"""Summary of an adaptation in sentences and key figures."""

import platform
import re
from importlib.metadata import PackageNotFoundError, version

from kohonen_adapt.display import counted
from kohonen_adapt.kernels.threads import number_of_threads
from kohonen_adapt.loop.figures import (
    GOAL,
    are_in_percent,
    energy_error,
    energy_norm_error,
    estimate_word,
    values_of,
)
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.magnetostatics.hypercircle import Bracket
from kohonen_adapt.version import __version__

__all__ = ["bracket_sentences", "ending_text", "key_figures", "versions", "without_folders"]

ENDINGS = {
    Status.CONVERGED: "tolerance met",
    Status.MAX_PASSES: "maximum number of passes",
    Status.STALLED: "no further improvement",
    Status.NOT_MOVED: "no node could move",
    Status.STOPPED: "stopped early",
    Status.MAX_NODES: "maximum number of nodes",
    Status.FAILED: "error in a pass",
}

PACKAGES = ("numpy", "scipy", "scikit-fem", "numba", "meshio", "matplotlib", "pyamg")

QUOTED = re.compile(r"""(["'])(?:~|[A-Za-z]:)?[\\/](?:[^"'\n]*[\\/])?""")
BARE = re.compile(r"""(?<![\w.:/\\)\]])(?:~|[A-Za-z]:)?(?:[\\/][^\\/\s"'<>|,;]+)+[\\/]""")


def key_figures(result: AdaptResult) -> list[tuple[str, str]]:
    last = result.best
    ends = (result.history[0], last)
    percent = are_in_percent(ends)
    word = "energy-norm error" if percent else estimate_word(result.history)
    before, after = (f"{energy_norm_error(each):.3g}\u00a0%" if percent else each.estimate_text for each in ends)
    energy = [("energy error after", f"{energy_error(last):.2g}\u00a0%")] if percent else []
    return [
        *([] if last.goal is None else _figures_of(GOAL, last)),
        (f"{word} before", before),
        (f"{word} after", after),
        *energy,
        ("nodes", " to ".join(dict.fromkeys(str(each.mesh.nvertices) for each in ends))),
        ("worst quality", f"{last.min_quality:.2f}"),
        *(figure for name in last.outputs for figure in _figures_of(name, last)),
        ("ending", ENDINGS[result.status]),
    ]


def bracket_sentences(bracket: Bracket | None) -> list[str]:
    return [] if bracket is None else [f"Bounds by both potentials on the last mesh: {bracket.summary}."]


def _figures_of(name: str, step: Pass) -> list[tuple[str, str]]:
    titles = (name, f"error of {name}", f"corrected {name}")
    if name == GOAL:
        titles = ("goal", "error of the goal", "goal + error")
    return list(zip(titles, values_of(step)[name].texts(), strict=False))


def ending_text(result: AdaptResult) -> str:
    history = result.history
    relocations = sum(step.order == history[0].order for step in history[1:])  # not for a higher order at the end
    return f"{counted(relocations, 'relocation')} {'was' if relocations == 1 else 'were'} made. {result.message}"


def versions() -> dict[str, str]:
    return {
        "kohonen_adapt": __version__,  # the metadata of an editable install may be of an earlier version
        **{name: found for name in PACKAGES if (found := _version_of(name))},
        "Python": platform.python_version(),
        "processor": platform.machine(),
        "threads": str(number_of_threads()),
    }


def without_folders(text: str) -> str:
    """Return the text with absolute paths cut to file names, for privacy.

    Examples
    --------
    >>> without_folders('mesh = "~/meshes/c_core.msh"  # in A/m')
    'mesh = "c_core.msh"  # in A/m'
    """
    return BARE.sub("", QUOTED.sub(r"\1", text))


def _version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
