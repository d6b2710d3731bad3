"""Cases: what TOML means, what is refused and how, and that nothing hostile gets past with another error."""

import math
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers.cases import whole
from helpers.examples import examples
from helpers.meshes import disk
from helpers.places import EXAMPLES
from hypothesis import given
from hypothesis import strategies as st

from kohonen_adapt import Arc, Line, Spline, write_mesh
from kohonen_adapt.cases import case_of, fitting_mesh, read_case
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Magnetostatics, Material, Table

CONTRACT = """
mesh = "c_core.msh"
scale = 1e-3
[materials.iron]
permeability = 1000.0
[materials.magnet]
permeability = 1.05
remanence = [0.0, 1.2]
[materials.air]
[potential]
outer = 0.0
[adapt]
passes = 4
min_quality = 0.3
"""

EVERYTHING = """
mesh = "sub/m.msh"
depth = 0.1
order = 2
estimator = "residual"
open_boundary = "rim"
periodic = [["left", "right"]]
antiperiodic = [["low", "high"]]
[materials]
coil = {}
air = {current_density = 1}
magnet = {coercivity = [1e5, 0]}
points = {bh = [[1.0, 500], [1.5, 3000], [1.9, 20000], [2.2, 200000]]}
brauer = {bh = {law = "brauer", k1 = 50.0, k2 = 10, k3 = 1.5}}
froehlich = {bh = {law = "froehlich", permeability = 2000, saturation = 2.0}}
arctan = {bh = {law = "arctan", permeability = 2000, saturation = 2.0}}
[potential]
outer = 1
[ampere_turns]
coil = 100
[adapt]
passes = 3
rtol = 0.01
atol = 0
topology = "flip"
min_quality = "auto"
pinned = ["coil", 3]
seed = 7
polish = false
target_nodes = 5000
layers = {air = 2}
output_rtol = 0.01
[adapt.curves]
round = {curve = "arc", centre = [1, 0.0], radius = 2}
straight = {curve = "line", start = [0, 0], end = [1, 1]}
bent = {curve = "spline", points = [[0, 0], [1, 1], [2, 0]], closed = true}
[outputs]
fx = {quantity = "force", body = "coil", component = "x"}
fy = {quantity = "force", body = ["coil", "air"], component = "y"}
t = {quantity = "torque", body = "coil", centre = [1, 2]}
psi = {quantity = "flux_linkage", coil = "coil", turns = 10}
w = {quantity = "energy"}
wc = {quantity = "coenergy"}
"""


NOT_ONLY_NUMBERS = """
mesh = "m.msh"
rim = "edge"
goal = {quantity = "force", body = ["coil", "air"], direction = [0, 1]}
[materials]
coil = {remanence = {pattern = "radial", magnitude = 1.2, centre = [0, 1]}}
air = {coercivity = {pattern = "halbach", magnitude = 9e5, pole_pairs = -2}}
iron = {remanence = {pattern = "parallel", magnitude = 1.2, degrees = 30}}
[potential]
edge = "0.3*x - y/2 + 2e-3"
left = {over = "x", points = [[0, 1], [1, 2.5]]}
[adapt.schedule]
stages = [{radius = 1, epochs = 2, learning_rate = [0.4, 0.1]}, {radius = 0, epochs = 1, learning_rate = 0.1}]
sweeps = 3
[outputs]
b = {quantity = "flux_density", at = [0, 1], component = "x", recovered = true}
a = {quantity = "potential", at = [0, 1]}
"""


def case(text, folder=Path("there")):
    return case_of(tomllib.loads(text), folder)


def changed(old, new):
    assert old in CONTRACT
    return CONTRACT.replace(old, new)


def test_the_case_of_the_contract():
    it = case(CONTRACT)
    assert it.mesh == Path("there") / "c_core.msh" and it.scale == 1e-3
    assert it.problem.materials == {
        "iron": Material(permeability=1000.0),
        "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)),
        "air": Material(),
    }
    assert it.problem.potential == {"outer": 0.0}
    assert it.adapt == {"passes": 4, "min_quality": 0.3} and it.outputs == {}


