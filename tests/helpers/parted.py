"""Results on meshes that threads share, as one text each, by which processes of other numbers of threads compare."""

import hashlib

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from helpers.diffusion_solids import QuadraticDiffusion
from helpers.meshes import BOTH, cell, inset, l_shape, peak, ring
from helpers.scalar_problems import Load, loaded
from helpers.solids import box


class Own:
    """A curve that somebody wrote."""

    def project(self, x):
        return ka.Arc((0.0, 0.0), 0.5).project(x)


def relocated():
    mesh = inset(176).with_boundaries({"floor": lambda x: x[1] == 0.0})
    return ka.relocate(mesh, lambda x: 1 / (0.01 + (x[0] - 0.3) ** 2 + x[1] ** 2))


def on_curves():
    mesh = ring(240, 40)
    for topology in ("flip", "recycle"):
        mesh = ka.relocate(mesh, peak(mesh, 0.6, 0.3), topology=topology, curves={"inner": Own()})
    return mesh


def paired():
    return ka.relocate(cell(48), lambda x: 1 / (0.03 + np.hypot(x[0], x[1] - 0.3)) ** 2, periodic=BOTH)


def grid():
    ticks = np.linspace(0, 1, 111)
    return MeshTri.init_tensor(ticks, ticks**1.1)


def polished():
    return ka.polish(grid(), Load(), sweeps=3)


def polished_in_space():
    return ka.polish(box(13), Load(), sweeps=3)


def recycled_by_energy():
    result = ka.adapt(grid(), Load(), passes=1, schedule=ka.Schedule(()))
    assert result.history[1].splits > 0
    return result.mesh


def of_order_2():
    return ka.adapt(l_shape(24), loaded(2), passes=1).mesh


def of_order_3():
    return ka.adapt(l_shape(16), loaded(3), passes=1).mesh


def refused():
    result = ka.adapt(grid(), Load(), passes=1, polish=False, min_quality=0.7)
    assert result.history[1].refused_by_quality > 0
    return result


def of_order_2_in_space():
    mesh = box(12)
    mesh = mesh.with_boundaries({"side0": mesh.boundary_facets()})
    problem = QuadraticDiffusion([1.0], [1.0], np.zeros((3, 1)), {"side0": lambda x: 0.0 * x[0]})
    return ka.polish(mesh, problem, sweeps=2)


def trained_in_space():
    som = ka.KohonenMap(box(16), topology="flip")
    schedule = ka.Schedule((ka.Stage(1, 2, 0.3, points_per_neuron=0.5),))
    som.train(lambda number, rng: (rng.random((3, number)) ** 2, None), schedule)
    return som


def relocated_in_space():
    return ka.relocate(box(13), lambda x: 1 / (0.1 + x[0] ** 2 + x[1] ** 2), topology="recycle")


RESULTS = (
    relocated,
    on_curves,
    paired,
    polished,
    polished_in_space,
    of_order_2_in_space,
    trained_in_space,
    relocated_in_space,
    recycled_by_energy,
    of_order_2,
    of_order_3,
    refused,
)


def texts():
    """By the name of what was done: how many nodes and elements there are, and a hash of where and which they are."""
    return {each.__name__: text(each()) for each in RESULTS}


def text(result):
    mesh, history = getattr(result, "mesh", result), getattr(result, "history", ())
    refusals = [(step.refused_by_quality, step.refused_by_reach, step.unmoved) for step in history]
    hashed = hashlib.sha256(mesh.p.tobytes() + mesh.t.tobytes()).hexdigest()
    return f"{mesh.nvertices} {mesh.nelements} {hashed} {refusals}"
