"""The figure of a sweep: a panel for every output, a curve for every combination of the other parameters."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.plotting import sweep_figure

THREAD = ThreadPoolExecutor(1)


def swept(function, **cases):
    return ka.sweep(function, cases, executor=THREAD)


def test_every_output_over_the_first_parameter():
    result = swept(lambda x, y, name: {"sum": x + y, "product": x * y}, x=[3, 1, 2], y=[0.5, 1.5], name=["a", "b"])
    panels = sweep_figure(result).axes
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in panels] == [("x", "sum"), ("x", "product")]
    curves = {line.get_label(): line.get_xydata() for line in panels[1].lines}
    assert set(curves) == {f"y = {y}, name = {name}" for y in (0.5, 1.5) for name in "ab"}
    assert_array_equal(curves["y = 1.5, name = a"], [[1.0, 1.5], [2.0, 3.0], [3.0, 4.5]])


def test_errors_are_bars():
    result = swept(lambda x: {"y": x**2, "error of y": -0.1 * x, "asked error of y": 1.0, "kind": "text"}, x=[1.0, 2.0])
    (axes,) = sweep_figure(result).axes
    bars = axes.collections[0].get_segments()
    assert_allclose(bars, [[[1.0, 0.9], [1.0, 1.1]], [[2.0, 3.8], [2.0, 4.2]]])


def test_cases_with_errors_leave_gaps():
    (axes,) = sweep_figure(swept(lambda x: 1 / x, x=[-1.0, 0.0, 1.0])).axes
    assert_array_equal(axes.lines[0].get_ydata(), [-1.0, np.nan, 1.0])


def test_a_legend_names_ten_curves_at_most():
    (axes,) = sweep_figure(swept(lambda x, y: x + y, x=[1, 2], y=range(40))).axes
    named = [text.get_text() for text in axes.get_legend().get_texts()]
    assert len(axes.lines) == 40 and len(named) == 10
    assert named[0] == "y = 0" and named[-1] == "y = 39"


def test_texts_are_categories_in_their_order(tmp_path):
    figure = sweep_figure(swept(lambda steel: float(len(steel)), steel=["M400", "C", "AB"]))
    figure.savefig(tmp_path / "figure.png")
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["M400", "C", "AB"]


def test_four_outputs_take_two_rows():
    assert len(sweep_figure(swept(lambda x: dict.fromkeys("abcd", x), x=[1, 2])).axes) == 4


def test_nothing_to_draw():
    with pytest.raises(ValueError, match="must have outputs to be drawn"):
        sweep_figure(swept(lambda x: 1 / 0, x=[1, 2]))
