"""Random magnetic devices in the plane and in space, and how they are to be adapted."""

import numpy as np

from helpers import tensor_meshes
from helpers.magnet_solids import blocks, nested_balls
from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.magnetostatics import (
    Coil,
    FluxDensityAt,
    FluxLinkage,
    Force,
    Froehlich,
    MagneticScalarPotential,
    Magnetostatics,
    Material,
    StoredEnergy,
)

AIR, STEEL = Material(), Material(bh=Froehlich(1000.0, 2.0))
SIZE = 0.04  # m, half of the box and radius of the disk in the plane
TOLERANCES = 0.3, 0.05, 0.02
DRAWING = """
DefineConstant[ r = 1, a = 1, b = 2, h = 1, lc = 1 ];
Point(1) = {0, 0, 0, lc}; Point(2) = {r, 0, 0, lc}; Point(3) = {-r, 0, 0, lc};
Circle(1) = {2, 1, 3}; Circle(2) = {3, 1, 2};
Point(4) = {a, -h, 0, lc}; Point(5) = {b, -h, 0, lc}; Point(6) = {b, h, 0, lc}; Point(7) = {a, h, 0, lc};
Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 4};
Point(8) = {-4, -4, 0, lc}; Point(9) = {4, -4, 0, lc}; Point(10) = {4, 4, 0, lc}; Point(11) = {-4, 4, 0, lc};
Line(8) = {8, 9}; Line(9) = {9, 10}; Line(10) = {10, 11}; Line(11) = {11, 8};
Curve Loop(1) = {1, 2}; Curve Loop(2) = {4:7}; Curve Loop(3) = {8:11};
Plane Surface(1) = {1}; Plane Surface(2) = {2}; Plane Surface(3) = {3, 1, 2};
Physical Surface("coil") = {1}; Physical Surface("core") = {2}; Physical Surface("air") = {3};
Physical Curve("outer") = {8:11};
"""
MOST = {2: 200, 3: 250}  # nodes that a tolerance leads to


def plane_problem(seed):
    """A mesh, a problem of any order, keywords of `adapt`, and the radii of the circles of the mesh by subdomain."""
    rng = np.random.default_rng(seed)
    return plane_problem_on(*one_of(rng, rectangles, round_core)(rng), rng)


def drawn_problem(seed, folder):
    """The same on a mesh that Gmsh draws, of a round coil and a core beside it with random sizes in a box of air."""
    rng = np.random.default_rng(seed)
    radius, (near, far) = rng.uniform(0.5, 1.5), sorted(rng.uniform(1.6, 3.8, 2).tolist())
    sizes = {"r": radius, "a": near, "b": far + 0.1, "h": rng.uniform(0.3, 3.5), "lc": rng.uniform(0.8, 1.5)}
    (folder / "device.geo").write_text(DRAWING)
    materials = {name: {} for name in ("coil", "core", "air")}
    given = {"mesh": {"drawing": "device.geo", **sizes}, "materials": materials, "potential": {"outer": 0.0}}
    mesh = fitting_mesh(case_of(given | {"scale": SIZE}, folder))
    return plane_problem_on(with_sides(mesh), {"coil": SIZE * radius}, rng)


def plane_problem_on(mesh, radii, rng):
    axisymmetric = not radii and one_of(rng, True, False)
    if axisymmetric:
        mesh = mesh.translated((SIZE, 0.0))
    aim = one_of(rng, "nodes", "rtol", "rtol", "goal", "goal", "output")
    coil = Material(current_density=rng.uniform(-5e6, 5e6))
    problem = Magnetostatics(
        {"core": iron_or_magnet(rng, axisymmetric), "coil": coil, "air": AIR}
        | ({"gap": AIR} if "gap" in radii else {}),
        potential={"outer": 0.0},
        order=one_of(rng, 4, 5, 6, 7, 8, "auto", 1, 2, 3),
        axisymmetric=axisymmetric,
        curved=rng.random() < 0.8,
        goal=goal_in_plane(mesh, rng, axisymmetric) if aim == "goal" else None,
    )
    return mesh, problem, keywords(rng, aim, mesh, lambda field: field.energy), radii


def space_problem(seed):
    """The same in space, with a coil or an applied field for some."""
    rng = np.random.default_rng(seed)
    mesh, radii = one_of(rng, cuboids, ball)(rng)
    body = [name for name in mesh.subdomains if name != "air"]
    aim = one_of(rng, "nodes", "rtol", "rtol", "goal", "bracket")
    driven = one_of(rng, *["by magnets", "by a field", "by a coil"][: 2 if radii else 3])
    materials = {name: magnet_in_space(rng) if driven == "by magnets" else iron(rng) for name in body}
    force = Force(tuple(body), tuple(rng.normal(size=3)))
    point = FluxDensityAt(in_air(mesh, rng), tuple(rng.normal(size=3)))
    problem = MagneticScalarPotential(
        materials | {"air": AIR},
        potential={"outer": 0.0},
        coils={"coil": coil_above(mesh, rng)} if driven == "by a coil" else None,
        applied_field=tuple(rng.normal(size=3) * 1e4) if driven == "by a field" else None,
        order=1 if aim == "bracket" else one_of(rng, 2, 2, 1),
        curved=one_of(rng, True, False),
        estimator="bracket" if aim == "bracket" else "residual",
        goal=one_of(rng, force, point) if aim == "goal" else None,
    )
    return mesh, problem, keywords(rng, aim, mesh, lambda field: field.coenergy), radii


