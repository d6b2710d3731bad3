"""The benchmark of force noise finds noise where it is, and less of it on adapted meshes."""

import numpy as np
import pytest
from helpers.mesh_files import needs_gmsh

import kohonen_adapt as ka
from benchmarks.checks.force import PROBLEM, STEP, STEPS, force, gmsh_mesh, noise
from kohonen_adapt.mesh.measures import area


def test_a_cubic_has_no_noise_and_the_rest_has_its_root_mean_square():
    step = np.arange(20.0)
    cubic = 3.0 - step + 0.1 * step**2 - 0.01 * step**3
    assert noise(cubic) < 1e-12
    wave = np.cos(np.pi * step)  # as good as orthogonal to every cubic
    assert noise(cubic + 0.5 * wave) == pytest.approx(0.5, rel=0.02)


@needs_gmsh
def test_the_magnet_moves_and_nothing_else():
    first, last = (gmsh_mesh(shift, 0.8) for shift in (0.0, STEP * (STEPS - 1)))
    places = []
    for mesh in (first, last):
        sizes = {name: area(mesh)[rows].sum() for name, rows in mesh.subdomains.items()}
        assert sizes == pytest.approx({"magnet": 50e-6, "iron": 200e-6, "air": 4550e-6})
        places.append([mesh.p[:, mesh.t[:, mesh.subdomains[name]]].min(axis=(1, 2)) for name in ("magnet", "iron")])
    np.testing.assert_allclose(places[1][0] - places[0][0], [0.95e-3, 0.0], atol=1e-12)
    np.testing.assert_allclose(places[1][1], places[0][1], atol=1e-12)


@needs_gmsh
@pytest.mark.slow
def test_adapted_meshes_have_a_fifth_of_the_noise():
    meshes = [gmsh_mesh(STEP * step, 0.8) for step in range(STEPS)]
    plain = np.array([force(PROBLEM.solve(mesh)) for mesh in meshes])
    adapted = np.array([force(ka.adapt(mesh, PROBLEM).solution) for mesh in meshes])
    for component in range(2):
        assert 5.0 * noise(adapted[:, component]) < noise(plain[:, component])
