"""Progress neither changes what it watches nor fills log files."""

import io

import pytest

from keystab.utils import progress as module
from keystab.utils.progress import progress


class Clock:
    """Seconds that pass only when told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module.time, "monotonic", clock)
    return clock


def work(clock, n, seconds):
    for i in range(n):
        clock.now += seconds
        yield i


def test_short_jobs_write_nothing_to_a_log(clock, capsys):
    assert list(progress(work(clock, 9, 1.0), 9, "views")) == list(range(9))
    assert capsys.readouterr().err == ""


def test_a_log_gets_a_line_every_ten_seconds(clock, capsys):
    assert list(progress(work(clock, 50, 0.7), 50, "views")) == list(range(50))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "views: 15 of 50, 11 s, about 25 s left",
        "views: 30 of 50, 21 s, about 14 s left",
        "views: 45 of 50, 32 s, about 4 s left",
        "views: 50 of 50, done in 35 s",
    ]


def test_the_last_line_comes_once(clock, capsys):
    list(progress(work(clock, 4, 5.0), 4, "views"))
    assert capsys.readouterr().err.splitlines() == [
        "views: 2 of 4, 10 s, about 10 s left",
        "views: 4 of 4, done in 20 s",
    ]


def test_a_terminal_gets_a_bar_that_disappears(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("keystab.utils.progress.DELAY", 0.0)
    assert list(progress("abc", 3, "letters")) == ["a", "b", "c"]
    assert "letters" in terminal.getvalue()
    assert terminal.getvalue().endswith("\r")


def test_a_generator_is_taken_one_item_at_a_time():
    taken = []
    for item in progress((taken.append(i) or i for i in range(5)), 5, "items"):
        assert taken == list(range(item + 1))


def test_failures_pass_through():
    def failing():
        yield 1
        raise ValueError("from below")

    with pytest.raises(ValueError, match="from below"):
        list(progress(failing(), 2, "items"))
