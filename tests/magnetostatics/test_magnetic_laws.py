"""Magnetic laws H(B): what every law obeys, what tables are refused, and files."""

import warnings

import numpy as np
import pytest
from helpers.examples import examples
from helpers.steel import STEEL
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Law, Table, read_bh
from kohonen_adapt.magnetostatics.materials.laws import flux_density_of, reluctivities

MU0 = 4e-7 * np.pi
LAWS = [Brauer(100.0, 10.0, 1.8), Froehlich(4000.0, 2.1), Arctan(2000.0, 1.9), Table(STEEL)]
ids = [type(law).__name__ for law in LAWS]
B = np.linspace(0.0, 4.0, 401)


@pytest.mark.parametrize("law", LAWS, ids=ids)
def test_a_law_rises_from_zero_and_is_never_less_permeable_than_vacuum(law):
    assert isinstance(law, Law)
    strength, slope = law.field_strength(B), law.slope(B)
    assert strength[0] == 0.0 and np.all(np.diff(strength) > 0.0)
    assert np.all(slope > 0.0) and slope.max() <= 1 / MU0 * (1 + 1e-12)
    assert slope[-1] == pytest.approx(1 / MU0, rel=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=ids)
def test_slope_and_energy_are_derivative_and_integral(law):
    # Not across the places where the slope jumps: the end of the table.
    steps = np.diff(law.field_strength(B)) / np.diff(B)
    low, high = np.minimum(law.slope(B[:-1]), law.slope(B[1:])), np.maximum(law.slope(B[:-1]), law.slope(B[1:]))
    inside = (steps >= 0.95 * low) & (steps <= 1.05 * high)
    assert np.count_nonzero(~inside) <= (3 if isinstance(law, Table) else 0)
    for b in (0.3, 1.45, 2.0, 3.5):
        knots = [0.4, 0.9, 1.3, 1.5, 1.7, 1.9, 2.1, 2.25, getattr(law, "end", 1.0)]
        wanted = quad(lambda x: float(law.field_strength(np.float64(x))), 0.0, b, points=knots, limit=200)[0]
        assert float(law.energy(np.float64(b))) == pytest.approx(wanted, rel=1e-7)


@pytest.mark.parametrize("law", LAWS, ids=ids)
def test_the_inverse_of_a_law(law):
    b = np.array([0.0, 0.01, 1.0, 1.9, 2.5, 30.0])
    np.testing.assert_allclose(flux_density_of(law, law.field_strength(b)), b, rtol=1e-12, atol=0)


def test_laws_have_their_formulas():
    np.testing.assert_allclose(LAWS[0].field_strength(np.float64(1.5)), 1.5 * (100 + 10 * np.exp(1.8 * 1.5**2)))
    assert LAWS[0].end == pytest.approx(2.1608, abs=5e-5)
    h = LAWS[1].field_strength(np.float64(1.5))
    assert 4000 * MU0 * h / (1 + 4000 * MU0 * h / 2.1) == pytest.approx(1.5, rel=1e-12)
    h = LAWS[2].field_strength(np.float64(1.5))
    polarisation = 2 * 1.9 / np.pi * np.arctan(np.pi * 1999 * MU0 * h / (2 * 1.9))
    assert MU0 * h + polarisation == pytest.approx(1.5, rel=1e-12)


def test_a_table_goes_through_its_points_and_on_from_its_end():
    law = Table(STEEL)
    b, h = np.array(STEEL).T
    np.testing.assert_allclose(law.field_strength(b), h, rtol=1e-12)
    assert law.end == 2.25
    assert law.field_strength(np.float64(3.25)) == pytest.approx(h[-1] + 1 / MU0, rel=1e-12)
    assert law == Table([(0.0, 0.0), *STEEL]) and hash(law) == hash(Table(STEEL))


def test_a_table_that_falls_below_vacuum_is_continued_from_there():
    law = Table([*STEEL, (2.3, 4e5)])  # 230 kA/m for 50 mT; vacuum needs 40
    assert 2.1 < law.end < 2.3
    assert law.field_strength(np.float64(2.3)) < 4e5
    assert law.slope(np.float64(2.29)) == pytest.approx(1 / MU0)