def test_every_key():
    it = case(EVERYTHING)
    problem = it.problem
    assert (problem.depth, problem.order, problem.open_boundary) == (0.1, 2, "rim")
    assert problem.periodic == (("left", "right"),) and problem.antiperiodic == (("low", "high"),)
    laws = {name: each.bh for name, each in problem.materials.items() if each.bh is not None}
    points = Table([(1.0, 500), (1.5, 3000), (1.9, 20000), (2.2, 200000)])
    assert laws == {
        "points": points,
        "brauer": Brauer(50.0, 10.0, 1.5),
        "froehlich": Froehlich(2000.0, 2.0),
        "arctan": Arctan(2000.0, 2.0),
    }
    assert problem.materials["magnet"].coercivity == (1e5, 0.0) and problem.ampere_turns == {"coil": 100.0}
    curves = it.adapt.pop("curves")
    assert (curves["round"], curves["straight"]) == (Arc((1.0, 0.0), 2.0), Line((0.0, 0.0), (1.0, 1.0)))
    assert isinstance(curves["bent"], Spline) and curves["bent"].closed
    assert it.adapt == {
        "passes": 3,
        "rtol": 0.01,
        "atol": 0.0,
        "topology": "flip",
        "min_quality": "auto",
        "pinned": ["coil", 3],
        "seed": 7,
        "polish": False,
        "target_nodes": 5000,
        "layers": {"air": 2},
        "output_rtol": 0.01,
    }
    assert {name: each.bodies for name, each in it.outputs.items()} == {
        "fx": ("coil",),
        "fy": ("coil", "air"),
        "t": ("coil",),
        "psi": ("coil",),
        "w": (),
        "wc": (),
    }


class RecordingField:
    """Stands for a field: says what it was asked."""

    energy, coenergy = 5.0, 6.0

    def force(self, body):
        return np.array([len(body), 10.0 * len(body)])

    def torque(self, body, centre):
        return centre[0] + 10.0 * centre[1]

    def flux_linkage(self, coil, turns):
        return turns * len(coil)


def test_a_curve_that_is_not_that_of_the_mesh_is_refused_before_the_run(tmp_path):
    mesh = whole(disk(4, 0.25))
    write_mesh(tmp_path / "m.msh", mesh)
    text = 'mesh = "m.msh"\n[materials.all]\n[potential]\nrim = 0.0\n[adapt.curves]\nrim = {curve = "arc", '
    right, wrong_one = (case(text + f"centre = [0, 0], radius = {radius}}}", tmp_path) for radius in (0.25, 0.4))
    assert fitting_mesh(right).p.shape == mesh.p.shape
    with pytest.raises(ValueError, match=r"adapt: .*curve"):
        fitting_mesh(wrong_one)


@pytest.mark.parametrize(
    ("symmetry", "per_metre"), [("", "/m"), ("depth = 0.1", ""), ("axisymmetric = true", "")], ids=str
)
def test_outputs_are_totals_only_with_a_depth_or_an_axis(symmetry, per_metre):
    quantities = "[outputs]" + EVERYTHING.partition("[outputs]")[2]
    if "axisymmetric" in symmetry:
        quantities = quantities.replace("fx = ", "# ")
    labels = list(case(f"{symmetry}\n{CONTRACT}{quantities}").labelled_outputs)
    units = {"fx": "N", "fy": "N", "t": "N m", "psi": "Wb", "w": "J", "wc": "J"}
    assert labels == [f"{name} ({unit}{per_metre})" for name, unit in units.items() if f"\n{name} =" in quantities]


def test_outputs_ask_the_field():
    values = {name: each(RecordingField()) for name, each in case(EVERYTHING).outputs.items()}
    assert values == {"fx": 1.0, "fy": 20.0, "t": 21.0, "psi": 10.0, "w": 5.0, "wc": 6.0}


