"""Compilation of all kernels ahead of use, for benchmarks and containers."""

from typing import Any

import numpy as np
from skfem import Basis, ElementTriP1, ElementTriP2, MeshTri

from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.kernels.entries import ENTRIES, IN_SPACE
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.kernels.numba.switch import CACHED, PLAIN
from kohonen_adapt.kernels.triangle.equilibrate import NATURAL, FluxData, equilibrate, patch_scratch
from kohonen_adapt.mesh.locate import interpolate
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.plane_descent import PlaneDescent
from kohonen_adapt.polishing.polish import descend_and_recycle
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocate import move
from kohonen_adapt.som.schedule import Schedule, Stage

__all__ = ["compile_missing", "warmup"]

if CACHED and not PLAIN:  # the second process leaves code in the cache, for types known to the fast compiler alone
    from kohonen_adapt.kernels.numba.ahead import compile_ahead
    from kohonen_adapt.kernels.numba.cache import is_cacheable, is_cached

    compile_ahead()  # before any first use, not by `warmup` only


def warmup(space: bool = False) -> None:
    """Compile all kernels now, or load them from numba's cache.

    Parameters
    ----------
    space
        True to compile the kernels of tetrahedra, too.

    Notes
    -----
    Otherwise the first call of `relocate`, `adapt`, `polish`, `KohonenMap` or `interpolate` compiles them, which takes
    some seconds once per installation; later calls load them from the cache on disk.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.warmup()  # doctest: +SKIP
    """
    expect(*(chapter for chapter in ENTRIES if space or chapter not in IN_SPACE))
    mesh = MeshTri().refined(2)
    brief = Schedule((Stage(2, 1, 0.3),), rounds=1, sweeps=1)
    for topology in ("recycle", "flip", "fixed"):
        _relocate(mesh, np.arange(1.0, mesh.nelements + 1.0), brief, topology=topology)
    _relocate(MeshTri.init_lshaped().refined(3), lambda x: np.exp(8.0 * x[0]), None)  # repairs steps around a corner
    disc = MeshTri.init_circle(2)  # uses the recognition of circles
    _relocate(disc, np.ones(disc.nelements), brief)
    layered = mesh.with_subdomains({"low": lambda x: x[1] < 0.5})
    _relocate(layered, np.ones(mesh.nelements), brief, layers={"low": 1})
    interpolate(mesh, mesh.p[0], mesh.p)
    for order in (1, 2):
        x = Basis(mesh, (ElementTriP1(), ElementTriP2())[order - 1]).doflocs[0]
        _polish(mesh, Ritz(x**2, x == 0.0, 1.0, order=order))
    _equilibrate()
    if space:
        for entry in (entry for chapter in IN_SPACE.values() for entry in chapter):
            entry.compile()


def compile_missing() -> None:
    # Nothing is loaded if all are in the cache: the check takes 0.01 s, and `warmup` 0.5 s. Nothing is compiled if
    # the cache cannot be written, because no other process would find the code.
    if not CACHED:
        return
    if PLAIN:  # entries have the types of the fast compiler
        warmup()
        return
    entries = [entry for chapter in ENTRIES if chapter not in IN_SPACE for entry in ENTRIES[chapter]]
    compiled = [entry for entry in entries if hasattr(entry.loop, "py_func")]  # plain functions if numba is disabled
    missing = [entry for entry in compiled if not is_cached(entry.loop, entry.types)]
    if missing and is_cacheable(missing[0].loop):
        warmup()


def _relocate(mesh: MeshTri, density: Any, schedule: Schedule | None, **rules: Any) -> None:
    movable = MovableMesh.of(mesh, Rules(**rules))
    move(movable, density, schedule, rules.get("topology", "flip"), np.random.default_rng(0))
    movable.sagitta()
    movable.mesh()


def _polish(mesh: MeshTri, ritz: Ritz) -> None:
    movable = MovableMesh.of(mesh, Rules())
    functional = Functional.of(ritz, movable, mesh)
    recycled = unchanged(movable.triangulation)
    trial = transferred(functional, movable.copy(), movable, recycled.start_element)
    descend_and_recycle(PlaneDescent(movable, functional, trial, recycled), plan=(1, 1))


def _equilibrate() -> None:
    point, zero = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.zeros((1, 3))
    node = np.array([[0, 1, 2]], dtype=np.int32)
    problem = FluxData(point, node, np.full_like(node, NATURAL), zero, np.zeros(1), np.ones(1))
    equilibrate(problem, patch_scratch(1), np.zeros((1, 3), dtype=np.bool_), np.zeros((1, 3, 2)), np.zeros(3))
