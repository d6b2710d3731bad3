"""Functions that sweeps call in processes of their own, which must find them in a module."""

import os
import signal
import threading
from pathlib import Path

import numpy as np
from numba.core import event
from skfem import MeshTri

import kohonen_adapt as ka
from helpers.processes import wait_until


def product(x, y):
    return {"product": x * y, "sum": x + y}


def square(x):
    return x**2


def noted(x, log):
    """Leaves a line in a file whenever it is called."""
    with Path(log).open("a") as stream:
        stream.write(f"{x}\n")
    return float(x)


def fails_at_two(x):
    if x == 2:
        raise KeyError("two")
    return x


class UnsendableError(Exception):
    """Holds what cannot be pickled."""

    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")
        self.lock = threading.Lock()


def unsendable(x):
    raise UnsendableError(1, 2)


def dies_at_two(x):
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def returns(x):
    return {1: "text", 2: {"a": None}, 3: {"seconds": 1.0}, 4: {"x": 1.0}, 5: None, 6: np.float32(0.5), 7: {}}[x]


def relocated(x, y):
    """How many functions numba compiles for a relocation, and a number that depends on where every node is then."""
    mesh = MeshTri().refined(4)
    with event.install_recorder("numba:compile") as recorder:
        moved = ka.relocate(mesh, lambda place: x + y * place[0])
    return {"compiled": len(recorder.buffer), "moved": float(np.linalg.norm(moved.p[0]))}


def threads(x):
    """How many threads compiled loops have."""
    return int(os.environ["NUMBA_NUM_THREADS"])


def waiting(x, folder):
    """Tells in a file that it has begun, and in which process; from 2 on it waits for the file "go on"."""
    (Path(folder) / f"begun {x} {os.getpid()}").touch()
    if x >= 2:
        wait_until((Path(folder) / "go on").exists, seconds=300)
    return {"square": x**2, "root": x**0.5}


def dies_once(x, folder):
    """The process of the case 5 is killed when it computes that for the first time; then a third one must come."""
    mark = Path(folder) / "died"
    (Path(folder) / f"process {os.getpid()}").touch()
    if x == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if x >= 5:
        wait_until(lambda: mark.exists() and len(list(Path(folder).glob("process *"))) == 3)
    return {"square": x**2, "process": os.getpid()}
