"""Run a detector in a process of its own, and take from it what can be trusted.

A detector may crash, hang, fill the disk, or print and return nonsense: what it does ends with its
process, and of what it says as many bytes are read as a sound detector needs. It gets one thread.
"""

from __future__ import annotations

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
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.audit.detectors import Detector

__all__ = ["Found", "Limits", "detections"]

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
        For one picture.
    start : float
        Until the detector is there, and more seconds for the first picture of a library's, which
        may compile its code.
    output : int
        Bytes that it may print, for all pictures together.
    """

    seconds: float = 20.0
    start: float = 60.0
    output: int = 2**18


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
    """

    keypoints: pd.DataFrame | None
    seconds: float
    problem: str
    version: str
    ended: bool = False


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
    since, allowed = time.monotonic(), limits.start
    for number, image in enumerate(images):
        found, failed = folder / f"found_{number:03d}.npz", folder / f"failed_{number:03d}.json"
        problem = ""
        while said.too_much or not (found.exists() or failed.exists()):
            over = process.poll() is not None
            if number == 0 and not version and started.exists():
                version = one_line(str(_read_json(started).get("version", ""))) or " "
                since, allowed = time.monotonic(), limits.seconds + more
            if said.too_much:
                problem = f"it printed more than {limits.output} bytes"
            elif over and not (found.exists() or failed.exists()):
                said.thread.join(timeout=1.0)
                problem = _how_it_ended(process.returncode, said.last_line())
            elif time.monotonic() - since > allowed:
                problem = f"it took more than {allowed:g} s for a picture"
            if problem:
                for _ in range(number, len(images)):
                    yield Found(None, math.nan, problem, version.strip(), ended=True)
                return
            time.sleep(_POLL)
        version = version or one_line(str(_read_json(started).get("version", "")))
        since, allowed = time.monotonic(), limits.seconds
        if failed.exists():
            problem = str(_read_json(failed).get("problem", "it failed"))
            if problem.startswith("it ended with status") and said.last_line():
                problem += f": {said.last_line()}"
            yield Found(None, math.nan, one_line(problem), version.strip())
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
