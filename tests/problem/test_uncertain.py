"""Errors and corrections of values by better values that have an error of their own."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kohonen_adapt.loop.figures import OutputValue
from kohonen_adapt.problem.uncertain import Uncertain, corrected, doubts_of, error_of, shifted

NUMBERS, PARTS = st.floats(-1e3, 1e3), st.floats(-1.0, 1.0)


@given(NUMBERS, NUMBERS, st.floats(0.0, 1e3), PARTS)
def test_within_the_doubt_half_the_error_is_told_and_no_correction_makes_it_worse(value, better, doubt, part):
    exact, slack = better + part * doubt, 1e-9
    error = error_of(value, Uncertain(better, doubt))
    assert abs(error) >= 0.5 * abs(exact - value) - slack
    assert abs(corrected(value, error, error.doubt) - exact) <= abs(value - exact) + slack


@pytest.mark.parametrize(
    ("doubt", "wanted"), [(0.0, 2.0), (0.5, 2.0), (0.75, 1.5), (1.0, 1.0)], ids=["none", "half", "more", "all"]
)
def test_a_correction_shrinks_to_nothing_from_twice_its_doubt_on(doubt, wanted):
    assert OutputValue(1.0, 1.0, doubt).corrected == wanted
    assert OutputValue(-1.0, -1.0, doubt).corrected == -wanted
    assert OutputValue(1.0, None, doubt).corrected is None


def test_a_number_keeps_its_doubt_where_it_is_shifted_or_copied():
    number = Uncertain(2.0, -0.5)
    again = pickle.loads(pickle.dumps(number))
    assert [(float(each), each.doubt) for each in (number, again)] == [(2.0, 0.5)] * 2
    assert (shifted(number, 1.0), shifted(number, 1.0).doubt, shifted(2.0, 1.0).doubt) == (3.0, 0.5, 0.0)
    assert doubts_of({"a": number, "b": 1.0, "c": None, "d": Uncertain(1.0, 0.0)}) == {"a": 0.5}