@given(
    st.lists(st.tuples(st.floats(1e-3, 0.5), st.floats(1e-3, 1.0)), min_size=2, max_size=12).filter(
        lambda steps: sum(step for step, _ in steps) < 1.6
    )
)
@examples(60)
def test_any_rising_table_is_a_rising_law(steps):
    points = np.cumsum([(db, share * db / MU0) for db, share in steps], axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            law = Table(points)
        except ValueError:  # of a start less permeable than vacuum
            assume(False)
    b = np.linspace(0.0, 1.5 * points[-1, 0], 500)
    assert np.all(np.diff(law.field_strength(b)) > 0.0) and np.all(law.slope(b) > 0.0)
    assert np.all(law.slope(b) <= 1 / MU0 * (1 + 1e-9))
    assert np.all(np.diff(law.energy(b)) > 0.0)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(1.0, 100.0)], r"bh must have at least two points besides \(0, 0\); got 1\. For a constant permeability"),
        ([(0.5, 50.0), (1.0, 40.0)], r"strictly increasing from \(0, 0\); 0\.5 T, 50 A/m precedes 1 T, 40 A/m\."),
        ([(-0.5, -50.0), (0.5, 50.0)], r"strictly increasing from \(0, 0\); 0 T, 0 A/m precedes -0\.5 T, -50 A/m\."),
        ([(0.5, 50.0), (1.0, np.nan)], r"bh must be finite; row 1 is \[1\.0, nan\]\."),
        ([1.0, 2.0], r"bh must have shape \(n, 2\), columns B in T and H in A/m; got \(2,\)\."),
        (
            [(1e-3, 1e4), (2e-3, 3e4)],
            r"less permeable than vacuum from its start, 0\.001 T at 10000 A/m\. B must be in",
        ),
        ("steel", r"bh must be numbers of shape \(n, 2\), columns B in T and H in A/m; got 'steel'\."),
        (
            [(1e4 * b, h / 79.577) for b, h in STEEL],
            r"polarisation B - mu0 H up to 2\.\d+e\+04 T, .*\(1 gauss = 1e-4 T\)",
        ),
        (
            [(1e3 * b, h) for b, h in STEEL],  # millitesla
            r"polarisation B - mu0 H up to .*: B must be in tesla",
        ),
        (
            [(b, h / 1e3) for b, h in STEEL],  # kiloampere per metre
            r"relative permeability up to .* more than any steel: H must be in A/m",
        ),
        ([(h, b) for b, h in STEEL], r"polarisation B - mu0 H up to 1\.7e\+05 T, .* first column"),
        (
            [(b, h / 79.577) for b, h in STEEL],
            r"relative permeability up to 4\.\d+e\+05 and reaches 2\.25 T, .* oersted",
        ),
    ],
)
def test_wrong_tables_are_named(points, message):
    with pytest.raises(ValueError, match=message):
        Table(points)


