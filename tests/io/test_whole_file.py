"""Files that are written whole or not at all, alone and together."""

import errno
import os
import stat
import threading

import pytest
from helpers.places import names_in
from helpers.processes import leave_drafts

from kohonen_adapt.files import DRAFT, SUFFIX, remove_drafts, whole_file, whole_files

needs_modes = pytest.mark.skipif(os.name == "nt", reason="modes and locks of POSIX")


def write(path, text):
    with whole_file(path) as draft:
        draft.write_text(text)


def test_files_that_belong_together_come_together(tmp_path):
    (tmp_path / "one").write_text("old")
    with whole_files(tmp_path) as draft:
        (draft / "one").write_text("new")
        (draft / "two").write_text("new")
        assert (tmp_path / "one").read_text() == "old" and not (tmp_path / "two").exists()
    assert names_in(tmp_path) == ["one", "two"]
    assert (tmp_path / "one").read_text() == "new"


def test_if_one_of_them_goes_wrong_none_comes(tmp_path):
    with pytest.raises(OSError, match="full") as raised, whole_files(tmp_path) as draft:
        (draft / "one").write_text("new")
        with whole_file(draft / "two"):
            raise OSError(28, "full", "somewhere")
    assert names_in(tmp_path) == []
    assert raised.value.filename == str(tmp_path / "two")


def test_threads_that_write_one_name_leave_one_of_their_files_whole(tmp_path):
    path, texts, together = tmp_path / "mesh.msh", [letter * 300_000 for letter in "abcd"], threading.Barrier(4)

    def write_together(text):
        together.wait()
        with whole_file(path) as draft, draft.open("w") as stream:
            for first in range(0, len(text), 10_000):
                stream.write(text[first : first + 10_000])
                stream.flush()

    for _ in range(20):
        threads = [threading.Thread(target=write_together, args=(text,)) for text in texts]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert path.read_text() in texts
    assert names_in(tmp_path) == ["mesh.msh"]


def test_a_link_under_the_name_of_a_draft_is_not_followed(tmp_path):
    """Whoever knew how drafts are called could have a file of somebody else overwritten."""
    (tmp_path / "precious").write_text("theirs")
    with whole_file(tmp_path / "mesh.msh") as draft:
        draft.touch()
    draft.parent.mkdir(exist_ok=True)
    draft.symlink_to(tmp_path / "precious")
    write(tmp_path / "mesh.msh", "ours")
    assert (tmp_path / "precious").read_text() == "theirs"
    assert (tmp_path / "mesh.msh").read_text() == "ours"


@needs_modes
def test_no_other_user_can_reach_a_draft(tmp_path):
    with whole_file(tmp_path / "mesh.msh") as draft:
        assert stat.S_IMODE(draft.parent.stat().st_mode) == 0o700
        draft.touch()


@needs_modes
def test_a_new_file_has_the_mode_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        write(tmp_path / "new", "")
        (tmp_path / "plain").touch()
    finally:
        os.umask(before)
    assert [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("new", "plain")] == [0o640, 0o640]


@needs_modes
@pytest.mark.parametrize("mode", [0o600, 0o664, 0o444])
def test_a_file_keeps_the_mode_of_the_one_that_it_replaces(mode, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "file").chmod(mode)
    for text in ("one", "two"):
        write(tmp_path / "file", text)
        assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == mode
        assert (tmp_path / "file").read_text() == text


@pytest.mark.parametrize("together", [False, True])
def test_content_is_on_disk_before_its_name_and_the_name_at_the_end(together, tmp_path, monkeypatch):
    calls, fsync, replace = [], os.fsync, os.replace

    def synced(descriptor):
        calls.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        fsync(descriptor)

    def renamed(source, target):
        calls.append("name")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", renamed)
    if together:
        with whole_files(tmp_path) as draft:
            (draft / "mesh.msh").write_text("text")
    else:
        write(tmp_path / "mesh.msh", "text")
    assert calls == (["file", "name"] if os.name == "nt" else ["file", "name", "folder"])


