"""Cases of the command line as text, and sweeps of them without processes."""

import csv
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import kohonen_adapt as ka
from helpers.meshes import inset
from helpers.worlds import without_matplotlib
from kohonen_adapt import __main__ as cli

INSET = """
mesh = "mesh.msh"
scale = 1e-3
[materials.core]
permeability = 1000.0
remanence = [0.0, 1.2]
[materials.air]
[potential]
outer = 0.0
[adapt]
passes = 2
[outputs.stored]
quantity = "energy"
"""


def case_in(folder, text=INSET):
    """Write a case and its mesh, of 81 nodes, and return the file of the case."""
    mesh = inset(8)
    ka.write_mesh(folder / "mesh.msh", mesh.with_boundaries({"outer": mesh.boundary_facets()}))
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def run_in(folder, text=INSET):
    """Run a case without pictures; its file, beside the folder "out" with the results."""
    case = case_in(folder, text)
    with pytest.MonkeyPatch.context() as patched:
        without_matplotlib(patched)
        assert run_command("run", case, "--out", folder / "out", "--quiet") == 0
    return case


def report_in(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def dry_run(file, text):
    """Write a case, and return the exit status of a dry run of it."""
    file.write_text(text)
    return run_command("run", file, "--dry-run")


def table_of(file):
    """Return the rows of a CSV file, without times."""
    with file.open(newline="") as stream:
        return [{k: v for k, v in row.items() if not k.startswith("seconds")} for row in csv.DictReader(stream)]


def without_processes(monkeypatch):
    """Have the command compute the cases of sweeps by a thread, for the rest of a test."""
    pool = lambda prepare, jobs: ThreadPoolExecutor(1)  # noqa: E731
    monkeypatch.setattr("kohonen_adapt.commands.sweep.LocalPool", pool)


def whole(mesh):
    """A mesh with one name for all elements and one for its rim."""
    mesh = mesh.with_subdomains({"all": np.arange(mesh.nelements)})
    return mesh.with_boundaries({"rim": mesh.boundary_facets()})


def run_command(*words):
    """Call the command in this process, and return its exit status."""
    return cli.main([str(word) for word in words])


def said_of(mesh, tmp_path, capsys):
    """What is said of a mesh; the status is that of what is said."""
    ka.write_mesh(tmp_path / "it.msh", mesh)
    status = run_command("check", tmp_path / "it.msh")
    said = capsys.readouterr().out
    assert status == (0 if said.endswith("\nNo faults found.\n") else 1)
    return said
