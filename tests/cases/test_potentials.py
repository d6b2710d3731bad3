"""Potentials of a case: expressions mean what Python means by them, and what is none is refused where it begins."""

import re
from ast import literal_eval

import numpy as np
import pytest
from helpers.examples import examples
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from kohonen_adapt.cases.potentials import POTENTIAL

X = np.array([[0.3, -2.0, 0.0], [0.7, 5.0, 0.0]])

numbers = st.sampled_from(["2", "0.3", ".5", "3.", "1e-3", "2.5E+2", "0"])
divisors = st.sampled_from(["2", "0.25", "4e-1"])
spaces = st.sampled_from(["", " ", "  "])


@st.composite
def products(draw):
    """One factor of x or y at most, numbers before and after it, divided by numbers."""
    factors = draw(st.lists(numbers, min_size=1, max_size=3))
    if draw(st.booleans()):
        factors[draw(st.integers(0, len(factors) - 1))] = draw(st.sampled_from(["x", "y", "-x", "+ -y"]))
    space = draw(spaces)
    text = f"{space}*{space}".join(factors)
    return text + "".join(f"{space}/{divisor}" for divisor in draw(st.lists(divisors, max_size=2)))


@st.composite
def sums(draw):
    text = draw(st.sampled_from(["", "-", "+", " - "])) + draw(products())
    for product in draw(st.lists(products(), max_size=4)):
        text += f"{draw(spaces)}{draw(st.sampled_from('+-'))}{draw(spaces)}{product}"
    return text


def value_of(text):
    read = POTENTIAL(text, "potential.rim")
    return read(X) if callable(read) else np.full(3, read)


@examples(300)
@given(sums())
def test_an_expression_means_what_it_means_in_python(text):
    meant = [eval(text.strip(), {}, {"x": x, "y": y}) for x, y in X.T]
    assert_allclose(value_of(text), meant, rtol=1e-9, atol=1e-6)


@examples(300)
@given(sums(), st.integers(0, 60), st.sampled_from(list("#(xy)^e,°") + ["**", "*x*y", "/x", "/0", "sin"]))
def test_what_is_refused_is_at_the_character_that_it_names(text, place, wrong):
    spoilt = text[:place] + wrong + text[place:]
    try:
        value_of(spoilt)
    except ValueError as error:
        found = re.match(
            r"potential\.rim must have .* at character (\d+); got (its end|'.*'|\".*\")\. Write", str(error)
        )
        assert found, error
        rest = spoilt.strip()[int(found[1]) - 1 :]
        assert rest == "" if found[2] == "its end" else rest.startswith(literal_eval(found[2]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("2x", "an expression at character 1; got '2x'"),
        ("0,3*x", "a number, x or y at character 1; got '0,3*x'"),
        ("x*y", "a number, as it must be linear in x and y, at character 3; got 'y'"),
        ("3 / x", "a number, as it must be linear in x and y, at character 5; got 'x'"),
        ("x/0.0", "a number other than 0 at character 3; got '0.0'"),
        ("2*(x - 1)*y", "a number, as it must be linear in x and y, at character 11; got 'y'"),
        ("x**2", "a number, x or y at character 1; got 'x**2'"),
        ("x + 1j", "a number, x or y at character 5; got '1j'"),
        ("x + True", "a number, x or y at character 5; got 'True'"),
        (" ", "an expression at character 1; got its end"),
        ("y - open(1)", "a number, x or y at character 5; got 'open(1)'"),
        ("(" * 400 + "x" + ")" * 400, "an expression at character 201; got '(((((((((((((((((((('"),
    ],
)
def test_what_is_no_expression(text, said):
    with pytest.raises(ValueError) as refusal:
        POTENTIAL(text, "potential.rim")
    assert str(refusal.value).startswith(f"potential.rim must have {said}. Write a sum of x and y ")


@pytest.mark.parametrize("text", ["1e999*x", "1e300*1e300*y", "1e-300/1e300/1e300*1e999"])
def test_numbers_must_be_finite(text):
    with pytest.raises(ValueError, match=re.escape(f"potential.rim must have finite numbers; got {text!r}.")):
        POTENTIAL(text, "potential.rim")


def test_a_constant_is_a_number():
    assert [POTENTIAL(text, "p") for text in ("0", "2*3 - 1", "x - x")] == [0.0, 5.0, 0.0]


def test_a_table_is_linear_between_its_points_and_ends_with_them():
    read = POTENTIAL({"over": "y", "points": [[0, 1], [2, 5.0], [3.0, 4]]}, "p")
    x = np.array([[9.0, 9.0, 9.0, 9.0], [0.0, 1.0, 2.5, 3.0 + 1e-12]])
    assert_allclose(read(x), [1.0, 3.0, 4.5, 4.0])
    for outside in (-0.1, 3.1):
        with pytest.raises(ValueError, match=f"the table reaches from y = 0 to 3 m, .* has a node at {outside:g} m"):
            read(np.array([[0.0], [outside]]))


@pytest.mark.parametrize("points", [[], [[0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]])
def test_points_of_a_table_rise(points):
    with pytest.raises(ValueError, match=r"p: points must be two pairs \[x, A\] at least, x rising"):
        POTENTIAL({"over": "x", "points": points}, "p")