def test_a_table_that_ends_early_warns():
    with pytest.warns(UserWarning, match=r"ends at 1\.3 T, 300 A/m far from saturation \(relative differential perm"):
        Table(STEEL[:3])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Table(STEEL)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (Brauer, (-1.0, 10.0, 1.8), r"k1 of Brauer must be a finite number >= 0; got -1\.0\."),
        (Brauer, (100.0, 0.0, 1.8), r"k2 of Brauer must be a finite number > 0; got 0\.0\."),
        (Brauer, (100.0, 10.0, np.inf), r"k3 of Brauer must be a finite number > 0; got inf\."),
        (
            Brauer,
            (1e6, 10.0, 1.8),
            r"k1 \+ k2 of Brauer, the reluctivity at B = 0, must be below that of vacuum, 795775",
        ),
        (
            Froehlich,
            (1.0, 2.0),
            r"permeability of Froehlich, relative and at B = 0, must be a finite number > 1; got 1\.",
        ),
        (Arctan, ("iron", 2.0), r"permeability of Arctan, relative and at B = 0, must .* got 'iron'\."),
    ],
)
def test_wrong_laws_are_named(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(*arguments)


@pytest.mark.parametrize(
    "text",
    [
        "B (T),H (A/m)\n0.5,100\n1.5,1e3\n2.0,3e4\n",
        "# a steel\nH;B\n100;0,5\n1000;1,5\n30000;2\n",
        "0.5 100\n\n1.5\t1000\n2.0 30000",
        "\ufeff0.5, 100,\n1.5, 1000,\n2.0, 30000,\n",
    ],
)
def test_files_of_points(tmp_path, text):
    path = tmp_path / "steel.csv"
    path.write_text(text, encoding="utf-8")
    assert read_bh(path) == Table([(0.5, 100.0), (1.5, 1000.0), (2.0, 3e4)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.5,100\n1.5,steel\n", r"line 2: expected two numbers, B in T and H in A/m; got '1\.5,steel'\."),
        ("0.5,100,3\n", r"line 1: expected two numbers"),
        ("B,H\n0.5,100\n1.5,1000\n1.4,2000\n", r"1\.5 T, 1000 A/m precedes 1\.4 T, 2000 A/m\."),
        ("B (G),H (Oe)\n5000,1\n15000,12\n20000,400\n", r"B must be in tesla \(1 gauss = 1e-4 T\).* oersted"),
    ],
)
def test_wrong_files_are_named(tmp_path, text, message):
    path = tmp_path / "steel.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_bh(path)


def measured(seed, noise):
    """B and H of a law with noise in both, in another order, and the law."""
    rng, law = np.random.default_rng(seed), Froehlich(4000.0, 2.0)
    b = np.concatenate([np.linspace(0.05, 1.9, 40), np.linspace(1.95, 2.3, 20)])
    points = np.column_stack([b, law.field_strength(b)]) * (1.0 + noise * rng.standard_normal((60, 2)))
    return rng.permutation(points), law


@pytest.mark.parametrize("noise", [0.002, 0.01, 0.03])
def test_measured_points_with_noise_are_smoothed_to_the_law_within_a_few_times_their_noise(noise):
    errors = []
    for seed in range(5):
        points, law = measured(seed, noise)
        table = Table(points, smooth=True)
        assert np.all(np.diff(table.points, axis=0) > 0.0) and table.points[0] == (0.0, 0.0)
        assert np.all(table.slope(B) > 0.0) and table.slope(B).max() <= 1 / MU0 * (1 + 1e-12)
        h = np.geomspace(20.0, 2e5, 100)
        errors.append(np.abs(flux_density_of(table, h) / flux_density_of(law, h) - 1.0).max())
    assert np.median(errors) < 5.0 * noise


def test_noise_in_a_file_is_refused_with_its_remedy(tmp_path):
    path = tmp_path / "steel.csv"
    path.write_text("H, B\n60, 0.4\n120, 0.91\n125, 0.9\n300, 1.3\n1000, 1.5\n17000, 1.9\n75000, 2.1\n")
    with pytest.raises(ValueError, match=r"0\.91 T, 120 A/m precedes 0\.9 T, 125 A/m\..*read_bh\(path, smooth=True\)"):
        read_bh(path)
    b, h = np.transpose(read_bh(path, smooth=True).points)
    np.testing.assert_allclose(b[1:4], [0.4, 0.905, 1.3])
    np.testing.assert_allclose(h[1:4], [60.0, 122.5, 300.0])


def test_a_hysteresis_loop_is_not_smoothed():
    with pytest.raises(ValueError, match=r"B and H of at least 0; got -0\.5 T, -50 A/m"):
        Table([(-0.5, -50.0), (0.5, 50.0), (1.0, 90.0)], smooth=True)


@pytest.mark.parametrize("law", [Brauer(100.0, 10.0, 1.8), Froehlich(4000.0, 2.1), Arctan(2000.0, 1.9)], ids=str)
def test_energies_of_weak_fields_are_no_rounding(law):
    b = np.geomspace(1e-12, 1e-5, 50)
    np.testing.assert_allclose(law.energy(b), 0.5 * b * law.field_strength(b), rtol=1e-5)


def test_the_energy_of_froehlich_is_the_same_from_both_sides_of_its_series():
    law = Froehlich(4000.0, 2.1)
    b = 0.021 * (1.0 + np.array([-1e-7, 1e-7]))
    below, above = law.energy(b)
    assert above - below == pytest.approx(law.field_strength(np.float64(0.021)) * (b[1] - b[0]), rel=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=ids)
def test_reluctivities_have_one_limit_at_zero(law):
    secant, differential = reluctivities(law, np.array([0.0, 1e-12, 1e-6]))
    np.testing.assert_allclose(secant, differential[0], rtol=1e-5)
    np.testing.assert_allclose(differential, differential[0], rtol=1e-4)