def test_pairs_of_the_field_stay_matched_unless_the_case_says_otherwise():
    pair = '[materials.a]\n[adapt]\nperiodic = [["c", "d"]]'
    it = case(f'mesh = "m"\nantiperiodic = [["a", "b"]]\n{pair}')
    assert it.problem.pairs == (("a", "b"),) and it.adapt["periodic"] == [("c", "d")]


def curve_in(folder, noisy, bh):
    """The curve of a case beside a file with one, which may be noisy."""
    rows = "1.0, 500\n0.9, 600\n" if noisy else "1.0, 500\n"
    (folder / "steel.csv").write_text(f"B, H\n{rows}1.5, 3000\n1.9, 20000\n2.2, 200000\n")
    (folder / "case.toml").write_text(changed("permeability = 1000.0", f"bh = {bh}"))
    return read_case(folder / "case.toml").problem.materials["iron"].bh


def test_a_curve_from_a_file_beside_the_case_is_smoothed_if_the_case_asks(tmp_path):
    assert curve_in(tmp_path, False, '"steel.csv"').points[1] == (1.0, 500.0)
    with pytest.raises(ValueError, match=r"in a case bh = \{file = \"NAME\", smooth = true\}"):
        curve_in(tmp_path, True, '"steel.csv"')
    law = curve_in(tmp_path, True, '{file = "steel.csv", smooth = true}')
    assert law.points[1] == pytest.approx((0.95, 550.0))
    points = "[[1.0, 500], [0.9, 600], [1.5, 3000], [1.9, 20000], [2.2, 200000]]"
    assert curve_in(tmp_path, True, f"{{points = {points}, smooth = true}}") == law