def test_the_message_of_a_full_disk_ends_in_the_name_of_the_file(tmp_path):
    path = tmp_path / "mesh.msh"
    with pytest.raises(OSError, match="full") as raised, whole_file(path):
        raise OSError(errno.ENOSPC, "full", "one", None, "other")
    assert str(raised.value) == f"[Errno {errno.ENOSPC}] full: '{path}'"
    with pytest.raises(OSError, match="full") as raised, whole_files(tmp_path) as draft:
        raise OSError(errno.ENOSPC, "full", str(draft / "mesh.msh"), None, "other")
    assert str(raised.value) == f"[Errno {errno.ENOSPC}] full: '{path}'"


def test_an_error_of_numpy_gets_the_name_of_the_file(tmp_path):
    path = tmp_path / "pass-0000.npz"
    with pytest.raises(OSError, match="written") as raised, whole_file(path):
        raise OSError("80 requested and 16 written")
    assert str(raised.value) == f"[Errno {errno.EIO}] 80 requested and 16 written: '{path}'"


def test_a_folder_is_not_replaced(tmp_path):
    with pytest.raises(OSError, match=r"expected the name of a file; got that of a folder or device: '.*there'"):
        write(_made(tmp_path / "there"), "text")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_device_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match=r"expected the name of a file; got that of a folder or device: '.*pipe'"):
        write(tmp_path / "pipe", "text")
    assert (tmp_path / "pipe").is_fifo()


def _made(folder):
    folder.mkdir()
    return folder


# ---- drafts of the dead ----


def test_drafts_of_the_dead_go_and_nothing_else(tmp_path):
    kept = ["a.draft", ".a.draft", ".a.1.draft", ".kohonen-adapt.txt", ".kohonen-adapt.a_file.draft"]
    leave_drafts(tmp_path / "mesh.msh")
    for name in kept:
        (tmp_path / name).touch()
    _made(tmp_path / ".kohonen-adapt.mine.draft").joinpath("work").touch()
    remove_drafts(tmp_path)
    assert names_in(tmp_path) == sorted([*kept, ".kohonen-adapt.mine.draft"])


def test_drafts_of_the_living_stay(tmp_path):
    with whole_file(tmp_path / "one") as one, whole_files(tmp_path) as many:
        one.write_text("all")
        (many / "two").write_text("all")
        remove_drafts(tmp_path)
    assert names_in(tmp_path) == ["one", "two"]
    assert (tmp_path / "one").read_text() == (tmp_path / "two").read_text() == "all"


def test_a_link_under_the_name_of_a_draft_loses_nothing(tmp_path):
    _made(tmp_path / "elsewhere").joinpath("file").touch()
    for number, target in enumerate([tmp_path / "elsewhere", tmp_path / "elsewhere" / "file"]):
        (tmp_path / f"{DRAFT}99999999.{number}{SUFFIX}").symlink_to(target)
    before = sorted(tmp_path.rglob("*"))
    remove_drafts(tmp_path)
    assert sorted(tmp_path.rglob("*")) == before


def test_drafts_of_another_computer_stay(tmp_path):
    _made(tmp_path / ".kohonen-adapt.elsewhere.99999999.a.draft")
    remove_drafts(tmp_path)
    assert len(names_in(tmp_path)) == 1


def test_writers_and_clean_ups_side_by_side(tmp_path):
    """A clean-up takes nothing from a writer that runs."""
    ended = threading.Event()

    def clean():
        while not ended.is_set():
            remove_drafts(tmp_path)

    cleaner = threading.Thread(target=clean)
    cleaner.start()
    try:
        for number in range(200):
            write(tmp_path / "file", str(number))
            assert (tmp_path / "file").read_text() == str(number)
    finally:
        ended.set()
        cleaner.join()
    assert names_in(tmp_path) == ["file"]
