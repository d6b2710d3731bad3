"""What it takes to compute the same again: versions and threads; nothing that tells whose machine it was."""

import platform
import re
from importlib.metadata import PackageNotFoundError, version

from kohonen_adapt import __version__
from kohonen_adapt.kernels.threads import number_of_threads

__all__ = ["versions", "without_folders"]

PACKAGES = ("numpy", "scipy", "scikit-fem", "numba", "meshio", "matplotlib", "pyamg")

QUOTED = re.compile(r"""(["'])(?:~|[A-Za-z]:)?[\\/](?:[^"'\n]*[\\/])?""")
BARE = re.compile(r"""(?<![\w.:/\\)\]])(?:~|[A-Za-z]:)?(?:[\\/][^\\/\s"'<>|,;]+)+[\\/]""")


def versions() -> dict[str, str]:
    """Name to version of everything that decides the numbers, the kind of processor and the number of threads."""
    return {
        "kohonen_adapt": __version__,
        "Python": platform.python_version(),
        **{name: found for name in PACKAGES if (found := _version_of(name))},
        "processor": platform.machine(),
        "threads": str(number_of_threads()),
    }


def without_folders(text: str) -> str:
    """The text with absolute paths cut to the names of their files: folders tell who worked where.

    Examples
    --------
    >>> without_folders('mesh = "~/meshes/c_core.msh"  # in A/m')
    'mesh = "c_core.msh"  # in A/m'
    """
    return BARE.sub("", QUOTED.sub(r"\1", text))


def _version_of(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
