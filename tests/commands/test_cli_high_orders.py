"""Orders above 3 in cases: run, resume, sweep, and careless uses."""

import json

import meshio
import numpy as np
import pytest
from helpers.cases import INSET, case_in, report_in, run_command, run_in, table_of
from helpers.meshes import inset
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case

CASE = INSET.replace("scale = 1e-3\n", "scale = 1e-3\norder = 5\n")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A case and the folder of its run; only to be looked at."""
    return run_in(tmp_path_factory.mktemp("high"), CASE)


def test_the_last_pass_has_the_order_of_the_case(finished):
    rows = table_of(finished.parent / "out" / "history.csv")
    assert [row["order"] for row in rows] == ["2", "2", "2", "5"]
    assert int(rows[-1]["unknowns"]) > 4 * int(rows[-2]["unknowns"])
    assert (rows[-1]["moved"], rows[-1]["splits"], rows[-1]["polish_gain"]) == ("0", "0", "0.0")
    case = read_case(finished)
    result = ka.adapt(
        fitting_mesh(case), case.problem, outputs=case.labelled_outputs, **case.options(fitting_mesh(case))
    )
    assert result.best.estimate == float(rows[-1]["estimate"])
    mesh = ka.read_mesh(finished.parent / "out" / "adapted.msh", scale=1e-3)
    assert_allclose(mesh.p, result.mesh.p, rtol=1e-12, atol=1e-15)


def test_the_field_inside_elements_is_written_at_its_order(finished):
    out = finished.parent / "out"
    inside, mesh = meshio.read(out / "inside.vtu"), ka.read_mesh(out / "adapted.msh", scale=1e-3)
    (cells,) = inside.cells
    assert cells.type == "VTK_LAGRANGE_TRIANGLE" and cells.data.shape == (mesh.nelements, 21)
    field = read_case(finished).problem.solve(mesh)
    some = cells.data[::7, 15:].ravel()  # inside elements
    x = inside.points[some, :2].T
    for name, wanted in {"A (Wb per m)": field.potential_at(x), "B_x (T)": field.flux_density_at(x)[0]}.items():
        assert_allclose(inside.point_data[name][some], wanted, atol=1e-7 * np.abs(wanted).max())
    mean = ka.read_field(out / "inside.vtu", mesh, "B_y (T)")
    assert_allclose(mean, field.flux_density[1], atol=1e-7 * np.abs(mean).max())


@pytest.mark.slow
def test_a_resumed_run_draws_pictures_and_shows_the_input_at_the_order_of_the_passes(finished, capsys):
    out = finished.parent / "out"
    assert run_command("run", finished, "--resume", out) == 0
    pictures = ["adaptation.png", "density.png", "quality.png", "estimate.png", "outlines.png", "passes.gif"]
    assert {file.name for file in out.iterdir() if file.suffix in (".png", ".gif")} == set(pictures)
    assert capsys.readouterr().out.endswith(f"history.csv, {', '.join(pictures)}, report.html.\n")
    report = report_in(out)
    assert report.count("<img ") == 6 and f"<td>{table_of(out / 'history.csv')[0]['nodes']}</td>" in report


@pytest.mark.slow
def test_around_an_axis_the_report_has_the_flux_function_inside_elements(out, tmp_path):
    axis = CASE.replace("order = 5", "order = 4\naxisymmetric = true").replace("passes = 2", "passes = 0")
    mesh = inset(8)
    case_in(tmp_path, axis.replace("[potential]\nouter = 0.0", "[potential]\nrim = 0.0"))
    rim = mesh.with_boundaries({"rim": lambda x: (x[0] > 1e-9) | (x[1] < 1e-9) | (x[1] > mesh.p[1].max() - 1e-9)})
    ka.write_mesh(tmp_path / "mesh.msh", rim)
    assert run_command("run", tmp_path / "case.toml", "--out", out) == 0
    report = report_in(out)
    text = report[report.index('{"unit"') :]
    fields = json.JSONDecoder().raw_decode(text)[0]["fields"]
    assert [field["at"] for field in fields if field.get("lines")] == ["lattice", "lattice"]
    assert fields[1]["label"] == "flux function r A (Wb)" and fields[0]["at"] == "lattice"
