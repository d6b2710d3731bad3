"""The report: one file that carries all it shows, says what happened, and takes no name for more than text."""

import base64
import hashlib
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from helpers.examples import examples
from helpers.mesh_files import two_boxes
from helpers.reports import (
    CUT,
    HOSTILE,
    a_mesh,
    a_pass,
    a_result,
    before_and_after,
    hostile_report,
    solid_report,
    unpacked,
)
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Status
from kohonen_adapt.display import lattice
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.slicing import flat
from kohonen_adapt.report import write_report
from kohonen_adapt.report.scene import packed
from kohonen_adapt.report.summary import key_figures, without_folders
from kohonen_adapt.report.writing import filled_page

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


class Page(HTMLParser):
    """Elements of a page with their attributes, and its texts by element."""

    def __init__(self, path):
        super().__init__()
        self.elements, self.texts, self.open = [], [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self.open.append(tag)

    def handle_endtag(self, tag):
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, text):
        self.texts.append((self.open[-1] if self.open else "", text))

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]

    def text_of(self, tag):
        return [text for name, text in self.texts if name == tag]

    @property
    def data(self):
        return json.loads(next(text for text in self.text_of("script") if text.startswith("{")))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return Page(hostile_report(tmp_path_factory.mktemp("report"), pictures={HOSTILE: PNG}))


def test_held_nodes_are_counted_and_marked(page):
    rows = page.texts[next(k for k, (_, text) in enumerate(page.texts) if text == "nodes after") :]
    cells = [text for tag, text in rows if tag in ("th", "td")]
    assert cells[1:4] == [f"pinned by {HOSTILE}", "9", "9"]
    assert page.data["reasons"] == [f"pinned by {HOSTILE}"]
    for mesh, result in zip(page.data["meshes"], before_and_after(), strict=True):
        assert_array_equal(unpacked(mesh["held"]["node"]), np.flatnonzero(result.mesh.p[0] == 0.0))
        assert not unpacked(mesh["held"]["reason"]).any()


def test_a_cut_has_the_table_alone(tmp_path):
    page = Page(solid_report(tmp_path))
    assert page.data["reasons"] == [] and "held" not in page.data["meshes"][0]
    assert any("corner of" in text for tag, text in page.texts if tag == "th")


def test_a_report_without_reasons_hides_their_table(tmp_path):
    page = Page(hostile_report(tmp_path, held=None))
    assert "hidden" in next(each for each in page.of("section") if each.get("id") == "held")
    assert page.data["reasons"] == []


def test_the_file_needs_nothing_else(page):
    for tag, attributes in page.elements:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            assert attributes.get(name, "data:").startswith("data:"), (tag, name)
        assert not any(name.startswith("on") or name == "style" for name in attributes)
    assert not page.of("iframe") and not page.of("object")
    style = "".join(page.text_of("style"))
    assert "url(" not in style and "@import" not in style
    script = page.text_of("script")[-1]
    assert not re.search(r"https?:|fetch\(|XMLHttpRequest|WebSocket|import\(|innerHTML|eval\(", script)