def wrong(old, new, *said):
    return pytest.param(changed(old, new), said, id=new.replace("\n", " ")[:40])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        wrong('mesh = "c_core.msh"', "", "mesh is missing"),
        wrong('mesh = "c_core.msh"', "mesh = 3", "mesh must be text in quotes, or {drawing = "),
        wrong("scale = 1e-3", "scale = nan", "scale must be a finite number; got nan."),
        wrong("scale = 1e-3", "scale = true", "scale must be a finite number; got True."),
        wrong("scale = 1e-3", "scale = 1" + 400 * "0", "scale must be a finite number; got 1000"),
        wrong("scale = 1e-3", "scal = 1e-3", "'scal' is not a key of a case. Did you mean 'scale'? Known: mesh, scale"),
        wrong("scale = 1e-3", "axisymmetric = 1", "axisymmetric must be true or false; got 1."),
        wrong("scale = 1e-3", "order = 9", 'order must be a whole number from 1 to 8, or "auto"; got 9.'),
        wrong(
            "scale = 1e-3",
            'estimator = "residul"',
            "estimator must be one of 'residual', 'recovery', 'equilibrated'; got 'residul'.",
        ),
        wrong(
            "scale = 1e-3",
            'periodic = ["a", "b"]',
            """periodic[0] must be ["name", "name"] or ["name", "name", {motion = ...}]; got 'a'.""",
        ),
        wrong("scale = 1e-3", "depth = 0", "depth must be a finite number > 0 in metres, or None; got 0.0."),
        wrong(
            "permeability = 1000.0",
            "permeabilty = 1000.0",
            "'materials.iron.permeabilty' is not a key of a case. Did you mean 'permeability'? Known in "
            "materials.iron: ",
        ),
        wrong(
            "permeability = 1000.0",
            "permeability = 0",
            "materials.iron: permeability must be positive (relative to vacuum, air 1.0); got 0.0.",
        ),
        wrong(
            "remanence = [0.0, 1.2]",
            "remanence = 1.2",
            "materials.magnet.remanence must be [a finite number, a finite number] or a pattern as {pattern = ",
        ),
        wrong("remanence = [0.0, 1.2]", 'remanence = [0.0, "1"]', "materials.magnet.remanence[1] must be a finite num"),
        wrong("remanence = [0.0, 1.2]", "remanence = [0, 1]\ncoercivity = [0, 1]", "materials.magnet: a magnet has a"),
        wrong("permeability = 1000.0", "bh = 3", "materials.iron.bh must be a list of [B, H], the name of a file, or"),
        wrong(
            "permeability = 1000.0",
            "bh = [[1, 2, 3]]",
            "materials.iron.bh[0] must be [a finite number, a finite number]",
        ),
        wrong("permeability = 1000.0", "bh = [[1, 2]]", "materials.iron.bh: bh must have at least two points besides"),
        wrong("permeability = 1000.0", 'bh = "none.csv"', "materials.iron.bh must name a file with a table of B and H"),
        wrong("permeability = 1000.0", 'bh = "\\u0000"', "materials.iron.bh"),
        wrong("permeability = 1000.0", f'bh = "{"x" * 5000}"', "materials.iron.bh"),
        wrong(
            "permeability = 1000.0",
            "bh = {k1 = 1}",
            "materials.iron.bh.law is missing; it must be one of 'brauer', 'fr",
        ),
        wrong("permeability = 1000.0", 'bh = {law = "bauer"}', "got 'bauer'. Did you mean 'brauer'?"),
        wrong(
            "permeability = 1000.0",
            'bh = {law = "brauer", k1 = 1e9, k2 = 1, k3 = 1}',
            "materials.iron.bh: k1 + k2 of Brauer",
        ),
        wrong(
            "passes = 4",
            "depth = 0.1",
            "'adapt.depth' is not a key",
            "But depth is a key of the case itself: write it above",
        ),
        wrong("scale = 1e-3", "passes = 3", "'passes' is not a key of a case.", "But passes is a key of [adapt]."),
        wrong("outer = 0.0", "outer = 0.0\n[goal]\nbh = 2", "goal.quantity is missing; it must be one of 'force', 't"),
        wrong(
            "outer = 0.0", "outer = 0.0\n[points]\n[outputs.a]\nquantity = 'energy'\nbh = 2", "But bh is a key of [mat"
        ),
        wrong("scale = 1e-3", "goal = 'force'", "goal must be a table with a key quantity, one of 'force', 'torque', "),
        pytest.param('mesh = "m"\nmaterials = {air = 1}', ["materials.air must be a table of keys; got 1."], id="air"),
        wrong(
            "outer = 0.0",
            "outer = true",
            'potential.outer must be a finite number, a linear expression as "0.3*x + 2e-3", or a table as {over = ',
        ),
        wrong("outer = 0.0", 'outer = "2x"', "potential.outer must have an expression at character 1; got '2x'."),
        wrong("outer = 0.0", "", "potential must fix A on at least one boundary"),
        wrong("outer = 0.0", "outer = 0.0\n[ampere_turns]\ncoil = 1", "ampere_turns has 'coil', which is not among"),
        wrong("passes = 4", "passes = 4.0", "adapt.passes must be an integer up to 2147483647; got 4.0."),
        wrong("passes = 4", "curves = {a = {radius = 1}}", "adapt.curves.a.curve is missing; it must be one of 'arc',"),
        wrong(
            "passes = 4",
            'curves = {a = {curve = "line", start = [0, 0], end = [0, 0]}}',
            "adapt.curves.a: start and end",
        ),
        wrong("passes = 4", 'curves = {a = {curve = "spline", points = [[0, 0]]}}', "adapt.curves.a: "),
        wrong(
            "passes = 4",
            'curves = {a = {curve = "spline", points = 3}}',
            "adapt.curves.a.points must be [[a finite number, a finite number], ...]; got 3.",
        ),
        wrong(
            "passes = 4",
            "pinned = [1.5]",
            "adapt.pinned[0] must be an integer up to 2147483647 or text in quotes; got 1.5.",
        ),
        wrong(
            "passes = 4",
            "pinned = 3",
            "adapt.pinned must be [an integer up to 2147483647 or text in quotes, ...] or text",
        ),
        wrong(
            "min_quality = 0.3", "[outputs.f]\nquantity = 'forc'", "outputs.f.quantity must be", "Did you mean 'force'?"
        ),
        wrong("min_quality = 0.3", "[outputs.f]\nquantity = 'force'\nbody = 'a'", "outputs.f.component is missing"),
        wrong(
            "min_quality = 0.3",
            "[outputs.f]\nquantity = 'flux_linkage'\ncoil = []",
            "outputs.f: a body or a coil must be at least one subdomain; got an empty list.",
        ),
    ],
)
def test_a_wrong_case_names_file_and_key(text, said, tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(text)
    with pytest.raises(ValueError) as refusal:
        read_case(file)
    assert str(refusal.value).startswith(f"{file}: ")
    for part in said:
        assert part in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "scale = 1e-3",
            "scale = -1",
            "mesh: scale must be a positive number, 1e-3 for a drawing in millimetres; got -1",
        ),
        ("passes = 4", "passes = -1", "adapt: passes must be an integer >= 0; got -1."),
        ("passes = 4", "layers = {air = 0}", "adapt: layers of subdomain 'air' must be an integer >= 1; got 0."),
        ("passes = 4", "target_nodes = 3", "adapt: target_nodes must be at least the number of nodes of the mesh, 899"),
        ("min_quality = 0.3", "min_quality = 'none'", "adapt.min_quality must be one of 'auto'; got 'none'."),
    ],
)
def test_what_adapt_would_refuse_is_refused_before_the_run(old, new, said):
    with pytest.raises(ValueError) as refusal:
        fitting_mesh(case(changed(old, new), EXAMPLES))
    assert said in str(refusal.value)