def one_of(rng, *choices):
    return choices[rng.integers(len(choices))]


def keywords(rng, aim, mesh, energy):
    """Keywords of `adapt`: growth, shrinking by a coarse tolerance, or a constant number of nodes."""
    found = {"passes": one_of(rng, 1, 2), "seed": int(rng.integers(100)), "outputs": {"energy": energy}}
    if aim == "nodes":
        more = one_of(rng, None, 1.0, 1.4)
        return found | {"target_nodes": more and int(more * mesh.nvertices)}
    name = {"goal": "goal_rtol", "output": "output_rtol"}.get(aim, "rtol")
    return found | {name: one_of(rng, *TOLERANCES), "max_nodes": MOST[mesh.dim()]}


def rectangles(rng):
    """Rectangles of a core and a coil in a box of air; they may touch along a side, or at a corner only."""
    x, y = (np.sort(rng.choice(np.arange(1, 8), 4, replace=False)) * SIZE / 4 - SIZE for _ in range(2))
    ticks = np.linspace(-SIZE, SIZE, 9)
    parts = {"core": (*x[:2], *y[:2]), "coil": (rng.choice(x[1:3]), x[3], *y[[1, 3] if rng.random() < 0.5 else [0, 2]])}
    return with_sides(tensor_meshes.box(ticks, ticks, parts)), {}


def round_core(rng):
    """A round core with a ring of air, a ring of a coil, and air."""
    ends = dict(zip(("core", "gap", "coil", "air"), (2, 3, 4, 5), strict=True))
    radii = np.cumsum(rng.uniform(0.6, 1.4, 5))
    radii *= SIZE / radii[-1]
    mesh = tensor_meshes.disk(radii, ends)
    return with_sides(mesh), dict(zip((*ends, "outer")[:3], radii[1:4], strict=True)) | {"outer": radii[4]}


def with_sides(mesh):
    """The boundary "skin" around the core, which has a side."""
    return mesh.with_boundaries({"skin": mesh.facets_around("core")})


def cuboids(rng):
    """One or two bodies in a box of air, which may touch."""
    axes = [np.cumsum(np.r_[-1.0, rng.uniform(0.3, 0.7, 4)]) for _ in range(3)]
    (a, b, c), (d, e, f) = ([axis[k] for axis in axes] for k in (1, 2))
    parts = {"body": ((a, b, c), (d, e, f))}
    if rng.random() < 0.5:
        parts["other"] = ((d, b, c), (axes[0][3], e, f))
    return blocks(axes, parts), {}


def ball(rng):
    return nested_balls(1, rim=rng.uniform(1.6, 2.5)), {"ball": 1.0}


def coil_above(mesh, rng):
    """A circular coil in the air between the bodies and the upper end of the mesh."""
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    bodies = np.concatenate([mesh.t[:, rows].ravel() for name, rows in mesh.subdomains.items() if name != "air"])
    top = mesh.p[2, bodies].max()
    centre = (*(0.5 * (low + high)[:2]), 0.5 * (top + high[2]))
    thin = 0.4 * (high[2] - top)
    radius = 0.3 * (high - low)[:2].min()
    return Coil.circular(centre, (0.0, 0.0, 1.0), radius, (min(thin, radius), thin), rng.normal() * 1e4)


def in_air(mesh, rng):
    """The centre of an element of air."""
    return tuple(mesh.p[:, mesh.t[:, rng.choice(mesh.subdomains["air"])]].mean(axis=1))


def iron(rng):
    return STEEL if rng.random() < 0.3 else Material(permeability=10.0 ** rng.uniform(0.5, 3.5))


def iron_or_magnet(rng, axisymmetric):
    across = 0.0 if axisymmetric else rng.normal()
    return iron(rng) if rng.random() < 0.5 else Material(permeability=1.05, remanence=(across, rng.normal()))


def magnet_in_space(rng):
    return Material(permeability=rng.uniform(1.0, 1.2), remanence=tuple(rng.normal(size=3)))


def goal_in_plane(mesh, rng, axisymmetric):
    return one_of(
        rng,
        Force(("core", "coil"), (0.0, 1.0) if axisymmetric else tuple(rng.normal(size=2))),
        FluxLinkage({"coil": 1.0}),
        StoredEnergy("air"),
        FluxDensityAt(in_air(mesh, rng), (0.0, 1.0)),
    )
