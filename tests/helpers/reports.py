"""Reports for tests: a small square with hostile names, no physics."""

import base64
import zlib
from dataclasses import replace

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from helpers.mesh_files import two_boxes
from kohonen_adapt import AdaptResult, Pass, Plane, Status
from kohonen_adapt.report import write_report

CUT = Plane((0.5, 0.4, 0.4), (0.0, 1.0, 0.0))
HOSTILE = '</script><img src=x onerror="document.title=1"><!--${oops}&amp;'


def a_mesh(levels=3):
    mesh = MeshTri().refined(levels)
    return mesh.with_subdomains({"left": lambda x: x[0] < 0.5, HOSTILE: lambda x: x[0] > 0.5})


def a_pass(number, mesh, estimate, outputs=()):
    """A pass whose indicators grow with the number of the element."""
    return Pass(
        number=number,
        mesh=mesh,
        indicators=np.linspace(0.1, 2.0, mesh.nelements),
        nodes=np.arange(mesh.nvertices),
        unknowns=mesh.nvertices,
        estimate=estimate,
        worth=estimate,
        energy_norm=2.0,
        calibrated=True,
        min_quality=0.5,
        mean_quality=0.9,
        seconds={"solve": 0.1},
        outputs=dict(outputs),
    )


def a_result(mesh, history, status=Status.MAX_PASSES):
    """A result, the last pass of the history, whose solution is x of every node."""
    last = history[-1]
    return AdaptResult(
        mesh, mesh.p[0], last.indicators, last.estimate, tuple(history), status, f"Done with {HOSTILE}.", last.nodes
    )


def before_and_after():
    before = a_mesh()
    squeezed = before.p.copy()
    squeezed[1] = squeezed[1] ** 2
    after = replace(before, doflocs=squeezed)
    first = a_pass(0, before, 1.0, {HOSTILE: 4.0})
    last = a_pass(1, after, 0.5, {HOSTILE: 5.0})
    return a_result(before, [first]), a_result(after, [first, last])


def mean_of_x(mesh):
    return lambda solution: solution[mesh.t].mean(axis=0)


def solid_report(folder, **changed):
    """Write a report of a mesh of tetrahedra, seen in a cut; its path."""
    mesh = two_boxes(1)
    result = a_result(mesh, [a_pass(0, mesh, 1.0)])
    given = {"point_data": {"x (m)": lambda solution: solution}, "cell_data": {"middle (m)": mean_of_x(mesh)}}
    given["held"] = lambda result: ka.why_held(result.mesh)
    path = folder / "solid.html"
    write_report(path, result, before=result, **given | {"plane": CUT} | changed)
    return path


def hostile_report(folder, **changed):
    """Write a report in which everything that can have a name has a hostile one; its path."""
    before, after = before_and_after()
    given = {
        "title": HOSTILE,
        "asked": HOSTILE,
        "point_data": {f"x (m) {HOSTILE}": lambda solution: solution},
        "cell_data": {"middle (m)": mean_of_x(before.mesh)},
        "held": lambda result: np.where(result.mesh.p[0] == 0.0, f"pinned by {HOSTILE}", ""),
        "settings": {HOSTILE: HOSTILE},
        **changed,
    }
    path = folder / "report.html"
    write_report(path, after, before=before, **given)
    return path


def unpacked(record):
    """Return the numbers that a report has packed."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(record["data"])), np.uint8)
    kind = np.dtype("<" + record["type"])
    return np.ascontiguousarray(planes.reshape(kind.itemsize, -1).T).view(kind).ravel()
