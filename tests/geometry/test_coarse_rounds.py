"""Coarse cylinders, which turn by more than a corner of a polygon."""

import numpy as np
import pytest
from helpers.solids import extruded
from scipy.spatial import Delaunay
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.__main__ import main


class Uniform:
    def solve(self, mesh):
        return None

    def indicators(self, mesh, solution):
        return np.ones(mesh.nelements)


def flange(strips, shaft):
    # a prism of radius 2 around a shaft of radius 1, both of height 1
    ring = lambda radius, count: radius * np.exp(2j * np.pi * np.arange(count) / count)  # noqa: E731
    z = np.concatenate([[0.0], ring(1.0, shaft), ring(2.0, strips)])
    p = np.stack([z.real, z.imag])
    mesh = extruded(MeshTri(p, Delaunay(p.T).simplices.T))
    outside = mesh.facets[:, mesh.boundary_facets()]
    rim = mesh.boundary_facets()[np.ptp(mesh.p[2, outside], axis=0) > 1e-9]
    inside = np.all(np.hypot(*mesh.p[:2])[mesh.t] < 1.0 + 1e-9, axis=0)
    parts = {"shaft": np.flatnonzero(inside), "flange": np.flatnonzero(~inside)}
    return mesh.with_subdomains(parts).with_boundaries({"rim": rim})


def distances_of_rim(mesh):
    return np.hypot(*mesh.p[:2, np.unique(mesh.facets[:, mesh.boundaries["rim"]])])


@pytest.mark.parametrize(
    ("strips", "shaft", "is_round"), [(10, 16, True), (9, 16, True), (8, 16, False), (10, 4, False)]
)
def test_coaxial_prisms_of_nine_strips_are_cylinders_and_check_names_the_others(
    strips, shaft, is_round, tmp_path, capsys
):
    mesh = flange(strips, shaft)
    adapted = ka.adapt(mesh, Uniform(), passes=2, target_nodes=500).mesh
    assert (distances_of_rim(adapted).min() > 2.0 - 1e-9) == is_round
    file = tmp_path / "flange.msh"
    ka.write_mesh(str(file), mesh)
    main(["check", str(file)])
    said = capsys.readouterr().out
    assert (f"boundary 'rim' has {strips} plane strips" in said) != is_round
    if not is_round:
        advised = said[said.index("surfaces={") + 9 : said.index("}, in a case") + 1]
        adapted = ka.adapt(mesh, Uniform(), passes=2, target_nodes=500, surfaces=eval(advised)).mesh
        assert distances_of_rim(adapted).min() > 2.0 - 1e-9
