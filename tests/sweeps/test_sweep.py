"""A sweep computes every case on any executor, says what went wrong with which, and prints as a table."""

import csv
import functools
import os
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from helpers import swept
from helpers.processes import output_with, python, wait_until
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import precompile
from kohonen_adapt.sweeps.pool import LocalPool

THREAD = ThreadPoolExecutor(1)


def here(function, cases, **options):
    return ka.sweep(function, cases, executor=THREAD, **options)


# ---- cases and table ----


def test_a_grid_has_every_combination_the_last_parameter_first():
    result = here(swept.product, {"x": [1, 2, 3], "y": np.array([0.5, 1.5])})
    assert result.table.dtype.names == ("x", "y", "product", "sum", "seconds")
    assert_array_equal(result.table["x"], [1, 1, 2, 2, 3, 3])
    assert_array_equal(result.table["y"], [0.5, 1.5] * 3)
    assert_array_equal(result.table["product"], result.table["x"] * result.table["y"])
    assert result.parameters == ("x", "y") and result.outputs == ("product", "sum")
    assert result.errors == (None,) * 6 and (result.table["seconds"] >= 0.0).all()


def test_a_number_without_a_name_is_the_value():
    assert_array_equal(here(swept.square, {"x": [2, 3]}).table["value"], [4.0, 9.0])


def test_values_may_be_texts_and_truth_values():
    result = here(lambda name, deep, mixed: len(name) + deep, {"name": ["a", "bcd"], "deep": [True], "mixed": [1, "b"]})
    assert [result.table[name].dtype.kind for name in result.parameters] == ["U", "b", "O"]
    assert_array_equal(result.table["value"], [2.0, 2.0, 4.0, 4.0])


@pytest.mark.parametrize(
    ("cases", "said"),
    [
        ({}, "got none"),
        ([], "got none"),
        ({"x": []}, "got none"),
        (7, "a sequence of mappings, or a mapping"),
        ("x", "a sequence of mappings, or a mapping"),
        ([3], "case 0 must be a mapping of parameters to values; got 3"),
        ([{}], "case 0 must be a mapping"),
        ({"x": 3}, r"cases\['x'\] must be a sequence of values; got 3. One value is a list of one."),
        ({"x": "abc"}, r"cases\['x'\] must be a sequence"),
        ([{"x": 1}, {"y": 1}], "same parameters: case 0 has x, and case 1 has y"),
        ([{"x": (1, 2)}], r"case 0: x must be a number, some text, or true or false; got \(1, 2\)"),
        ([{"x": None}], "case 0: x must be"),
        ([{"seconds": 1}], "other than 'seconds'"),
        ([{3: 1}], "a name that is some text"),
    ],
)
def test_what_are_no_cases(cases, said):
    with pytest.raises(ValueError, match=said):
        here(swept.square, cases)


@pytest.mark.parametrize(
    ("arguments", "options", "said"),
    [
        (("square", {"x": [1]}), {}, "function must be one that takes the parameters of a case; got 'square'"),
        ((swept.square, {"x": [1]}), {"executor": "dask"}, r"client.get_executor\(\)"),
        ((swept.square, {"x": [1]}), {"progress": 3}, "progress must be a function of the number of cases"),
        ((swept.square, {"x": [1]}), {"executor": THREAD, "folder": 3}, "folder must be the path of a folder"),
    ],
)
def test_what_are_no_arguments(arguments, options, said):
    with pytest.raises(ValueError, match=said):
        ka.sweep(*arguments, **options)


def test_progress_counts_all_cases():
    told = []
    here(swept.square, {"x": [1, 2, 3]}, progress=lambda done, count: told.append((done, count)))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]


# ---- errors ----


def test_a_failing_case_ends_no_sweep():
    result = here(swept.fails_at_two, {"x": [1, 2, 3]})
    assert_array_equal(result.table["value"], [1.0, np.nan, 3.0])
    one, two, three = result.errors
    assert one is None and three is None
    assert isinstance(two, KeyError) and two.args == ("two",)
    assert 'raise KeyError("two")' in two.__notes__[-1]  # where it came from, also from another process


def test_what_a_function_may_return():
    result = here(swept.returns, {"x": [1, 2, 3, 4, 5, 6, 7, 8]})
    said = [str(error) for error in result.errors]
    assert said[0] == "the function must return a number, or names and their numbers or texts; got 'text'."
    assert said[1].endswith("got {'a': None}.") and said[4].endswith("got None.")
    assert "otherwise than parameters and seconds; got 'seconds'" in said[2] and "got 'x'" in said[3]
    assert result.errors[5] is None and result.table["value"][5] == 0.5 and result.errors[6] is None
    assert isinstance(result.errors[7], KeyError)


