"""Process pool with shared threads, which ends with this process."""

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import connection, get_context, parent_process
from queue import SimpleQueue
from typing import Any, TypeVar

from kohonen_adapt.checks import check_count
from kohonen_adapt.kernels.threads import number_of_threads

__all__ = ["CannotBeginError", "LocalPool", "cannot_be_pickled", "check_pickled"]

Result = TypeVar("Result")

SPAWN = get_context("spawn")

THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Libraries read these variables of the environment on import.

REMEDY = (
    "Define it at the top level of a module or a script: no lambda, and not within a function or at a prompt. Or give "
    "an executor that sends nothing to other processes, such as ThreadPoolExecutor(1)."
)

# A new process inherits the environment, which is changed for each start.
_starting = threading.Lock()


class CannotBeginError(ValueError):
    """Failure to run the function of a sweep in any other process."""


def check_pickled(function: Callable[..., Any]) -> None:
    try:
        pickle.dumps(function)
    except Exception as error:  # pickling can raise anything
        raise cannot_be_pickled(error) from error


def cannot_be_pickled(error: Exception) -> CannotBeginError:
    return CannotBeginError(f"function must be one that can be pickled: {error}. {REMEDY}")


class LocalPool(Executor):
    """Executor with spawned processes, each for one task at a time.

    If a process dies, its task ends with a RuntimeError and a new process replaces the dead one. Tasks must not raise.

    Parameters
    ----------
    prepare
        Function called before the first process starts, to compile what all processes need.
    processes
        Number of processes; by default the number of threads for compiled loops, which the processes share evenly.

    Raises
    ------
    ValueError
        If `processes` is not an integer of at least 1.
    """

    def __init__(self, prepare: Callable[[], None], processes: int | None = None) -> None:
        count = number_of_threads() if processes is None else processes
        check_count("the number of processes", count, 1)
        prepare()
        self._share = max(1, number_of_threads() // count)
        self._lock, self._ended = threading.Lock(), False
        self._workers = [_Worker(self._share) for _ in range(count)]
        self._idle: SimpleQueue[int] = SimpleQueue()
        for number in range(count):
            self._idle.put(number)
        self._threads = ThreadPoolExecutor(count)

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> "Future[Result]":
        return self._threads.submit(self._answer, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop all processes at once, also in the middle of a task."""
        with self._lock:
            self._ended = True
            for worker in self._workers:
                worker.process.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.process.join()

    def _answer(self, call: Callable[[], Any]) -> Any:
        number = self._idle.get()
        try:
            with self._lock:
                if not self._ended and not self._workers[number].process.is_alive():
                    self._workers[number] = _Worker(self._share)
                worker = self._workers[number]
            return worker.answer(call)
        finally:
            self._idle.put(number)


class _Worker:
    def __init__(self, threads: int) -> None:
        self._line, there = SPAWN.Pipe()
        self.process = SPAWN.Process(target=_work, args=(there,), daemon=True)
        with _sharing(threads):
            self.process.start()
        there.close()  # the pipe then closes when the process ends
        self._begun = False

    def answer(self, call: Callable[[], Any]) -> Any:
        task = pickle.dumps(call)
        try:
            self._begun = self._begun or self._line.recv()
            self._line.send_bytes(task)
            result, refused = self._line.recv()
        except (EOFError, OSError):
            self.process.join()
            code = self.process.exitcode
            if self._begun:
                raise RuntimeError(f"the process that computed it ended with exit code {code}.") from None
            raise CannotBeginError(
                f"the processes of a sweep end with exit code {code} as they begin. They import the script that "
                'started them: it must begin a sweep only below `if __name__ == "__main__":`.'
            ) from None
        if refused:
            raise CannotBeginError(f"function must be one that other processes can import: {refused}. {REMEDY}")
        return result


@contextmanager
def _sharing(threads: int) -> Iterator[None]:
    with _starting:
        before = {name: os.environ.get(name) for name in THREADS}
        ours = [name for name in THREADS if before[name] is None or name == THREADS[0]]
        os.environ.update(dict.fromkeys(ours, str(threads)))
        try:
            yield
        finally:
            for name in ours:
                os.environ.pop(name)
            os.environ.update({name: value for name, value in before.items() if value is not None})


def _work(line: connection.Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process handles Ctrl-C
    threading.Thread(target=_end_with_parent, daemon=True).start()
    line.send(True)
    while True:
        try:
            task = line.recv_bytes()
        except EOFError:
            return
        try:
            call = pickle.loads(task)
        except Exception as error:  # for instance if its module cannot be imported
            line.send((None, f"{type(error).__name__}: {error}"))
        else:
            line.send((call(), None))


def _end_with_parent() -> None:
    if parent := parent_process():
        connection.wait([parent.sentinel])
        os._exit(1)