def test_one_name_is_pinned_as_a_list_of_it_is():
    for pinned in ('"iron"', '["iron"]'):
        assert case(changed("passes = 4", f"pinned = {pinned}")).pinned == ["iron"]


@pytest.mark.parametrize(
    "content",
    [b"mesh = ", b"\xff\xfe", b"a = " + b"[" * 100_000, b"a = " + b"9" * 5000, b"a = 1\na = 2"],
    ids=["cut", "not UTF-8", "deep", "long", "twice"],
)
def test_what_is_no_toml(content, tmp_path):
    file = tmp_path / "case.toml"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"case\.toml: is not TOML: "):
        read_case(file)


def test_no_file(tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"there is no file '.*case\.toml'\. Create one: kohonen-adapt init MESH"
    ):
        read_case(tmp_path / "case.toml")


def keys_of(text):
    """Every key and text that a case may have somewhere."""

    def words(value):
        if isinstance(value, dict):
            for key, inner in value.items():
                yield key
                yield from words(inner)
        elif isinstance(value, list):
            for inner in value:
                yield from words(inner)
        elif isinstance(value, str):
            yield value

    return sorted(set(words(tomllib.loads(text))))


WORDS = sorted({word for text in (EVERYTHING, CONTRACT, NOT_ONLY_NUMBERS) for word in keys_of(text)})
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**400),
    st.floats(),
    st.dates(),
    st.text(max_size=5),
    st.sampled_from(WORDS),
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=3), inner),
    max_leaves=12,
)


@st.composite
def spoilt_cases(draw):
    """A good case with one place of it replaced by anything."""
    it = tomllib.loads(draw(st.sampled_from([CONTRACT, EVERYTHING, NOT_ONLY_NUMBERS])))
    place = it
    while True:
        key = draw(st.sampled_from(sorted(place)))
        if not isinstance(place[key], dict) or not place[key] or draw(st.booleans()):
            place[key] = draw(TREES)
            return it
        place = place[key]


@pytest.mark.slow
@examples(300)
@given(st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=3), TREES, max_size=5) | spoilt_cases())
def test_any_tree_is_a_case_or_a_value_error(tree):
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            it = case_of(tree, Path("there"))
        except ValueError as error:
            assert str(error)
            return
    assert isinstance(it.problem, Magnetostatics) and math.isfinite(it.scale)


@examples(100)
@given(st.binary(max_size=80) | st.text(max_size=80).map(lambda text: text.encode("utf-8", "ignore")))
def test_any_bytes_are_a_case_or_a_value_error(tmp_path_factory, content):
    file = tmp_path_factory.mktemp("case") / "case.toml"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"case\.toml: "):
        read_case(file)
