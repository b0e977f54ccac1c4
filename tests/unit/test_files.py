"""Files appear whole or not at all."""

import errno
import os
import subprocess

import pytest

from keystab.errors import InputError
from keystab.utils.files import check_writable, written_whole


def test_failure_leaves_what_was_there(tmp_path):
    target = tmp_path / "result.txt"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt), written_whole(target) as part:
        part.write_text("half")
        raise KeyboardInterrupt
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_file_is_replaced(tmp_path):
    target = tmp_path / "deep" / "result.txt"
    for text in ("one", "two"):
        with written_whole(target) as part:
            assert part.suffix == ".txt"
            part.write_text(text)
        assert target.read_text() == text
    assert list(target.parent.iterdir()) == [target]


def test_folder_is_replaced(tmp_path):
    target = tmp_path / "store"
    for name in ("one", "two"):
        with written_whole(target) as part:
            part.mkdir()
            (part / name).write_text(name)
        assert [p.name for p in target.iterdir()] == [name]
    with pytest.raises(RuntimeError), written_whole(target) as part:
        part.mkdir()
        raise RuntimeError
    assert [p.name for p in target.iterdir()] == ["two"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_writes_nothing_keeps_the_old_file(tmp_path):
    target = tmp_path / "result.txt"
    target.write_text("old")
    with pytest.raises(FileNotFoundError), written_whole(target):
        pass
    assert target.read_text() == "old"


def test_a_file_never_replaces_a_folder(tmp_path):
    target = tmp_path / "store.csv"
    target.mkdir()
    (target / "precious").write_text("kept")
    with pytest.raises(InputError, match=r"store\.csv is a folder; give a file name"):
        check_writable(target)
    with (
        pytest.raises(InputError, match=r"store\.csv is a folder; give a file name"),
        written_whole(target) as part,
    ):
        part.write_text("new")
    assert (target / "precious").read_text() == "kept"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_never_replaces_a_file(tmp_path):
    target = tmp_path / "result"
    target.write_text("kept")
    with pytest.raises(InputError, match="result is a file"), written_whole(target) as part:
        part.mkdir()
    assert target.read_text() == "kept"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_stays_when_its_successor_is_missing_or_cannot_be_put(tmp_path, monkeypatch):
    target = tmp_path / "store"
    target.mkdir()
    (target / "precious").write_text("kept")
    with pytest.raises(FileNotFoundError), written_whole(target):
        pass
    rename = type(target).rename

    def refuse(path, other):
        if path.name.startswith(".part"):
            raise OSError(errno.EIO, "broken", str(path))
        return rename(path, other)

    monkeypatch.setattr(type(target), "rename", refuse)
    with pytest.raises(OSError, match="broken"), written_whole(target) as part:
        part.mkdir()
    assert (target / "precious").read_text() == "kept"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(
    "raised",
    [
        lambda part: OSError(errno.ENOSPC, "No space left on device"),
        lambda part: PermissionError(errno.EACCES, "Permission denied", str(part)),
        lambda part: OSError(errno.EIO, f"cannot open '{part}'", str(part / "chunk")),
        lambda part: OSError(f"cannot open '{part}'"),
    ],
)
def test_errors_name_the_target(tmp_path, raised):
    target = tmp_path / "result.csv"
    with pytest.raises(OSError) as caught, written_whole(target) as part:
        error = raised(part)
        raise error
    assert caught.value is error  # of the same type and with the same number
    assert str(target) in str(caught.value) and ".part" not in str(caught.value)
    assert caught.value.errno is None or str(target) in caught.value.filename


def test_a_name_too_long_is_named_as_it_was_given(tmp_path):
    target = tmp_path / ("x" * 250 + ".csv")
    with pytest.raises(OSError) as caught, written_whole(target) as part:
        part.write_text("never")
    assert caught.value.errno == errno.ENAMETOOLONG and caught.value.filename == str(target)


def test_the_place_of_a_file_is_checked_beforehand(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    check_writable(tmp_path / "new" / "deep" / "t.CSV", (".csv",))
    check_writable(tmp_path / "file")
    for path, words in (
        (tmp_path / "file" / "t.csv", f"{tmp_path / 'file'} is no folder"),
        (tmp_path / "file" / "new" / "t.csv", f"{tmp_path / 'file'} is no folder"),
        (tmp_path / "t.txt", "cannot write '.txt'; use .csv or .parquet"),
    ):
        with pytest.raises(InputError) as raised:
            check_writable(path, (".csv", ".parquet"))
        assert words in str(raised.value)
    with pytest.raises(InputError, match="is no folder"), written_whole(tmp_path / "file" / "t"):
        pass
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(InputError, match="cannot be written to"):
        check_writable(tmp_path / "new" / "t.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_what_a_killed_process_left_is_removed_by_the_next_that_writes(tmp_path):
    dead = subprocess.Popen(["true"])
    dead.wait()
    target = tmp_path / "result.txt"
    left = [f".part-{dead.pid}-result.txt", f".old-{dead.pid}-result.txt"]
    kept = [f".part-{os.getppid()}-result.txt", f".part-{dead.pid}-other.txt", "result.txt.part"]
    for name in left + kept:
        (tmp_path / name).write_text("half")
    with written_whole(target) as part:
        part.write_text("whole")
    assert {path.name for path in tmp_path.iterdir()} == {"result.txt", *kept}


@pytest.mark.parametrize("exists", [True, False])
def test_a_file_is_written_through_a_link(tmp_path, exists):
    kept, links = tmp_path / "kept", tmp_path / "links"
    kept.mkdir(), links.mkdir()
    (links / "once.csv").symlink_to("../kept/data")  # relative, and of another suffix
    (links / "twice.csv").symlink_to(links / "once.csv")
    if exists:
        (kept / "data").write_text("old")
    check_writable(links / "twice.csv", (".csv",))
    with written_whole(links / "twice.csv") as part:
        assert part.suffix == ".csv"  # what the writer goes by
        part.write_text("new")
        assert (kept / "data").exists() == exists
    assert (kept / "data").read_text() == "new"
    assert all((links / name).is_symlink() for name in ("once.csv", "twice.csv"))
    assert [path.name for path in kept.iterdir()] == ["data"]


def test_a_folder_is_written_through_a_link(tmp_path):
    for name in ("one", "two"):
        (tmp_path / "store").mkdir(exist_ok=True)
        (tmp_path / "link").unlink(missing_ok=True)
        (tmp_path / "link").symlink_to("store")
        with written_whole(tmp_path / "link") as part:
            part.mkdir()
            (part / name).touch()
        assert [path.name for path in (tmp_path / "store").iterdir()] == [name]
    assert {path.name for path in tmp_path.iterdir()} == {"link", "store"}


def test_links_in_a_circle_and_devices_are_refused(tmp_path):
    (tmp_path / "a.csv").symlink_to("b.csv")
    (tmp_path / "b.csv").symlink_to("a.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "null.csv").symlink_to(os.devnull)
    for name, words in (("a", "in a circle"), ("pipe", "neither a file"), ("null", "neither a")):
        path = tmp_path / f"{name}.csv"
        with pytest.raises(InputError, match=f"{name}.csv is .*{words}"):
            check_writable(path)
        with pytest.raises(InputError, match=words), written_whole(path):
            pass
    assert len(list(tmp_path.iterdir())) == 4


def test_what_a_killed_process_left_beside_the_file_of_a_link_is_removed(tmp_path):
    dead = subprocess.Popen(["true"])
    dead.wait()
    (tmp_path / f".part-{dead.pid}-data.csv").touch()
    (tmp_path / "link.csv").symlink_to("data")
    with written_whole(tmp_path / "link.csv") as part:
        part.touch()
    assert {path.name for path in tmp_path.iterdir()} == {"link.csv", "data"}
