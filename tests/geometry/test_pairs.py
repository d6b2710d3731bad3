"""Periodic pairs: boundaries that are one another's image stay so, node by node, and a point reaches across them."""

import numpy as np
import pytest
from helpers.meshes import BOTH, SIDES, apart, cell, disk, peak_at, ring, slit, square
from helpers.paired import mismatch
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap


@pytest.mark.parametrize("topology", ["fixed", "flip", "recycle"])
def test_translated_sides_stay_matched(topology):
    mesh = cell(16)
    for seed in range(5):
        mesh = ka.relocate(mesh, peak_at(0.0, 0.3), topology=topology, periodic=BOTH, seed=seed)
        assert mismatch(mesh, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-15
        assert mismatch(mesh, "bottom", "top", lambda x: x + [[0.0], [1.0]]) < 1e-15
    sides = [np.unique(mesh.facets[:, mesh.boundaries[name]]) for name in SIDES]
    counts = [len(nodes) for nodes in sides]
    if topology == "recycle":  # nodes of pairs, too, are made where they are wanted
        assert counts[0] == counts[1] > 17 > counts[2] == counts[3]
    else:
        assert counts == [17] * 4
    assert np.sort(mesh.p[1, sides[0]])[8] < 0.45  # they went to the peak
    assert ka.relocate(cell(16), peak_at(0.0, 0.3), seed=0).boundaries.keys() == mesh.boundaries.keys()


def test_sides_that_do_not_match_are_refused():
    mesh = square(8).with_boundaries(
        {**SIDES, "seam": lambda x: x[0] == 0.5, "half": lambda x: (x[0] == 1) & (x[1] < 0.5)}
    )
    with pytest.raises(ValueError, match="'left' and 'half' must have as many nodes; they have 9 and 5"):
        ka.relocate(mesh, np.ones(128), periodic=[("left", "half")])
    with pytest.raises(ValueError, match="'seam' must lie on the outer boundary"):
        ka.relocate(mesh, np.ones(128), periodic=[("left", "seam")])
    p = mesh.p.copy()
    p[1, (p[0] == 1.0) & (p[1] == 0.25)] += 1e-3
    with pytest.raises(
        ValueError, match=r"within 1e-08 of the size of the mesh; the nearest is 0\.001 off\. Mesh them"
    ):
        ka.relocate(MeshTri(p, mesh.t, mesh.boundaries), np.ones(128), periodic=[("left", "right")])


# --- motions by name ---------------------------------------------------------------------------------------------

ROTOR_AND_STATOR = [("0 rim", "1 inner")]


def rim_named(mesh):
    return mesh.with_boundaries({"rim": mesh.boundary_facets()})


def rotor_and_stator(rings=6):
    """A disc in an annulus, each with nodes of its own on the circle between them, of radius 1/2."""
    return apart(rim_named(disk(rings, 0.5)), ring(6 * rings, rings))


def two_discs(rings=8):
    """A disc of radius 1 about the origin and its mirror image about (3, 0)."""
    one = disk(rings, 1.0)
    return apart(rim_named(one), rim_named(MeshTri(np.array([[3.0], [0.0]]) + one.p * [[-1.0], [1.0]], one.t)))


MIRROR = ka.Reflection(point=(1.5, 0.0), normal=(1.0, 0.0))
IN_MIRROR = [("0 rim", "1 rim", MIRROR)]


def moved_by(motion):
    matrix = motion.matrix
    return lambda x: matrix[:, :2] @ x + matrix[:, 2:]


def test_motions_are_what_they_say():
    x = np.array([[1.0, 3.0], [0.0, -2.0]])
    assert_allclose(moved_by(ka.Rotation(np.pi / 2, (1.0, 1.0)))(x), [[2.0, 4.0], [1.0, 3.0]], atol=1e-15)
    assert_array_equal(moved_by(ka.Translation((1, -1)))(x), [[2.0, 4.0], [-1.0, -3.0]])
    assert_array_equal(moved_by(ka.Reflection((0, 1), (0, -3)))(x), [[1.0, 3.0], [2.0, 4.0]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ka.Rotation("1"), "angle of a Rotation must be a finite number in radians; got '1'"),
        (lambda: ka.Rotation(1.0, 2.0), r"centre of a Rotation must be two finite numbers \(x, y\); got 2\.0"),
        (lambda: ka.Translation((1.0, np.nan)), "vector of a Translation must be two finite numbers"),
        (lambda: ka.Reflection((0, 0), (0, 0)), r"normal of a Reflection must have a direction; got \(0, 0\)"),
    ],
)
def test_motions_that_are_none(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_circles_are_not_matched_by_a_guess():
    mesh = rotor_and_stator()
    message = (
        r"^periodic boundaries '0 rim' and '1 inner' fit by more than one motion, .* for instance \('0 rim', "
        r"'1 inner', kohonen_adapt\.Translation\(vector=\(0\.0, 0\.0\)\)\), or "
        r"kohonen_adapt\.Rotation\(angle=-?0\.1745.*; in a case "
        r'\["0 rim", "1 inner", \{motion = "translation", vector = \[0\.0, 0\.0\]\}\]\.$'
    )
    with pytest.raises(ValueError, match=message):
        ka.relocate(mesh, np.ones(mesh.nelements), periodic=ROTOR_AND_STATOR)


@pytest.mark.parametrize(
    ("make", "pair", "topology"),
    [
        (rotor_and_stator, ("0 rim", "1 inner", ka.Rotation(np.pi / 18)), "recycle"),
        (two_discs, IN_MIRROR[0], "recycle"),
        (two_discs, ("1 rim", "0 rim", MIRROR), "flip"),
        (two_discs, ("0 rim", "1 rim", ka.Rotation(np.pi, (1.5, 0.0))), "fixed"),
    ],
)
def test_circles_stay_matched_by_the_motion_named(make, pair, topology):
    before = make()
    mesh = ka.relocate(before, peak_at(0.4, 0.4), topology=topology, periodic=[pair])
    assert mismatch(mesh, *pair[:2], moved_by(pair[2])) < 1e-14
    nodes = np.unique(mesh.facets[:, mesh.boundaries["0 rim"]])
    radius = np.hypot(*before.p[:, before.facets[0, before.boundaries["0 rim"][0]]])
    assert_allclose(np.hypot(*mesh.p[:, nodes]), radius, rtol=1e-14)
    spacing = np.diff(np.sort(np.arctan2(*mesh.p[::-1, nodes])))
    assert spacing.max() > 1.2 * spacing.min()  # they slid


def sides_of(*meshes):
    return apart(*(mesh.with_boundaries({"left": left, "right": right}) for mesh, left, right in meshes))


def unit_at(x, n=4):
    """A square from x to x + 1, and its left and right sides as they are found."""
    mesh = square(n).translated((x, 0.0))
    return mesh, lambda p: np.abs(p[0] - x) < 1e-9, lambda p: np.abs(p[0] - x - 1.0) < 1e-9


def joined(mesh, **names):
    """The mesh with boundaries that are those of that name put together."""
    rows = {name: np.concatenate([mesh.boundaries[part] for part in parts]) for name, parts in names.items()}
    return mesh.with_boundaries(rows)


def beside(mirror):
    """A crooked quadrilateral with uneven nodes, or its mirror image, beside it."""
    x, y = square(4).p
    one = MeshTri(np.stack([x + 0.3 * y**2, y**2 + 0.1 * x]), square(4).t)
    other = MeshTri(one.p * [[-1.0], [1.0]] if mirror else one.p, one.t).translated((5.0, 0.0))
    return apart(rim_named(one), rim_named(other))


def slit_squares():
    faces = lambda x: (np.abs(x[1] - 0.5) < 1e-9) & (x[0] % 3.0 < 0.6)  # noqa: E731
    both = [slit(8), slit(8).translated((3.0, 0.0))]
    return apart(*(mesh.with_boundaries({"a": mesh.facets_satisfying(faces, boundaries_only=True)}) for mesh in both))


@pytest.mark.parametrize(
    ("mesh", "pair", "message"),
    [
        pytest.param(
            two_discs(3),
            ("0 rim", "1 rim"),
            r"'0 rim' and '1 rim' fit by a motion, but the mesh does not go on there: once moved it lies on the same "
            r"side of '1 rim'\. .* for instance \('0 rim', '1 rim', kohonen_adapt\.Reflection\(point=\(1\.5, 0\.0\), "
            r"normal=\(1\.0, 0\.0\)\)\), or kohonen_adapt\.Translation\(vector=\(3\.0, 0\.0\)\)",
            id="folded",
        ),
        pytest.param(
            beside(False),
            ("0 rim", "1 rim"),
            r"the mesh does not go on there.*Translation\(vector=\(5\.0, 0\.0\)\)\); in a case",
            id="folded, one way",
        ),
        pytest.param(
            beside(True),
            ("0 rim", "1 rim"),
            r"fit by a reflection, which is not guessed\. .*Reflection\(point=\(2\.5, 0\.0\), normal=\(1\.0, 0\.0\)\)",
            id="mirrored",
        ),
        pytest.param(
            sides_of(unit_at(0.0), unit_at(3.0)),
            ("0 left", "1 left"),
            None,  # by half a turn the mesh goes on, and the nodes are even
            id="turned",
        ),
        pytest.param(
            joined(sides_of(unit_at(0), unit_at(2), unit_at(3.0)), a=["0 left", "1 right"], b=["0 right", "2 right"]),
            ("a", "b"),
            r"'a' and 'b' do not fit: the mesh goes on beyond 4 facets of 'b' and lies on the same side of 4\. ",
            id="mixed",
        ),
        pytest.param(
            sides_of((square(4), *unit_at(0)[1:2], lambda x: (x[0] > 0.999) & (np.abs(x[1] - 0.375) > 0.1))),
            ("0 left", "0 right"),
            r"do not fit: the nodes of '0 left' come to lie on those of '0 right', but not all facets on facets: of 4 "
            r"3 do, of 3\. Name all facets on both sides",
            id="facets",
        ),
        pytest.param(
            slit_squares(),
            ("0 a", "1 a"),
            r"do not fit: two nodes of '0 a' come to lie on one of '1 a', at \(3(\.\d+)?, 0\.5\)\. Merge nodes",
            id="doubled",
        ),
        pytest.param(
            two_discs(3),
            ("0 rim", "1 rim", ka.Rotation(0.1)),
            r"^Rotation\(angle=0\.1, centre=\(0\.0, 0\.0\)\) must carry the nodes of boundary '0 rim' to those of "
            r"'1 rim', .*; it leaves one [\d.]+ off\. Mesh",
            id="named wrongly",
        ),
        pytest.param(
            two_discs(3),
            ("0 rim", "1 rim", "mirror"),
            r"the third entry of a pair in periodic must be a kohonen_adapt\.Rotation, Translation or Reflection; got ",
            id="no motion",
        ),
    ],
)
def test_refusals_of_pairs_name_the_cause(mesh, pair, message):
    if message is None:
        KohonenMap(mesh, periodic=[pair])
        return
    with pytest.raises(ValueError, match=message):
        KohonenMap(mesh, periodic=[pair])
