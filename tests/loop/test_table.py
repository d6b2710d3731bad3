"""Tables of passes: their layout, their columns, and where a new field of a record goes by itself."""

from dataclasses import replace

import pytest
from helpers.stand_ins import MESH, Script, adapt, script_of

from kohonen_adapt.display import by_error
from kohonen_adapt.loop.result import table_columns


def plain(result):
    """The result with every pass of the same duration and quality."""
    same = {"seconds": {"solve": 1.0, "relocate": 0.5}, "min_quality": 0.871, "mean_quality": 0.9}
    history = tuple(replace(step, **same) for step in result.history)
    return replace(result, history=history)


def test_the_table():
    assert str(plain(adapt(MESH, Script([4.0, 2.0, 3.0]), passes=2, topology="flip"))).splitlines() == [
        "pass  nodes  estimate  change %  Energy-norm error %  Energy error %  Delta Energy %",
        "   0     25     4.000         -                40.00           16.00               -",
        "   1     25     2.000     -50.0                20.00            4.00           +0.00  <- best",
        "   2     25     3.000     +50.0                30.00            9.00           +0.00",
        "pass  elements  min quality  mean quality  seconds",
        "   0        32         0.87          0.90     1.50",
        "   1        32         0.87          0.90     1.50  <- best",
        "   2        32         0.87          0.90     1.50",
        "Stopped after 2 passes. Best: pass 1, estimated error 20 %. Increase `passes` to continue.",
    ]


def test_the_table_calls_an_estimate_an_indicator_where_nobody_vouches_for_its_scale():
    problem = Script([4.0, 2.0, 3.0], calibrated=False)
    assert str(plain(adapt(MESH, problem, passes=2, topology="flip"))).splitlines()[:2] == [
        "pass  nodes  indicator  change %  Delta Energy %  elements  min quality  mean quality  seconds",
        "   0     25      4.000         -               -        32         0.87          0.90     1.50",
    ]


def test_the_change_of_an_output_is_that_of_its_size():
    """A force that becomes weaker falls, whichever way it points; one that turns round has no percentage."""
    outputs = {"pull": script_of(-5.18, -5.08, 5.0, 6.0, 0.0)}
    result = adapt(MESH, Script([5.0, 4.0, 3.0, 2.0, 1.0]), passes=4, outputs=outputs)
    columns = dict(table_columns(result.history)[2])
    assert columns["Delta %"] == ["-", "-1.93", "sign", "+20.00", "-100.00"]


@pytest.mark.parametrize("number", [0, 1, 2, 3, 8])
def test_the_table_fits_into_120_columns_and_has_every_output(number):
    outputs = {f"output {k}": script_of(-1.23456789, -1.23456e-7) for k in range(number)}
    *rows, _message = str(adapt(MESH, Script([4.0, 2.0]), passes=1, outputs=outputs)).splitlines()
    assert max(map(len, rows)) <= 120
    titles = "  ".join(rows[::3])
    assert titles.count("Delta %") == number and all(name in titles for name in outputs)
    assert all(row.startswith(("pass  ", "   0  ", "   1  ")) for row in rows)


@pytest.mark.parametrize(
    ("norms", "functionals", "wanted"),
    [
        ((10.0, 20.0, 10.0), (None,) * 3, ["-", "+300.00", "-75.00"]),
        ((None,) * 3, (-4.0, -5.0, -5.0), ["-", "-25.00", "+0.00"]),
        ((None,) * 3, (None,) * 3, None),
    ],
)
def test_delta_energy_is_the_change_of_the_squared_energy_norm_or_of_the_functional(norms, functionals, wanted):
    history = adapt(MESH, Script([4.0, 3.0, 2.0]), passes=2).history
    known = zip(history, norms, functionals, strict=True)
    found = tuple(replace(step, energy_norm=norm, functional=value) for step, norm, value in known)
    columns = dict(column for part in table_columns(found) for column in part)
    assert columns.get("Delta Energy %") == wanted
    assert ("Energy-norm error %" in columns) == (norms[0] is not None)


def test_repr_is_short():
    result = adapt(MESH, Script([4.0, 2.0]), passes=1)
    assert len(repr(result)) < 300
    assert repr(result.history[0]) == "<Pass 0: estimate 4, 25 nodes, min quality 0.87>"


def test_the_table_shows_what_was_done_to_the_mesh_of_a_pass_and_a_dash_for_the_input():
    result = plain(adapt(MESH, Script([4.0, 2.0, 3.0]), passes=2, topology="flip"))
    first, second, third = result.history
    history = (
        replace(first, functional=-1.0),
        replace(second, functional=-3.0, polish_gain=1.5, splits=3),
        replace(third, functional=-3.5, collapses=4),
    )
    *_, done = table_columns(history)
    assert done == [
        ("elements", ["32", "32", "32"]),
        ("min quality", ["0.87"] * 3),
        ("mean quality", ["0.90"] * 3),
        ("seconds", ["1.50"] * 3),
        ("gain of map", ["-", "0.50", "0.50"]),
        ("gain of polish", ["-", "1.5", "0.0"]),
        ("splits", ["-", "3", "0"]),
        ("collapses", ["-", "0", "4"]),
    ]
    assert [title for title, _ in table_columns(result.history)[-1]] == [
        "elements",
        "min quality",
        "mean quality",
        "seconds",
    ]


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (-0.74301742, 0.0067, "-0.7430"),
        (-0.74301742, -2e-4, "-0.74302"),
        (-133.4, 0.0125, "-133.400"),
        (123456.0, 2e4, "123456"),  # no exponent below a million
        (0.002, 1.0, "0.0020"),
        (1.0 / 3.0, 1e-12, "0.33333333"),
        (1.0 / 3.0, 0.0, "0.33333333"),
        (0.0, 0.1, "0.0"),
        (2.0, None, "2.0000"),
    ],
)
def test_numbers_have_the_digits_that_their_error_allows(value, error, text):
    assert by_error(value, error) == text
