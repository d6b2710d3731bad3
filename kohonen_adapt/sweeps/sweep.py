"""Compute a function of many cases in other processes or on other machines, keeping what is finished."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager, nullcontext
from os import PathLike
from pickle import PicklingError
from typing import Any

from kohonen_adapt.checks import check_hook
from kohonen_adapt.kernels.threads import number_of_threads
from kohonen_adapt.sweeps.cases import Case, list_cases
from kohonen_adapt.sweeps.folder import SweepFolder
from kohonen_adapt.sweeps.outcome import Outcome, compute
from kohonen_adapt.sweeps.pool import CannotBeginError, LocalPool, cannot_be_pickled, check_pickled
from kohonen_adapt.sweeps.result import SweepResult, tabulated

__all__ = ["sweep"]


def sweep(
    function: Callable[..., Any],
    cases: Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]],
    *,
    executor: Executor | None = None,
    folder: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> SweepResult:
    """Call a function with every case, several at a time.

    Parameters
    ----------
    function
        Called as ``function(**case)``; it returns a number, or a mapping of names to numbers. What it raises is the
        error of its case and ends nothing else.
    cases
        A mapping for every case, all with the same keys; or a mapping of names to sequences of values for the grid of
        them, whose last parameter changes fastest. Values are numbers, texts or truth values.
    executor
        Who computes. None: processes of this machine, started by spawn when everything is compiled, each with its share
        of the threads; the function must stand at the top level of a module or script. Else any
        ``concurrent.futures.Executor``, which stays open: of a Dask client that is ``client.get_executor()``.
    folder
        Where every case that finishes is kept in a file. What is there is not computed again; cases with errors are.
    progress
        Called as ``progress(done, count)`` at the beginning and after every case.

    Returns
    -------
    SweepResult
        Parameters, outputs and seconds of every case, in the order of the cases.

    Raises
    ------
    ValueError
        If an argument is not as above, the function cannot be sent to other processes or is not found there, or the
        folder holds files of another function, of other cases, or damaged ones. Of functions the code is compared, of
        other callables the data; what they call is not looked at.
    OSError
        If the folder cannot be read or written to.
    KeyboardInterrupt
        At Ctrl-C: processes of this machine are ended at once, and what is finished is in the folder.

    Notes
    -----
    Processes of this machine import the script that began them: it begins a sweep below ``if __name__ == "__main__":``.
    They share the threads that ``NUMBA_NUM_THREADS`` allows, and end with this process, however that ends. One that
    dies, as for want of memory, is the error of its case, and another takes its place. Where this process was killed,
    the same call with the same folder computes what is missing, and gives the table that it would have given.

    On a cluster every machine needs this package and the module of the function, and compiles for itself, once. Without
    a shared disk the function must bring its meshes along. Cases that Dask loses with a worker it gives to another one.

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

    On a cluster, by Dask (``pip install "kohonen-adapt[sweep]"``):

    >>> from distributed import Client  # doctest: +SKIP
    >>> with Client("tcp://scheduler:8786") as client:  # doctest: +SKIP
    ...     result = ka.sweep(product, {"x": range(100), "y": [0.5]}, executor=client.get_executor(), folder="cases")
    """
    listed = list_cases(cases)
    _check(function, executor, progress)
    kept = None if folder is None else SweepFolder.at(folder, function, listed)
    outcomes = kept.finished(len(listed)) if kept else {}

    def told() -> None:
        if progress:
            progress(len(outcomes), len(listed))

    def ended(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        if kept and outcome.error is None:
            kept.keep(number, outcome)
        told()

    told()
    missing = {number: case for number, case in enumerate(listed) if number not in outcomes}
    if missing:
        with _open(executor, len(missing)) as engine:
            _compute(engine, function, missing, ended)
    return tabulated(listed, [outcomes[number] for number in range(len(listed))])


def _check(function: Any, executor: Any, progress: Any) -> None:
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


def _open(executor: Executor | None, count: int) -> AbstractContextManager[Executor]:
    """The executor, which its owner will close, or a pool of this sweep."""
    return LocalPool(min(count, number_of_threads())) if executor is None else nullcontext(executor)


def _compute(
    executor: Executor, function: Callable[..., Any], cases: Mapping[int, Case], ended: Callable[[int, Outcome], Any]
) -> None:
    """Compute cases, and tell of each that has ended with its number; what is still waiting ends with this."""
    futures: dict[Future[Outcome], int] = {}
    try:
        for number, case in cases.items():
            futures[_submitted(executor, function, case)] = number
        for future in as_completed(futures):
            ended(futures[future], _outcome(future))
    finally:
        for future in futures:
            future.cancel()


def _submitted(executor: Executor, function: Callable[..., Any], case: Case) -> "Future[Outcome]":
    try:
        return executor.submit(compute, function, case)
    except (AttributeError, TypeError, PicklingError) as error:  # Dask pickles at once
        raise cannot_be_pickled(error) from error


def _outcome(future: "Future[Outcome]") -> Outcome:
    """What came of a case, also where the executor lost it."""
    try:
        return future.result()
    except CannotBeginError:
        raise
    except Exception as error:  # such as BrokenProcessPool and Dask's KilledWorker
        return Outcome({}, float("nan"), error)