def test_texts_are_outputs_with_a_name(tmp_path):
    def kind(x):
        return {"kind": "even" if x % 2 == 0 else "odd", "half": x / 2} if x else 1 / 0

    for _ in range(2):  # from the function and from the folder
        result = here(kind, {"x": [1, 0, 2]}, folder=tmp_path)
        assert result.table["kind"].tolist() == ["odd", "", "even"]
        assert_array_equal(result.table["half"], [0.5, np.nan, 1.0])
    assert str(result).splitlines()[2].split()[:4] == ["1", "0", "-", "-"]


def test_a_table_where_nothing_went_well():
    result = here(swept.unsendable, {"x": [1, 2]})
    assert result.table.dtype.names == ("x", "seconds") and result.outputs == ()
    assert [str(error) for error in result.errors] == ["UnsendableError: 1 and 2"] * 2
    assert len(str(result).splitlines()) == 5


# ---- what it looks like ----


def test_it_prints_as_a_table_and_then_the_errors():
    lines = str(here(swept.fails_at_two, {"x": [1.25, 2, 3]})).splitlines()
    assert lines[0].split() == ["case", "x", "value", "seconds"]
    assert lines[1].split()[:3] == ["0", "1.25", "1.25"] and lines[2].split()[:3] == ["1", "2", "-"]
    assert lines[4:] == ["case 1: KeyError: 'two'"]


def test_values_with_errors_have_the_digits_that_these_allow():
    lines = str(
        here(lambda x: {"y": 1.0 / x, "error of y": 1e-3, "asked error of y": 0.01}, {"x": [3, 0]})
    ).splitlines()
    assert lines[1].split()[:5] == ["0", "3", "0.3333", "0.001", "0.01"]
    assert lines[2].split()[:5] == ["1", "0", "-", "-", "-"]


def test_many_columns_are_no_wider_than_a_terminal():
    outputs = {f"output number {k}": float(k) for k in range(20)}
    lines = str(here(lambda x: outputs, {"x": [1, 2]})).splitlines()
    assert len(lines) > 6 and max(map(len, lines)) <= 120
    assert sum("output number" in line for line in lines) == len(lines) / 3


def test_csv_holds_every_digit_and_the_errors(tmp_path):
    result = here(swept.fails_at_two, {"x": [1 / 3, 2.0]})
    result.to_csv(tmp_path / "sweep.csv")
    with (tmp_path / "sweep.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["x", "value", "seconds", "error"]
    assert float(rows[0]["value"]) == 1 / 3 and rows[0]["error"] == ""
    assert rows[1]["value"] == "nan" and rows[1]["error"] == "KeyError: 'two'"
    assert float(rows[1]["seconds"]) == result.table["seconds"][1]


# ---- processes of this machine ----


def test_local_processes_compute_the_same_and_find_everything_compiled():
    before, cases = dict(os.environ), {"x": [1, 2], "y": [0.5, 1.5]}
    local, threaded = ka.sweep(swept.relocated, cases), here(swept.relocated, cases)
    for name in ("x", "y", "moved"):
        assert_array_equal(local.table[name], threaded.table[name])
    assert len(set(local.table["moved"])) == 4
    assert_array_equal(local.table["compiled"], 0)
    assert os.environ == before


def test_before_they_begin_all_is_compiled_that_is_not_kept(monkeypatch):
    begun = []
    monkeypatch.setattr(precompile, "warmup", lambda: begun.append("now"))
    for missing, wanted in [(None, []), ("walk_each", ["now"])]:
        monkeypatch.setattr(precompile, "is_cached", lambda loop, types, missing=missing: loop.__name__ != missing)
        precompile.compile_missing()
        assert begun == wanted


THREADS = """
from helpers import swept
import kohonen_adapt as ka
for cases in (8, 2, 1):
    print(ka.sweep(swept.threads, {"x": range(cases)}).table["value"].tolist())
"""


@pytest.mark.slow
def test_local_processes_share_the_threads():
    """Four threads, as the environment says: not more processes than cases, and each has its share."""
    said = output_with(THREADS, NUMBA_NUM_THREADS="4")
    assert said.splitlines()[-3:] == [str([1.0] * 8), str([2.0] * 2), str([4.0])]


def test_a_process_that_dies_takes_its_own_case_with_it():
    result = ka.sweep(swept.dies_at_two, {"x": [1, 2, 3, 4]})
    assert_array_equal(result.table["value"], [1.0, np.nan, 3.0, 4.0])
    assert str(result.errors[1]) == "the process that computed it ended with exit code -9."
    assert [error for error in result.errors if error] == [result.errors[1]]


def test_an_exception_that_cannot_be_sent_is_told():
    (error,) = ka.sweep(swept.unsendable, {"x": [1]}).errors
    assert type(error) is RuntimeError and str(error) == "UnsendableError: 1 and 2"


@pytest.mark.parametrize("count", [0, 2.5, True])
def test_what_is_no_number_of_processes(count):
    with pytest.raises(ValueError, match="processes must be an integer >= 1"):
        LocalPool(precompile.compile_missing, count)


def nested(function):
    return lambda x: function(x)


class Locked:
    """Cannot be pickled by anybody."""

    def __init__(self):
        self.lock = threading.Lock()

    def __call__(self, x):
        return x


@pytest.mark.parametrize("function", [lambda x: x, nested(swept.square), Locked()], ids=["lambda", "nested", "lock"])
def test_a_function_that_cannot_be_pickled_is_refused_with_the_remedy(function):
    with pytest.raises(ValueError, match=r"can be pickled: .* top level of a module .* ThreadPoolExecutor\(1\)"):
        ka.sweep(function, {"x": [1]})
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor,
        pytest.raises(ValueError, match="can be pickled"),
    ):
        ka.sweep(function, {"x": [1]}, executor=executor)
    assert here(function, {"x": [1]}).errors == (None,)


