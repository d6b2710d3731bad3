"""Solve the linear models with NGSolve by hp refinement at marked corners."""

import time
from typing import Any

import numpy as np

from benchmarks.peers.contest import Run
from benchmarks.problems.corner_models import CornerModel


class Discrete:
    """A linear model in NGSolve's elements of an order, on its mesh with the materials as names of regions."""

    def __init__(self, model: CornerModel, mesh: Any, order: int) -> None:
        import ngsolve as ng

        self.ng, self.mesh, self.order = ng, mesh, order
        reluctivity = {name: 1.0 / given.permeability for name, given in model.materials.items()}
        self.reluctivity = mesh.MaterialCF(reluctivity)
        remanence = {name: np.asarray(given.remanence) for name, given in model.materials.items()}
        right = {name: -reluctivity[name] * by for name, (_, by) in remanence.items()}
        up = {name: reluctivity[name] * bx for name, (bx, _) in remanence.items()}
        self.flux = ng.CF((mesh.MaterialCF(right), mesh.MaterialCF(up)))
        self.space = ng.H1(mesh, order=order, dirichlet="outer", autoupdate=True)
        trial, test = self.space.TnT()
        density = self.reluctivity * ng.grad(trial) * ng.grad(test)
        self.form = ng.BilinearForm(density * ng.dx, symmetric=True, condense=order > 1)
        self.load = ng.LinearForm(self.flux * ng.grad(test) * ng.dx)
        self.potential = ng.GridFunction(self.space, autoupdate=True)

    def solve(self) -> None:
        """Assemble and solve, with unknowns inside elements eliminated."""
        form, potential = self.form, self.potential
        form.Assemble()
        self.load.Assemble()
        inverse = form.mat.Inverse(self.space.FreeDofs(self.order > 1), inverse="sparsecholesky")
        if self.order == 1:
            potential.vec.data = inverse * self.load.vec
            return
        right = self.load.vec.CreateVector()
        right.data = self.load.vec
        right.data += form.harmonic_extension_trans * right
        potential.vec.data = inverse * right
        potential.vec.data += form.harmonic_extension * potential.vec
        potential.vec.data += form.inner_solve * right

    @property
    def squared_norm(self) -> float:
        """a(A, A) of the solution, in T^2 m^2 with nu relative."""
        return float(self.ng.InnerProduct(self.load.vec, self.potential.vec))


def drawn_mesh(model: CornerModel, size: float) -> Any:
    """Return Netgen's mesh of a model with edges up to `size` half boxes, its corners marked for hp refinement."""
    import ngsolve as ng
    from netgen.occ import Glue, OCCGeometry, WorkPlane

    def face(points: Any) -> Any:
        plane = WorkPlane().MoveTo(*points[0])
        for point in points[1:]:
            plane.LineTo(*point)
        return plane.Close().Face()

    box = model.box
    air = face([(-box, -box), (box, -box), (box, box), (-box, box)])
    air.faces.name, air.edges.name = "air", "outer"
    parts = []
    for name, points in model.polygons:
        part = face(points)
        part.faces.name, part.vertices.hpref = name, 1
        part.edges.name = "inside"
        air = air - part
        parts.append(part)
    shape = Glue([air, *parts])
    for edge in shape.edges:
        outside = max(abs(edge.center.x), abs(edge.center.y)) > box * (1.0 - 1e-9)
        edge.name = "outer" if outside else "inside"
    return ng.Mesh(OCCGeometry(shape, dim=2).GenerateMesh(maxh=size * box))


def hp(model: CornerModel, size: float, levels: int, order: int, factor: float = 0.15) -> Run:
    """Refine at the corners and solve; meshing does not count."""
    mesh = drawn_mesh(model, size)
    begin = time.process_time()
    if levels:
        mesh.RefineHP(levels, factor)
    discrete = Discrete(model, mesh, order)
    discrete.solve()
    seconds = time.process_time() - begin
    settings = f"size {size:g}, {levels} levels by {factor:g}, p {order}"
    return Run(settings, discrete.space.ndof, model.error_of(discrete.squared_norm), seconds)
