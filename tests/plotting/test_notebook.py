"""What a notebook shows of results and meshes, and that the tour runs."""

import json
import re
from xml.etree import ElementTree

import pytest
from helpers.places import ROOT
from helpers.worlds import without_matplotlib
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

HOSTILE = "<script>alert('&')</script>"


def parsed(html):
    """The elements of a piece of HTML that must be well-formed, by their names."""
    found = {}
    for element in ElementTree.fromstring(f"<div>{html}</div>").iter():
        found.setdefault(element.tag, []).append(element)
    return found


def cells_of(html):
    return [["".join(cell.itertext()) for cell in row] for row in parsed(html)["tr"]]


@pytest.fixture(scope="module")
def result():
    mesh = MeshTri().refined(4).with_defaults()
    mesh = mesh.with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    materials = {"coil": Material(current_density=1e6), "air": Material()}
    problem = Magnetostatics(materials, potential={"left": 0.0}, order=1)
    return ka.adapt(mesh, problem, passes=2, outputs={HOSTILE: lambda field: field.energy})


def test_a_result_is_the_printed_table_with_the_best_pass_in_bold(result):
    html, printed = result._repr_html_(), str(result)
    titles, *rows = cells_of(html)
    assert len(rows) == len(result.history) and all(len(row) == len(titles) for row in rows)
    assert all(cell in printed for row in (titles, *rows) for cell in row)
    bold = ["bold" in row.get("style", "") for row in parsed(html)["tr"]]
    assert bold == [False, *(step.mesh is result.mesh for step in result.history)]
    assert result.message in result._repr_html_()


def test_names_are_text_whatever_they_hold(result):
    html = result._repr_html_()
    assert "script" not in parsed(html) and HOSTILE in cells_of(html)[0]


def test_a_result_is_shown_without_matplotlib(result, monkeypatch):
    """It is a table; pictures are drawn by who asks for them, as the tour does."""
    without_matplotlib(monkeypatch)
    html = result._repr_html_()
    assert "img" not in parsed(html) and len(cells_of(html)) == 4


def test_a_mesh_shows_itself_as_scikit_fem_draws_it(result):
    svg = result.mesh._repr_svg_()
    assert svg.startswith("<svg") and svg.count("<line") >= result.mesh.facets.shape[1]


def test_what_is_long_has_a_short_name(result):
    assert re.fullmatch(r"<Pass 1: estimate [\d.e+]+, 289 nodes, min quality 0\.\d\d>", repr(result.history[1]))
    assert re.fullmatch(r"<Field on 289 nodes: \|B\| up to [\d.]+ T, energy [\d.e+]+ J/m>", repr(result.solution))
    assert repr(ka.KohonenMap(result.mesh, topology="fixed")) == "<KohonenMap of 289 neurons, fixed edges>"
    assert repr(ka.KohonenMap(result.mesh)) == "<KohonenMap of 289 neurons, edges flip>"


TOUR = ROOT / "examples" / "tour.ipynb"


def test_the_tour_holds_no_outputs():
    cells = [cell for cell in json.loads(TOUR.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert cells and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)


@pytest.mark.slow
def test_the_tour_runs_and_every_cell_shows_something(monkeypatch):
    """By a kernel of its own, as a person's."""
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    client = pytest.importorskip("nbclient")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel has its own
    notebook = nbformat.read(TOUR, as_version=4)
    client.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(TOUR.parent)}}).execute()
    shown = [cell["outputs"][-1]["data"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    mesh, result, meshes, field, lines, relocated, schedule, layers, torque, machine, gripper, by_metric = shown
    assert mesh["image/svg+xml"] != relocated["image/svg+xml"]
    assert "<table>" in result["text/html"] and "Field of order 2 on" in field["text/plain"]
    assert all("image/png" in each for each in (meshes, lines, layers, machine))
    assert "unit='N m/m'" in torque["text/plain"] and "Converged" in gripper["text/plain"]
    assert by_metric["image/svg+xml"] != relocated["image/svg+xml"]
    assert "Stage(radius=2" in schedule["text/plain"]
