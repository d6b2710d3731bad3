"""What is built for a package index is whole: the package, the examples it brings along, its description."""

import re
import tarfile
import tomllib
import zipfile
from email.parser import BytesParser
from pathlib import Path

import pytest
from helpers.places import PACKAGE, ROOT
from helpers.processes import python

import kohonen_adapt as ka

pytestmark = pytest.mark.slow

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and source distribution."""
    pytest.importorskip("hatchling")
    pytest.importorskip("hatch_fancy_pypi_readme")
    folder = tmp_path_factory.mktemp("built")
    python("-m", "hatchling", "build", "--directory", folder, cwd=ROOT)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


@pytest.fixture(scope="module")
def wheel(built):
    with zipfile.ZipFile(built[0]) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def metadata(wheel):
    (name,) = [name for name in wheel if name.endswith(".dist-info/METADATA")]
    return BytesParser().parsebytes(wheel[name])


def examples_it_brings(wheel):
    return {name.rpartition("/")[2]: held for name, held in wheel.items() if name.startswith("kohonen_adapt/data/")}


def files_of_the_package():
    """Those that an editable install has, but for the sources of the site."""
    files = [path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    return {path for path in files if path.relative_to(PACKAGE).parts[0] != "docs"}


def test_a_wheel_is_the_package_as_it_stands(wheel):
    wanted = {str(path.relative_to(ROOT)): path.read_bytes() for path in files_of_the_package()}
    brought = {
        name: held
        for name, held in wheel.items()
        if not re.match(r"kohonen_adapt(/data/|/CITATION|-[^/]*dist-info/)", name)
    }
    assert brought.keys() == wanted.keys()
    assert brought == wanted


def test_the_examples_of_a_wheel_are_those_of_an_editable_install(wheel):
    brought = examples_it_brings(wheel)
    assert brought == {name: (ROOT / "examples" / name).read_bytes() for name in brought}
    assert brought.keys() == {"magnet.toml", "c_core.msh"}


def test_a_wheel_says_how_to_cite_it(wheel):
    assert wheel["kohonen_adapt/CITATION.cff"] == (ROOT / "CITATION.cff").read_bytes()


def test_the_case_of_a_wheel_finds_its_mesh(built, tmp_path):
    with zipfile.ZipFile(built[0]) as archive:
        archive.extractall(tmp_path)
    case = tmp_path / "kohonen_adapt" / "data" / "magnet.toml"
    command = "-m", "kohonen_adapt", "run", case, "--dry-run"
    done = python(*command, cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert "no faults found; 'c_core.msh' has 899 nodes" in done.stdout.replace(f"{case.parent}/", "")


def test_the_sources_are_all_there(built):
    with tarfile.open(built[1]) as archive:
        names = {"/".join(name.split("/")[1:]) for name in archive.getnames()}
    at_the_root = ("pyproject.toml", "README.md", "LICENSE", "CITATION.cff")
    for path in (*at_the_root, "examples/motor.msh", "kohonen_adapt/CHANGELOG.md"):
        assert path in names
    assert {f"tests/package/{Path(__file__).name}", "benchmarks/__main__.py"} <= names


def test_its_description_needs_nothing_beside_it(metadata):
    """Neither pictures nor links that lead nowhere from a package index."""
    text = metadata.get_payload()
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert "# kohonen_adapt" in text and "(`examples/README.md` among the sources)" in text
    assert "![" not in text
    assert [link for link in re.findall(r"\]\(([^)]*)\)", text) if not link.startswith("https://")] == []


def test_every_file_that_its_description_names_is_among_the_sources(metadata):
    named = re.findall(r"\(`([^`]+)` among the sources\)", metadata.get_payload())
    assert named and all((ROOT / name).exists() for name in named)


def test_the_index_is_told_what_pyproject_says(metadata):
    assert metadata["Version"] == ka.__version__
    assert metadata["License-Expression"] == PROJECT["license"]
    assert metadata.get_all("Classifier") == sorted(PROJECT["classifiers"])
    assert set(metadata.get_all("Provides-Extra")) == PROJECT["optional-dependencies"].keys()


def cited(key):
    """A line of the citation's top level."""
    (value,) = re.findall(rf"^{key}: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    return value


def test_the_citation_is_of_this_version():
    assert cited("version") == ka.__version__
    assert cited("title") == PROJECT["name"] and cited("license") == PROJECT["license"]
    assert f"- name: {PROJECT['authors'][0]['name']}" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
