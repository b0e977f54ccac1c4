"""Files appear whole or not at all."""

import pytest

from keystab.files import written_whole


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
