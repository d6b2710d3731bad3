"""The package calls nothing that only POSIX systems have, except where it asks first."""

import ast

from helpers.places import PACKAGE
from helpers.processes import python

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "select", "syslog", "termios", "tty"}
NAMES = {
    *("SIGALRM", "SIGHUP", "SIGKILL", "SIGQUIT", "SIGUSR1", "SIGUSR2", "alarm", "chown", "fchmod", "fchown", "flock"),
    *("fork", "forkpty", "geteuid", "getloadavg", "getpgid", "getpgrp", "getuid", "killpg", "mkfifo", "nice"),
    *("pthread_kill", "register_at_fork", "sched_getaffinity", "sched_setaffinity", "setpgrp", "setsid", "setuid"),
    *("sigwait", "statvfs", "sysconf", "uname", "wait3", "wait4"),
}
FOLDERS = ("/tmp", "/dev/", "/proc", "/var/", "/usr/", "/etc/", "/home")

# The modules that the package imports are loaded as they are here; its own see Windows, without these names.
ELSEWHERE = """
import os, sys
import kohonen_adapt
for name in [name for name in sys.modules if name.startswith("kohonen_adapt")]:
    del sys.modules[name]
sys.platform, sys.modules["fcntl"] = "win32", None
del os.register_at_fork
from pathlib import Path
from skfem import MeshTri
import kohonen_adapt as ka
from kohonen_adapt.files import remove_drafts
path = Path("square.msh")
for times in (1, 2):
    ka.write_mesh(path, MeshTri().refined(times).with_subdomains({"air": lambda x: x[0] > -1.0}))
remove_drafts(path.resolve().parent)
print(ka.read_mesh(path).nelements, sorted(each.name for each in path.resolve().parent.iterdir()))
"""


def is_question(test):
    return any(part in ast.unparse(test) for part in ("sys.platform", "hasattr"))


def unasked(node, asked=False):
    """Uses of POSIX names outside of an ``if`` about the platform, with their lines."""
    if isinstance(node, ast.If):
        asked_inside = asked or is_question(node.test)
        for child in [*node.body, *node.orelse]:
            yield from unasked(child, asked_inside)
        return
    if not asked:
        if isinstance(node, ast.Import | ast.ImportFrom):
            source = [getattr(node, "module", None) or ""] + [alias.name for alias in node.names]
            yield from ((node.lineno, name) for name in source if name in MODULES | NAMES)
        if isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield node.lineno, node.attr
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith(FOLDERS):
            yield node.lineno, node.value
    for child in ast.iter_child_nodes(node):
        yield from unasked(child, asked)


def test_nothing_is_called_that_only_posix_has():
    files = sorted(PACKAGE.rglob("*.py"))
    found = [(str(path), *each) for path in files for each in unasked(ast.parse(path.read_text(encoding="utf-8")))]
    assert found == []


def test_files_are_written_without_locks_and_forks(tmp_path):
    done = python("-c", ELSEWHERE, cwd=tmp_path)
    assert done.stderr == "" and done.stdout == "32 ['square.msh']\n"
