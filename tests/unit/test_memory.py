"""Memory is asked about before it is taken."""

import errno
import mmap

import pytest

from keystab.errors import InputError
from keystab.utils import memory


def test_available_memory_is_plausible():
    assert mmap.PAGESIZE < memory.available() < 2**63


def test_a_limit_of_the_machine_is_named(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 3_000_000_000)
    memory.require(3e9, "a fitting thing", "nothing")
    with pytest.raises(InputError) as raised:
        memory.require(1.25e12, "a view", "ask for less")
    assert str(raised.value) == (
        "a view needs about 1.25 TB of memory, 3 GB are available: ask for less"
    )


def test_a_machine_without_proc_still_answers(monkeypatch):
    def nothing(path):
        raise FileNotFoundError(path)

    monkeypatch.setattr(memory.Path, "read_text", nothing)
    assert memory.available() > mmap.PAGESIZE


@pytest.fixture
def machine(monkeypatch):
    """Makes a machine of files that the kernel would write, and a limit of the shell."""

    def made(files, addresses=None):
        def read(path):
            if str(path) not in files:
                raise FileNotFoundError(path)
            return files[str(path)]

        monkeypatch.setattr(memory.Path, "read_text", read)
        monkeypatch.setattr(memory, "reserved", lambda: addresses)

    return made


FREE = {"/proc/meminfo": "MemTotal: 9000 kB\nMemAvailable:    5000 kB\nSwapFree: 7 kB\n"}
GROUP = "/sys/fs/cgroup/memory."


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (FREE, 5000 * 1024),
        (FREE | {GROUP + "max": "max\n", GROUP + "current": "1000\n"}, 5000 * 1024),
        (FREE | {GROUP + "max": "3000000\n", GROUP + "current": "1000000\n"}, 2_000_000),
        (FREE | {GROUP + "max": "9000000\n", GROUP + "current": "1000\n"}, 5000 * 1024),
        (FREE | {GROUP + "max": "3000000\n", GROUP + "current": "3000001\n"}, 0),
    ],
)
def test_what_is_left_is_the_least_of_what_kernel_and_container_leave(machine, files, expected):
    machine(files)
    assert memory.available() == expected


@pytest.mark.parametrize(("limit", "expected"), [(9_000, 8_000), (10**9, 5000 * 1024), (500, 0)])
def test_a_limit_of_the_shell_counts_by_what_is_taken(machine, monkeypatch, limit, expected):
    machine(FREE, limit)
    monkeypatch.setattr(memory, "_taken", lambda: 1_000)
    assert memory.available() == expected


def test_libraries_start_with_the_least_that_they_take_and_not_with_less(machine):
    for limit in (None, memory.LEAST):
        machine({}, limit)
        memory.require_start()
    machine({}, memory.LEAST - 1)
    with pytest.raises(InputError, match="this shell limits memory to"):
        memory.require_start()


@pytest.mark.parametrize(
    ("error", "without", "under"),
    [
        (MemoryError(), True, True),
        (ImportError(), False, True),
        (RuntimeError(), False, True),
        (OSError(errno.ENOMEM, "no memory"), False, True),
        (OSError(errno.ENOENT, "no file"), False, False),
        (ValueError(), False, False),
    ],
)
def test_what_a_limit_of_memory_explains(machine, error, without, under):
    machine({}, None)
    assert bool(memory.too_little(error)) == without
    machine({}, 4_000_000_000)
    said = memory.too_little(error)
    assert (said is not None and "4 GB (ulimit -v)" in said) == under


def test_units_begin_at_their_size():
    assert [memory.in_words(it) for it in (999, 1000, 999_499, 1e6, 1e9, 1e12)] == [
        "999 bytes", "1 kB", "999 kB", "1 MB", "1 GB", "1 TB",
    ]  # fmt: skip


def test_a_limit_of_addresses_is_the_soft_one_and_none_where_there_is_no_end(monkeypatch):
    import resource

    for soft, expected in ((resource.RLIM_INFINITY, None), (10**9, 10**9), (0, 0)):
        monkeypatch.setattr(resource, "getrlimit", lambda kind, soft=soft: (soft, 7 * 10**9))
        assert memory.reserved() == expected
