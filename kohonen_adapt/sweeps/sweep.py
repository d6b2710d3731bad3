"""Parallel computation of a function over many cases, with stored results."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from pickle import PicklingError
from typing import Any

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.checks import check_hook
from kohonen_adapt.kernels.threads import number_of_threads
from kohonen_adapt.precompile import compile_missing
from kohonen_adapt.sweeps.cases import Case, Outcome, SweepResult, compute, list_cases, tabulated
from kohonen_adapt.sweeps.folder import SweepFolder
from kohonen_adapt.sweeps.pool import CannotBeginError, LocalPool, cannot_be_pickled, check_pickled

__all__ = ["sweep"]


def sweep(
    function: Callable[..., Any],
    cases: Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]],
    *,
    executor: Executor | None = None,
    folder: FilePath | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> SweepResult:
    """Call a function with every case, several at a time.

    Parameters
    ----------
    function
        Called as ``function(**case)``; returns a number, or a mapping of names to numbers and texts. An exception is
        stored as the error of the case and does not stop the sweep.
    cases
        A sequence of mappings with the same keys, one for every case, or a mapping of names to sequences of values. The
        latter means all combinations, and the last parameter changes fastest. Values are numbers, texts or truth
        values.
    executor
        Any ``concurrent.futures.Executor``, which stays open; for a Dask client ``client.get_executor()``. None means
        spawned processes on this machine, which share its threads. All kernels are compiled before they start. The
        function must then be defined at the top level of a module or a script.
    folder
        Folder with a file for every finished case. Cases found there are not computed again; cases with errors are.
    progress
        Called as ``progress(done, count)`` at the start and after every case.

    Returns
    -------
    SweepResult
        Parameters, outputs and seconds of every case, in the order of the cases.

    Raises
    ------
    ValueError
        If an argument is not as above, if the function cannot be pickled or imported by other processes, or if the
        folder contains damaged files or those of another function or of other cases. Functions are compared by their
        code, other callables by their data; functions called by them are not compared.
    OSError
        If the folder cannot be read or written.
    KeyboardInterrupt
        At Ctrl-C. Processes on this machine end at once, and finished cases are in the folder.

    Notes
    -----
    Processes on this machine import the script that started them. A script must therefore call `sweep` below
    ``if __name__ == "__main__":``. The processes share the threads that ``NUMBA_NUM_THREADS`` allows, and end with the
    main process, also if the main process is killed. If a process dies, for instance for lack of memory, its case has
    an error and a new process replaces the dead one. After the main process was killed, the same call with the same
    folder computes the missing cases and returns the complete table.

    Every machine of a cluster needs this package and the module of the function, and compiles once for itself. Without
    a shared disk the function must bring its meshes along. Dask moves cases of a lost worker to another worker.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import kohonen_adapt as ka
    >>> def product(x, y):
    ...     return {"product": x * y}
    >>> with ThreadPoolExecutor() as threads:
    ...     result = ka.sweep(product, {"x": [1, 2], "y": [0.5, 1.5]}, executor=threads)
    >>> result.table["product"]
    array([0.5, 1.5, 1. , 3. ])

    With Dask on a cluster (``pip install "kohonen-adapt[sweep]"``):

    >>> from distributed import Client  # doctest: +SKIP
    >>> with Client("tcp://scheduler:8786") as client:  # doctest: +SKIP
    ...     result = ka.sweep(product, {"x": range(100), "y": [0.5]}, executor=client.get_executor(), folder="cases")
    """
    listed = list_cases(cases)
    if not callable(function):
        raise ValueError(f"function must be one that takes the parameters of a case; got {function!r}.")
    if executor is not None and not isinstance(executor, Executor):
        raise ValueError(
            f"executor must be a concurrent.futures.Executor, or None; got {executor!r}. Of a Dask client it is "
            "client.get_executor()."
        )
    check_hook("progress", progress, "the number of cases that are done and that of all")
    if executor is None or isinstance(executor, LocalPool | ProcessPoolExecutor):
        check_pickled(function)
    store = None if folder is None else SweepFolder.at(folder, function, listed)
    outcomes = store.finished(len(listed)) if store else {}

    def report() -> None:
        if progress:
            progress(len(outcomes), len(listed))

    def ended(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        if store and outcome.error is None:
            store.keep(number, outcome)
        report()

    report()
    missing = {number: case for number, case in enumerate(listed) if number not in outcomes}
    if missing:
        count = min(len(missing), number_of_threads())
        with LocalPool(compile_missing, count) if executor is None else nullcontext(executor) as engine:
            _compute(engine, function, missing, ended)
    return tabulated(listed, [outcomes[number] for number in range(len(listed))])


def _compute(
    executor: Executor, function: Callable[..., Any], cases: Mapping[int, Case], ended: Callable[[int, Outcome], Any]
) -> None:
    futures: dict[Future[Outcome], int] = {}
    try:
        try:
            for number, case in cases.items():
                futures[executor.submit(compute, function, case)] = number
        except (AttributeError, TypeError, PicklingError) as error:  # Dask pickles at once
            raise cannot_be_pickled(error) from error
        for future in as_completed(futures):
            ended(futures[future], _outcome(future))
    finally:
        for future in futures:
            future.cancel()


def _outcome(future: "Future[Outcome]") -> Outcome:
    try:
        return future.result()
    except CannotBeginError:
        raise
    except Exception as error:  # for instance BrokenProcessPool, or KilledWorker of Dask
        return Outcome({}, float("nan"), error)
