"""Files that are written whole or not at all, alone and together."""

import pytest

from kohonen_adapt.files import remove_drafts, whole_file, whole_files


def names_in(folder):
    return sorted(file.name for file in folder.iterdir())


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


def test_drafts_of_the_dead_go_and_nothing_else(tmp_path):
    kept = ["a.draft", ".a.draft", ".a.1.draft.txt", "a.1.draft", ".a.x.draft"]
    for name in (*kept, ".a.1.draft", ".b.2.draft"):
        (tmp_path / name).touch()
    (tmp_path / ".files.1.draft").mkdir()
    (tmp_path / ".files.1.draft" / "inner").touch()
    remove_drafts(tmp_path, "b", "c")
    assert names_in(tmp_path) == sorted([*kept, ".a.1.draft", ".files.1.draft"])
    remove_drafts(tmp_path)
    assert names_in(tmp_path) == sorted(kept)
