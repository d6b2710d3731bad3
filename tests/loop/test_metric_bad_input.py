"""Metrics that are none: every door refuses them in one line, with the element and the value."""

import re

import numpy as np
import pytest
from helpers.mesh_files import of_meshio
from helpers.meshes import square
from numpy.testing import assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli

MESHES = {2: square(4), 3: MeshTet().refined(1)}
BAD = 5  # element with the fault


def with_fault(mesh, tensor):
    """Round tensors, one of them replaced, or with a changed part."""
    dim = len(mesh.p)
    tensors = np.tile(100.0 * np.eye(dim), (mesh.nelements, 1, 1))
    tensors[BAD, :2, :2] = tensor
    return tensors


FAULTS = {
    "not symmetric": ([[100.0, 1.0], [1.5, 100.0]], "be symmetric"),
    "indefinite": ([[1.0, 2.0], [2.0, 1.0]], "be positive definite"),
    "negative": ([[-1.0, 0.0], [0.0, -1.0]], "be positive definite"),
    "zero": ([[0.0, 0.0], [0.0, 0.0]], "be positive definite"),
    "flat": ([[1.0, 1.0], [1.0, 1.0]], "be positive definite"),
    "not a number": ([[1.0, 0.0], [0.0, np.nan]], "be finite"),
    "infinite": ([[np.inf, 0.0], [0.0, 1.0]], "be finite"),
    "too long": ([[1e7, 0.0], [0.0, 1e-7]], "have edges of a ratio of at most 1e\\+06"),
    "too large": ([[1e200, 0.0], [0.0, 1e200]], "have (a determinant in the range of numbers|edges of a ratio .*)"),
}


def write_field(mesh, tensors, folder):
    """A VTU file by meshio, the mesh beside it."""
    of_meshio(mesh, cell_data={"m": [tensors.reshape(len(tensors), -1)]}).write(folder / "f.vtu")
    ka.write_mesh(folder / "m.msh", mesh)
    return folder / "f.vtu"


def file(mesh, tensors, folder):
    ka.read_field(write_field(mesh, tensors, folder), mesh, "m")


def command(meaning):
    def door(mesh, tensors, folder, capsys):
        path = write_field(mesh, tensors, folder)
        out = folder / "o.msh"
        arguments = ["relocate", folder / "m.msh", f"--{meaning}", f"{path}:m", "-o", out, "--quiet"]
        assert cli.main([str(word) for word in arguments]) == 2 and not out.exists()
        raise ValueError(capsys.readouterr().err.removeprefix("kohonen-adapt: ").rstrip("\n"))

    return door


CALLS = {
    "sizes": lambda mesh, tensors, *_: ka.density_from_sizes(mesh, tensors),
    "density": lambda mesh, tensors, *_: ka.relocate(mesh, tensors),
    "metric": lambda mesh, tensors, *_: ka.KohonenMap(mesh, metric=tensors),
}
DOORS = CALLS | {
    "file": file,
    "--sizes": command("sizes"),
    "--density": command("density"),
}


ASKED = [("sizes", fault) for fault in FAULTS] + [(door, "indefinite") for door in DOORS if door != "sizes"]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("door", "fault"), ASKED)
@pytest.mark.parametrize("dim", [2, 3])
def test_faults_have_an_element_and_a_value(tmp_path, capsys, dim, door, fault):
    mesh, (part, rule) = MESHES[dim], FAULTS[fault]
    tensors = with_fault(mesh, part)
    kept = tensors.copy()
    shown = re.escape(str(tensors[BAD].tolist()))
    message = (
        rf"^(sizes|density|metric|'m' of '.*') must {rule}; the tensor of element {BAD} (is|has [\d.e+]+:) {shown}\.$"
    )
    with pytest.raises(ValueError, match=message):
        DOORS[door](mesh, tensors, tmp_path, *([capsys] if door.startswith("-") else []))
    assert_array_equal(tensors, kept)


@pytest.mark.parametrize("fault", ["indefinite", "not a number"])
@pytest.mark.parametrize("dim", [2, 3])
def test_faults_of_a_function_have_a_point_and_a_value(dim, fault):
    mesh, (part, rule) = MESHES[dim], FAULTS[fault]

    def metric(x):
        tensors = np.tile(100.0 * np.eye(dim), (x.shape[1], 1, 1))
        tensors[x[0] > 0.6, :2, :2] = part
        return tensors

    shown = re.escape(str(with_fault(mesh, part)[BAD].tolist()))
    place = r"\(" + ", ".join([r"(0\.[6-9]\d*|1\.0)", *[r"\d\.\d+"] * (dim - 1)]) + r"\)"
    message = rf"^density must {rule}; the tensor at {place} (is|has [\d.e+]+:) {shown}\.$"
    with pytest.raises(ValueError, match=message):
        ka.relocate(mesh, metric)


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("shape", [(31, 2, 2), (32, 3, 3), (32, 2, 1), (2, 2, 32), (1, 2, 2)])
def test_shapes(name, shape):
    message = rf"^{name} must have shape \(nelements, 2, 2\) = \(32, 2, 2\) as tensors; got {re.escape(str(shape))}\.$"
    with pytest.raises(ValueError, match=message):
        CALLS[name](MESHES[2], np.ones(shape))


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("values", [np.full((32, 2, 2), 1j), np.full((32, 2, 2), "a")], ids=["complex", "text"])
def test_types(name, values):
    with pytest.raises(ValueError, match=rf"^{name} must be real numbers; got (complex128|<U1)\.$"):
        CALLS[name](MESHES[2], values)
