"""A cache that cannot be written or read costs time, and a Ctrl-C while a loop is compiled is heard."""

import os
import signal
from pathlib import Path

import pytest
from helpers.copied_kernels import fast_compiler_only, make_package
from helpers.processes import python

LOOPS = """
from .numba.compilation import inner_kernel, kernel

@inner_kernel
def scale(x):
    return {factor} * x

@kernel
def scaled(x):
    return scale(x) + 1.0
"""
RUN = """
{before}
from copied.loops import scaled
print(scaled(1.0), sum(scaled.stats.cache_hits.values()))
"""
pytestmark = pytest.mark.slow

SAID = "compiled loops of kohonen_adapt cannot be stored in '"
REMEDY = "so every process compiles them again. Set NUMBA_CACHE_DIR to a writable folder."


@pytest.fixture
def kernels(tmp_path):
    """A package of two loops, whose code goes to a folder of its own."""
    folder = tmp_path / "copied"
    make_package(folder)
    (folder / "loops.py").write_text(LOOPS.format(factor=2))
    return folder


def run(kernels, before="", code=RUN, **environment):
    """What a process prints and says that calls the loop."""
    environment = {"NUMBA_CACHE_DIR": str(kernels.parent / "cache"), **environment}
    return python("-c", code.format(before=before), cwd=kernels.parent, **environment)


def without_a_folder(kernels):
    """The environment of a process that finds no folder for its cache, whoever runs it: each is below a file."""
    (kernels.parent / "file").touch()
    (kernels / "__pycache__").touch()
    nowhere = str(kernels.parent / "file" / "below")
    return {"NUMBA_CACHE_DIR": nowhere, "HOME": nowhere, "XDG_CACHE_HOME": nowhere}


def test_where_no_cache_folder_can_be_written_loops_are_compiled_and_one_warning_says_so(kernels):
    done = run(kernels, **without_a_folder(kernels))
    assert done.stdout.split() == ["3.0", "0"]
    (line,) = done.stderr.splitlines()
    assert line.startswith(SAID + str(kernels.parent / "file" / "below")) and line.endswith(f"), {REMEDY}")


def test_code_of_a_cache_that_can_only_be_read_is_found_there(kernels):
    """As in an image that was built by another user. Nobody makes the folder writable: numba's own way is closed."""
    assert run(kernels).stdout.split() == ["3.0", "0"]
    closed = "import tempfile\ndef refused(**given):\n    raise PermissionError(13, 'Permission denied')\n"
    done = run(kernels, before=f"{closed}tempfile.TemporaryFile = refused")
    assert done.stdout.split() == ["3.0", "1"] and done.stderr == ""


def cut(content):
    return content[: len(content) // 2]


def turned(content):
    at = len(content) // 2
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


DAMAGES = {
    "empty": lambda content: b"",
    "cut": cut,
    "one byte": lambda content: content[:1],
    "one bit": turned,
    "zeros": lambda content: bytes(len(content)),
    "text": lambda content: b"no machine code",
    "more": lambda content: content + b"more",
    "another pickle": lambda content: b"\x80\x04N.",
}


MANY = "from .numba.compilation import kernel\n" + "".join(
    f"\n@kernel\ndef loop_{number}(x):\n    return {number} + x\n" for number in range(2 * len(DAMAGES))
)
RUN_MANY = """
from copied import loops
found = [vars(loops)["loop_%d" % number] for number in range(COUNT)]
print(*[int(loop(0)) for loop in found], sum(sum(loop.stats.cache_hits.values()) for loop in found))
"""


@pytest.mark.slow
def test_damaged_files_of_the_cache_are_missing_ones(kernels):
    """Every damage to the index of one loop and to the code of another."""
    (kernels / "loops.py").write_text(MANY)
    count, code = 2 * len(DAMAGES), RUN_MANY.replace("COUNT", str(2 * len(DAMAGES)))
    values = [str(number) for number in range(count)]
    assert run(kernels, code=code).stdout.split() == [*values, "0"]
    before = {}
    for number in range(count):
        suffix = ("nbi", "nbc")[number % 2]
        (file,) = kernels.parent.glob(f"cache/*/*/loops.loop_{number}-*.{suffix}")
        before[file] = file.read_bytes()
        file.write_bytes(list(DAMAGES.values())[number // 2](before[file]))
    done = run(kernels, code=code)
    assert done.stdout.split() == [*values, "0"] and done.stderr == ""
    assert {file: file.read_bytes() for file in before} == before
    assert run(kernels, code=code).stdout.split() == [*values, str(count)]


def test_a_folder_in_place_of_a_file_of_the_cache_is_a_missing_one(kernels):
    run(kernels)
    for file in list(kernels.parent.glob("cache/*/*/*.nb*")):
        file.unlink()
        file.mkdir()
    done = run(kernels)
    assert done.stdout.split() == ["3.0", "0"]
    assert done.stderr.count("\n") == 1 and SAID in done.stderr and "directory), so every" in done.stderr


FULL = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (64, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
def test_a_full_disk_while_compiling_is_said_once_and_ends_nothing(kernels):
    done = run(kernels, before=FULL, PYTHONDONTWRITEBYTECODE="1")
    assert done.stdout.split() == ["3.0", "0"]
    (line,) = done.stderr.splitlines()
    assert line.startswith(SAID + str(kernels.parent / "cache")) and line.endswith(f" (File too large), {REMEDY}")
    assert not [file for file in kernels.parent.glob("cache/*/*/*") if "nb" in file.name]
    assert run(kernels).stdout.split() == ["3.0", "0"]
    assert run(kernels).stdout.split() == ["3.0", "1"]


# A signal in the moment in which LLVM hands machine code to Python.
INTERRUPTED = """
import signal, sys
import skfem, kohonen_adapt as ka
sys.path.insert(0, {examples!r})
from own_problem import Poisson
signal.signal(signal.SIGINT, signal.default_int_handler)

def interrupt(frame, event, arg):
    if event == "call" and frame.f_code.co_name == "_raw_object_cache_notify":
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)

def progress(number, step):
    if step == "relocate":
        sys.setprofile(interrupt)

result = ka.adapt(skfem.MeshTri().refined(3), Poisson(), passes=1, progress=progress)
print(result.status, result.message)
"""


@fast_compiler_only
@pytest.mark.skipif(not hasattr(signal, "raise_signal") or os.name == "nt", reason="signals of POSIX")
def test_a_ctrl_c_inside_a_compilation_stops_the_loop(tmp_path):
    code = INTERRUPTED.format(examples=str(Path(__file__).parents[2] / "examples"))
    done = python("-c", code, NUMBA_CACHE_DIR=str(tmp_path), NUMBA_NUM_THREADS="1")
    assert done.stdout.startswith("stopped Stopped by Ctrl-C after 0 passes. Best: the input, ")
    assert "Traceback" not in done.stderr


TWICE = """
import signal, sys
from copied.loops import scaled
heard = []
signal.signal(signal.SIGINT, lambda *given: heard.append(given))

def interrupt(frame, event, arg):
    if event == "call" and frame.f_code.co_name == "_raw_object_cache_notify":
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)

sys.setprofile(interrupt)
print(scaled(1.0), len(heard), signal.getsignal(signal.SIGINT).__name__)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_handler_of_somebody_else_hears_of_a_ctrl_c_inside_a_compilation(kernels):
    done = run(kernels, code=TWICE)
    assert done.stdout.strip() == "3.0 1 <lambda>"