def test_the_policy_lets_act_what_is_in_the_file_and_nothing_else(page):
    (policy,) = [each["content"] for each in page.of("meta") if each.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["base-uri"] == rules["form-action"] == "'none'"
    for name, text in (("style-src", "".join(page.text_of("style"))), ("script-src", page.text_of("script")[-1])):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules[name] == f"'sha256-{digest}'"


def test_names_are_text_wherever_they_stand(page):
    assert [each for each in page.of("img") if each.get("src") == "x"] == []
    assert len(page.of("img")) == 1 and page.of("img")[0]["alt"] == HOSTILE
    for tag in ("title", "h1", "h3", "p", "th", "dt", "figcaption", "pre"):
        assert HOSTILE in page.text_of(tag), tag
    assert len(page.of("script")) == 2
    names = next(field["names"] for field in page.data["fields"] if field["label"] == "subdomain")
    assert set(names) == {"left", HOSTILE}


@examples(30)
@given(st.text())
def test_any_text_leaves_the_page_as_it_was_built(text):
    """Whatever a title, a name or a setting holds, the elements of the page are the same."""
    mesh = a_mesh(1)
    result = a_result(mesh, [a_pass(0, mesh, 1.0, {text: 1.0})])
    wanted = re.findall(r"<[a-z!/][a-z0-9]*", html_with("plain", result))
    assert re.findall(r"<[a-z!/][a-z0-9]*", html_with(text, result)) == wanted


def html_with(text, result):
    return filled_page(
        title=text, summary=[text], figures=[(text, text)], result=result, pictures={text: PNG},
        held=[(text, "1", "2")],
        settings={text: text}, data={"name": text},
    ).decode()  # fmt: skip


def test_meshes_and_fields_come_back_as_they_went_in(page):
    for mesh, result in zip(page.data["meshes"], before_and_after(), strict=True):
        p = np.array([unpacked(mesh["x"]), unpacked(mesh["y"])]) + np.array(mesh["centre"])[:, None]
        assert_allclose(p, result.mesh.p, atol=1e-7)
        assert_array_equal(unpacked(mesh["t"]).reshape(3, -1), result.mesh.t)
        values = dict(zip([field["label"] for field in page.data["fields"]], mesh["values"], strict=True))
        assert_allclose(unpacked(values[f"x (m) {HOSTILE}"]), result.mesh.p[0], atol=1e-7)
        assert_allclose(unpacked(values["error indicator of an element"]), result.indicators, rtol=2.0**-16)
        names = next(field["names"] for field in page.data["fields"] if field["label"] == "subdomain")
        left = np.array(names)[unpacked(values["subdomain"])] == "left"
        assert_array_equal(np.flatnonzero(left), np.sort(result.mesh.subdomains["left"]))


@given(st.lists(st.floats(width=32), min_size=1, max_size=20))
def test_coarse_floats_are_near_and_what_is_not_finite_stays_so(values):
    back = unpacked(packed(values, "f4", coarse=True))
    values = np.array(values, dtype=np.float32)
    small = np.abs(values) < 1e38  # beyond, what is rounded up may be infinite
    assert_array_equal(np.isnan(back), np.isnan(values))
    assert_array_equal(back[np.isinf(values)], values[np.isinf(values)])
    assert_allclose(back[small], values[small], rtol=2.0**-16, atol=2.0**-140)


def test_outlines_are_the_rim_and_the_interface(page):
    ends = unpacked(page.data["meshes"][0]["outline"]).reshape(-1, 2)
    x, y = a_mesh().p[:, ends].mean(axis=2)
    assert len(ends) == 32 + 8
    assert np.all((x == 0.5) | (x == 0.0) | (x == 1.0) | (y == 0.0) | (y == 1.0))


def test_one_scale_for_before_and_after(page):
    scales = {field["label"]: field for field in page.data["fields"]}
    indicator = scales["error indicator of an element"]
    assert (indicator["scale"], indicator["low"], indicator["high"]) == ("log", pytest.approx(2e-3), 2.0)
    potential = scales[f"x (m) {HOSTILE}"]
    assert (potential["at"], potential["low"], potential["high"]) == ("node", 0.0, 1.0)
    assert scales["size, root of the area (m)"]["scale"] == "log"
    assert next(iter(scales)) == "middle (m)"


def test_the_table_has_every_column_that_print_shows(page):
    _, after = before_and_after()
    printed = str(after).splitlines()[0].split()
    shown = " ".join(page.text_of("th"))
    assert all(word in shown for word in printed)
    rows = page.of("tr")[1:3]
    assert [row.get("class") for row in rows] == [None, "result"]


def test_the_summary_says_how_it_ended(page):
    assert f"1 relocation was made. Done with {HOSTILE}." in page.text_of("p")


def test_the_headline_is_the_goal_and_the_ending_is_in_words():
    first, last = (a_pass(k, a_mesh(), 2.0 - k, {}) for k in (0, 1))
    goal = {"goal_unit": "N", "energy_norm": None, "calibrated": False}
    history = [replace(first, goal=-133.4, **goal), replace(last, goal=-133.0, goal_error=0.0125, **goal)]
    found = a_result(last.mesh, history)
    figures = key_figures(found)
    assert figures[:5] == [
        ("goal", "-133.000 N"),
        ("error of the goal", "0.013 N"),
        ("goal + error", "-132.988 N"),
        ("estimate before", "4 N"),
        ("estimate after", "1 N"),
    ]
    assert "max passes" not in dict(figures).values()
    assert dict(figures)["ending"] == "maximum number of passes"


def test_a_result_without_energy_norm_pictures_names_and_fields(tmp_path):
    mesh = MeshTri().refined(2)
    problem = type("Flat", (), {"solve": lambda self, mesh: None, "indicators": lambda self, mesh, _: np.zeros(32)})()
    result = ka.adapt(mesh, problem, passes=2)
    write_report(tmp_path / "report.html", result, before=result, unit="")
    page = Page(tmp_path / "report.html")
    assert result.status is Status.CONVERGED
    assert "tolerance met" in page.text_of("dd")
    assert {"0", "25"} <= set(page.text_of("dd"))
    assert page.data["fields"][0] | {"above": False, "below": False} == {
        "label": "error indicator of an element", "kind": "values", "at": "element",
        "scale": "linear", "low": 0.0, "high": 1.0, "above": False, "below": False,
    }  # fmt: skip
    assert page.data["fields"][-1]["names"] == ["no name"]
    assert not page.of("figure")


def test_values_that_are_not_finite_do_not_spoil_the_scale(tmp_path):
    def spoilt(solution):
        return np.where(solution == 0.5, np.nan, np.where(solution == 0.0, np.inf, solution))

    page = Page(hostile_report(tmp_path, point_data={"spoilt": spoilt}))
    field = next(field for field in page.data["fields"] if field["label"] == "spoilt")
    assert (field["low"], field["high"]) == (0.125, 1.0)


def test_it_says_with_what_it_was_made(page):
    assert f"kohonen_adapt {ka.__version__}" in page.text_of("p")
    told = page.text_of("dt")
    assert {"kohonen_adapt", "Python", "numpy", "scipy", "scikit-fem", "numba", "threads"} <= set(told)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ('mesh = "/home/me/meshes/core.msh"', 'mesh = "core.msh"'),
        ("bh = 'C:\\\\Users\\\\me\\\\steel.csv'", "bh = 'steel.csv'"),
        ('mesh = "~/core one.msh"', 'mesh = "core one.msh"'),
        ('mesh = "/home/my name/core.msh"', 'mesh = "core.msh"'),
        ("kohonen-adapt run /tmp/x/case.toml --out /srv/out", "kohonen-adapt run case.toml --out out"),
        ("# H in A/m, 3/4 of it, examples/core.msh", "# H in A/m, 3/4 of it, examples/core.msh"),
    ],
)
def test_folders_of_absolute_paths_are_left_out(given, wanted):
    assert without_folders(given) == wanted


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize("divisions", [1, 2, 5])
def test_the_page_interpolates_on_the_lattice_of_every_element(divisions, tmp_path):
    """`planesOf` of the page, by node: the values at all points of the lattice, and linear functions everywhere."""
    mesh, rng = a_mesh(2), np.random.default_rng(0)
    share = lattice(divisions)[0]
    values = rng.random((share.shape[1], mesh.nelements))
    x = np.einsum("iq,dik->dqk", share, mesh.p[:, mesh.t])
    towards = x.mean(axis=1, keepdims=True)
    middle = np.einsum("iq,dik->dqk", lattice(7)[0], mesh.p[:, mesh.t])
    asked = {
        "x": mesh.p[0].tolist(),
        "y": mesh.p[1].tolist(),
        "nodes": mesh.t.ravel().tolist(),
        "count": mesh.nelements,
    }
    cases = [(values, x + 1e-9 * (towards - x)), (2.0 * x[0] - 3.0 * x[1] + 1.0, middle)]
    (tmp_path / "cases.json").write_text(json.dumps([asked, [[v.ravel().tolist(), p.tolist()] for v, p in cases]]))
    script = (Path(ka.__file__).parent / "report" / "meshes.js").read_text(encoding="utf-8")
    (tmp_path / "run.js").write_text(
        f"""{script}
        const [mesh, cases] = JSON.parse(require("fs").readFileSync("cases.json"));
        console.log(JSON.stringify(cases.map(([values, [x, y]]) => {{
          const {{planes, planeAt}} = planesOf(mesh, values, "lattice");
          return x.map((row, q) => row.map((px, e) => {{
            const k = planeAt(e, px, y[q][e]);
            return planes[k] + planes[k + 1] * px + planes[k + 2] * y[q][e];
          }}));
        }})));"""
    )
    printed = subprocess.run(["node", "run.js"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    found = json.loads(printed)
    assert_allclose(found[0], values, atol=1e-7)
    assert_allclose(found[1], 2.0 * middle[0] - 3.0 * middle[1] + 1.0, atol=1e-12)


def test_lattices_of_any_orders_are_packed_and_marked(tmp_path):
    before, _ = before_and_after()
    t = before.mesh.t
    values = {"inside (m)": lambda solution: np.einsum("iq,ik->qk", lattice(4)[0], solution[t])}
    data = Page(hostile_report(tmp_path, cell_data=values, point_data=values)).data
    about = [field for field in data["fields"] if field["label"] == "inside (m)"]
    assert [field["at"] for field in about] == ["lattice", "lattice"] and [f.get("lines") for f in about] == [
        None,
        True,
    ]
    packed_values = unpacked(data["meshes"][0]["values"][0])
    assert_allclose(packed_values.reshape(15, -1), values["inside (m)"](before.solution), rtol=2.0**-16, atol=1e-9)


def test_a_field_that_is_linear_in_every_element_is_shown_by_its_corners(tmp_path):
    before, after = before_and_after()
    t = before.mesh.t
    values = {"inside (m)": lambda solution: solution[t] + np.arange(t.shape[1])}
    data = Page(hostile_report(tmp_path, cell_data=values)).data
    assert data["fields"][0]["at"] == "lattice" and data["fields"][0]["high"] > 100.0
    for mesh, result in zip(data["meshes"], (before, after), strict=True):
        wanted = result.mesh.p[0][t] + np.arange(t.shape[1])
        assert_allclose(unpacked(mesh["values"][0]).reshape(3, -1), wanted, rtol=2.0**-16)
    with pytest.raises(ValueError, match=r"^b must have shape \(k, nelements\) = \(k, 128\) .*; got \(2, 128\)\.$"):
        hostile_report(tmp_path, cell_data={"b": lambda solution: np.ones((2, 128))})


def test_tetrahedra_are_shown_in_a_cut(tmp_path):
    path, mesh = solid_report(tmp_path), two_boxes(1)
    data, cut = Page(path).data, flat(mesh, CUT)
    shown = data["meshes"][0]
    assert data["axes"] == ["x", "z"] and len(unpacked(shown["edges"])) == 2 * len(cut.sides)
    assert_array_equal(unpacked(shown["elements"]), cut.element)
    values = dict(zip([field["label"] for field in data["fields"]], shown["values"], strict=True))
    assert_allclose(unpacked(values["x (m)"]), cut.mesh.p[0], atol=1e-7)
    assert_allclose(unpacked(values["quality (1: regular, 0: flat)"]), ka.quality(mesh)[cut.element], rtol=2.0**-16)
    sizes = np.cbrt(area(mesh))[cut.element]
    assert_allclose(unpacked(values["size, cube root of the volume (m)"]), sizes, rtol=2.0**-16)
    names = np.array(next(field["names"] for field in data["fields"] if field["label"] == "subdomain"))
    assert set(names[unpacked(values["subdomain"])]) == {"low", "low, left", "upper half", "upper half, left"}


def test_tetrahedra_need_a_plane(tmp_path):
    with pytest.raises(ValueError, match="shown in a cut"):
        solid_report(tmp_path, plane=None)


def test_wrong_input(tmp_path):
    with pytest.raises(ValueError, match=r"x must have shape \(nnodes,\) = \(81,\); got \(3,\)"):
        hostile_report(tmp_path, point_data={"x": lambda solution: np.ones(3)})
    with pytest.raises(ValueError, match=r"b must have shape \(nelements,\) = \(128,\); got \(81,\)"):
        hostile_report(tmp_path, cell_data={"b": lambda solution: solution})
    with pytest.raises(ValueError, match=r"pictures must be PNG or GIF files; 'A' begins with b'<svg"):
        hostile_report(tmp_path, pictures={"A": b"<svg onload=alert(1)>"})
    with pytest.raises(ValueError, match="unit must be one of '', 'm', 'mm'; got 'inch'"):
        hostile_report(tmp_path, unit="inch")
    assert list(tmp_path.iterdir()) == []


def test_no_input_is_modified(tmp_path):
    before, after = before_and_after()
    kept = [each.tobytes() for result in (before, after) for each in (result.mesh.p, result.mesh.t, result.indicators)]
    write_report(tmp_path / "report.html", after, before=before, cell_data={"one": lambda solution: np.ones(128)})
    now = [each.tobytes() for result in (before, after) for each in (result.mesh.p, result.mesh.t, result.indicators)]
    assert now == kept