def script_fails(code, tmp_path, *command):
    """The last line that a script writes, which ends with an error."""
    (tmp_path / "script.py").write_text(code)
    return python(*(command or [tmp_path / "script.py"]), status=1).stderr.splitlines()[-1]


TYPED = "import kohonen_adapt as ka\ndef f(x): return x\nka.sweep(f, {{'x': range({})}})"


@pytest.mark.slow
def test_a_function_that_only_stands_at_a_prompt_is_refused_with_the_remedy(tmp_path):
    said = script_fails("", tmp_path, "-c", TYPED.format(1))
    assert "ValueError: function must be one" in said.replace(
        "kohonen_adapt.sweeps.pool.CannotBeginError", "ValueError"
    )
    assert "Define it at the top level of a module" in said


@pytest.mark.slow
def test_a_script_without_its_guard_is_refused_with_the_remedy(tmp_path):
    assert 'only below `if __name__ == "__main__":`' in script_fails(TYPED.format(9), tmp_path)


# ---- other executors ----


@pytest.mark.slow
def test_processes_of_somebody_elses():
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        result = ka.sweep(swept.square, {"x": [1, 2, 3]}, executor=executor)
        assert executor.submit(abs, -1).result() == 1  # it stays open
        assert_array_equal(result.table["value"], [1.0, 4.0, 9.0])
        lost = ka.sweep(swept.dies_at_two, {"x": [2, 3]}, executor=executor)
    assert "BrokenProcessPool" in {type(error).__name__ for error in lost.errors}


@pytest.mark.slow
def test_dask_goes_on_when_one_of_two_workers_is_killed(tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        before = {worker.pid for worker in cluster.workers.values()}
        function = functools.partial(swept.dies_once, folder=str(tmp_path))
        result = ka.sweep(function, {"x": range(20)}, executor=client.get_executor(), folder=tmp_path / "cases")
        assert (tmp_path / "died").exists()
        assert result.errors == (None,) * 20
        assert_array_equal(result.table["square"], np.arange(20.0) ** 2)
        assert len(before) == 2 and before & set(result.table["process"])
        wait_until(lambda: {worker.pid for worker in cluster.workers.values()} - before - {None})  # one in its place
        again = ka.sweep(function, {"x": range(20)}, folder=tmp_path / "cases")  # here, and nothing is left to do
        assert_array_equal(again.table, result.table)
        with pytest.raises(ValueError, match="can be pickled"):
            ka.sweep(Locked(), {"x": [1]}, executor=client.get_executor())
        with pytest.raises(ValueError, match=r"client.get_executor\(\)"):
            ka.sweep(swept.square, {"x": [1]}, executor=client)
