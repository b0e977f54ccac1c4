"""Run a detector in a process of its own, and take from it what can be trusted.

A detector may crash, hang, fill the disk, or print and return nonsense: what it does ends with its
process, and of what it says as many bytes are read as a sound detector needs. It gets one thread.

Its time is the processor's where that can be known, so that others on a busy machine take none of
it; a limit by the clock ends what waits for ever.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.audit.detectors import Detector

__all__ = ["Found", "Limits", "detections", "why_not_there"]

_ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS", "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)  # fmt: skip
_POLL = 0.02
_MOST_WORDS = 160


@dataclass(frozen=True)
class Limits:
    """What a detector may take.

    Parameters
    ----------
    seconds : float
        Of the processor for one picture, for all processes that it started together; by the clock
        where the processor's time is not known.
    start : float
        The same until the detector is there, and more seconds for the pictures of a library's
        together, of which the first may compile its code, and another the rest of it.
    output : int
        Bytes that it may print, for all pictures together.
    patience : float
        How many times as much it may take by the clock.
    """

    seconds: float = 20.0
    start: float = 60.0
    output: int = 2**18
    patience: float = 5.0


class Found(NamedTuple):
    """What a detector found in one picture.

    Attributes
    ----------
    keypoints : DataFrame or None
        Columns ``y, x, scale`` as the detector has them, and others that are known.
    seconds : float
        What it took.
    problem : str
        Why there are no keypoints, in one line.
    version : str
        Version of what was run.
    ended : bool
        Whether its process was ended, or ended, before this picture was done.
    not_there : bool
        Whether it could not even be imported or started.
    """

    keypoints: pd.DataFrame | None
    seconds: float
    problem: str
    version: str
    ended: bool = False
    not_there: bool = False


def detections(
    detector: Detector,
    images: Sequence[NDArray[np.float64]],
    blurs: Sequence[float],
    limits: Limits | None = None,
    python: str = sys.executable,
) -> Iterator[Found]:
    """What a detector finds in some pictures, one after the other in one process.

    After a crash, or a picture that takes too long, nothing more is asked of it: the other pictures
    have the same problem.

    Parameters
    ----------
    detector : Detector
    images : sequence of ndarray
        Grey values.
    blurs : sequence of float
        Camera blur of each, pixels.
    limits : Limits, optional
    python : str
        The Python that runs it, which needs numpy and what the detector needs.

    Yields
    ------
    Found
        One for each picture, in their order.
    """
    limits = limits or Limits()
    with tempfile.TemporaryDirectory(prefix="keystab-audit-") as name:
        folder = Path(name)
        job = {**detector.job, "blurs": [float(blur) for blur in blurs]}
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        for number, image in enumerate(images):
            np.save(folder / f"view_{number:03d}.npy", image)
        worker = Path(__file__).with_name("worker.py")
        process = subprocess.Popen(
            [python, "-P", str(worker), str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=os.environ | _ONE_THREAD,
            start_new_session=True,
        )
        assert process.stdout is not None
        said = _Said(process.stdout, limits.output)
        try:
            more = limits.start if detector.kind == "library" else 0.0
            yield from _answers(process, said, folder, images, limits, more)
        finally:
            _end(process)
            said.thread.join(timeout=1.0)


def why_not_there(
    detector: Detector, limits: Limits | None = None, python: str = sys.executable
) -> str:
    """Why a detector cannot be imported or started, from a try with one small picture.

    Parameters
    ----------
    detector, limits, python
        See `detections`; by the clock it gets no more than the limits say.

    Returns
    -------
    str
        One line; empty where it is there, though it may fail with this picture.
    """
    place = np.arange(64.0) - 31.5
    bump = np.exp(-(place**2) / 18.0)
    limits = replace(limits or Limits(), patience=1.0)
    (found,) = detections(detector, [0.2 + 0.6 * np.outer(bump, bump)], [0.5], limits, python)
    return found.problem if found.not_there else ""


class _Time:
    """What a process and those that it started have taken since a moment."""

    def __init__(self, pid: int, patience: float) -> None:
        self._pid, self._patience = pid, patience
        self.restart(math.inf)

    def restart(self, allowed: float) -> None:
        """Count from now on, up to a limit."""
        self._allowed, self._since, self._asked = allowed, time.monotonic(), -math.inf
        self._used = _processor_seconds(self._pid)

    def problem(self) -> str:
        """That it took too long, where it did."""
        clock = time.monotonic() - self._since
        allowed = self._allowed
        if clock <= allowed:
            return ""  # one thread takes no more of the processor, and it should have one
        if self._patience > 1 and clock > self._patience * allowed:
            return f"it took more than {self._patience * allowed:g} s by the clock"
        if clock - self._asked < min(0.5, allowed / 4):
            return ""  # asking costs milliseconds
        self._asked = clock
        over = self._patience <= 1 or self.taken() > allowed
        return f"it took more than {allowed:g} s" if over else ""

    def taken(self) -> float:
        """Seconds of the processor, where these are known, and no more than by the clock."""
        clock, used = time.monotonic() - self._since, _processor_seconds(self._pid)
        if self._used is None or used is None:
            return clock
        return min(clock, max(0.0, used - self._used))


def _processor_seconds(session: int) -> float | None:
    """Processor time of the processes of a session and of those that they waited for; Linux only.

    What has left the session is not seen before its end, if then.
    """
    total, known = 0, False
    try:
        ticks = os.sysconf("SC_CLK_TCK")
        for name in os.listdir("/proc"):
            if name.isdigit():
                with contextlib.suppress(OSError, ValueError, IndexError):  # it has just ended
                    about = Path("/proc", name, "stat").read_bytes().rpartition(b")")[2].split()
                    if int(about[3]) == session:
                        total += sum(map(int, about[11:15]))
                        known = True
    except (OSError, ValueError, AttributeError):
        return None
    return total / ticks if known else None


class _Said:
    """What a process prints: counted, and its end kept."""

    def __init__(self, stream: IO[bytes], most: int) -> None:
        self.count, self.end, self.most = 0, b"", most
        self._stream = stream
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self) -> None:
        with self._stream:
            while data := self._stream.read1(4096):  # type: ignore[attr-defined]
                self.count += len(data)
                self.end = (self.end + data)[-2000:]

    @property
    def too_much(self) -> bool:
        return self.count > self.most

    def last_line(self) -> str:
        lines = [line.strip() for line in self.end.decode("utf-8", "replace").splitlines()]
        return next((line for line in reversed(lines) if line), "")


def _answers(
    process: subprocess.Popen[bytes],
    said: _Said,
    folder: Path,
    images: Sequence[NDArray[np.float64]],
    limits: Limits,
    more: float,
) -> Iterator[Found]:
    version, started = "", folder / "started.json"
    taken = _Time(process.pid, limits.patience)
    taken.restart(limits.start)
    for number, image in enumerate(images):
        found, failed = folder / f"found_{number:03d}.npz", folder / f"failed_{number:03d}.json"
        problem = ""
        while said.too_much or not (found.exists() or failed.exists()):
            over = process.poll() is not None
            if number == 0 and not version and started.exists():
                version = one_line(str(_read_json(started).get("version", ""))) or " "
                taken.restart(limits.seconds + more)
            there = bool(version) or number > 0
            if said.too_much:
                problem = f"it printed more than {limits.output} bytes"
            elif over and not (found.exists() or failed.exists()):
                said.thread.join(timeout=1.0)
                problem = _how_it_ended(process.returncode, said.last_line())
            elif problem := taken.problem():
                problem += " for a picture (--time-limit)" if there else " to start"
            if problem:
                not_there = over and not there
                for _ in range(number, len(images)):
                    yield Found(None, math.nan, problem, version.strip(), True, not_there)
                return
            time.sleep(_POLL)
        version = version or one_line(str(_read_json(started).get("version", "")))
        more -= min(more, max(0.0, taken.taken() - limits.seconds))
        taken.restart(limits.seconds + more)
        if failed.exists():
            about = _read_json(failed)
            problem = str(about.get("problem", "it failed"))
            if problem.startswith("it ended with status") and said.last_line():
                problem += f": {said.last_line()}"
            not_there = about.get("not_there") is True
            yield Found(None, math.nan, one_line(problem), version.strip(), False, not_there)
        else:
            keypoints, seconds, problem = _checked(found, image.shape)
            yield Found(keypoints, seconds, problem, version.strip())


def _how_it_ended(status: int, last: str) -> str:
    if status < 0:
        try:
            how = f"it was ended by {signal.Signals(-status).name}"
        except ValueError:
            how = f"it was ended by signal {-status}"
    else:
        how = f"it ended with status {status} before it was done"
    return one_line(f"{how}: {last}" if last else how)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        process.kill()
    process.wait()


def _read_json(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            value = json.loads(file.read(100_000))
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}


def _checked(path: Path, shape: tuple[int, ...]) -> tuple[pd.DataFrame | None, float, str]:
    """Keypoints that a process wrote, where they are some; else what is wrong with them."""
    most = shape[0] * shape[1]
    try:
        if path.stat().st_size > 2000 + 8 * 8 * max(most, 2**21):
            return None, math.nan, "it found more keypoints than can be read"
        with np.load(path, allow_pickle=False) as file:
            columns = {name: np.asarray(file[name], dtype=np.float64) for name in file.files}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None, math.nan, "what it found cannot be read"
    seconds = float(columns.pop("seconds", np.array(math.nan)))
    needed = [columns.get(name, np.zeros((0, 0))) for name in ("y", "x", "scale")]
    if any(each.ndim != 1 for each in columns.values()) or any(each.ndim != 1 for each in needed):
        return None, seconds, "its columns are no lists of numbers"
    sizes = {len(each) for each in columns.values()}
    if len(sizes) != 1:
        return None, seconds, "its columns have different lengths"
    (n,) = sizes
    if n > most:
        return None, seconds, f"{n} keypoints, more than the picture has pixels"
    wrong = ~np.isfinite(np.stack(needed)).all(axis=0)
    if wrong.any():
        return None, seconds, f"{int(wrong.sum())} of {n} keypoints are at NaN or infinity"
    if (needed[2] <= 0).any():
        return (
            None,
            seconds,
            f"{int((needed[2] <= 0).sum())} of {n} keypoints have no scale above 0",
        )
    return pd.DataFrame(columns), seconds, "" if n else "it found nothing"


def one_line(text: str) -> str:
    r"""Words of a stranger as one short line of plain characters.

    Examples
    --------
    >>> one_line("no\x1b[31m such\n file")
    'no?[31m such file'
    """
    words = " ".join(text.split())
    plain = "".join(letter if letter.isprintable() else "?" for letter in words)
    return plain if len(plain) <= _MOST_WORDS else plain[: _MOST_WORDS - 3] + "..."
