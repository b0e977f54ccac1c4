"""The process in which a detector runs; it needs Python, numpy and the detector, nothing else.

    python worker.py FOLDER

reads ``job.json`` and ``view_000.npy`` and so on from the folder, and writes for each view either
``found_000.npz``, the keypoints as the detector has them, or ``failed_000.json``, one line that
says why there are none. A detector may crash, hang or print what it likes: who started this process
watches it (`keystab.audit.isolation`). It may be of another environment than keystab.

Each detector is a function of a grey image of values in [0, 1] and of the image's camera blur,
which most ignore. It returns columns ``y``, ``x`` and ``scale`` as its library means them.
"""

from __future__ import annotations

import contextlib
import csv
import importlib
import importlib.metadata
import inspect
import json
import os
import pkgutil
import shlex
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

Columns = dict[str, Any]

#: Bytes of the largest file that a detector may write, and of the memory that it may hold.
MOST_WRITTEN, MOST_MEMORY = 2**28, 2**33

KNOWN = ("y", "x", "scale", "value", "std_y", "std_x", "cov_yx")
"""Columns that are looked at."""


# ---------------------------------------------------------------------------------------------
# Detectors of libraries


def keystab(image: Any, camera_blur: float, bars: bool = False, **options: Any) -> Columns:
    """Detect with this project's own detector, in as many octaves as the audit asks for."""
    import keystab as library

    search = library.keypoint_uncertainty if bars else library.detect_keypoints
    found = search(image, camera_blur, sigma_min=max(1.1, camera_blur), n_oct=3, **options)
    columns = {name: found[name].to_numpy() for name in ("y", "x", "value")}
    columns |= {name: found[name].to_numpy() for name in KNOWN[4:] if name in found}
    return {**columns, "scale": found["sigma"].to_numpy()}


def opencv(image: Any, camera_blur: float, kind: str = "SIFT", **options: Any) -> Columns:
    """Detect with SIFT, KAZE or AKAZE of OpenCV, of an image of 8 bits."""
    import cv2

    cv2.setNumThreads(1)
    room: Any = cv2 if hasattr(cv2, f"{kind}_create") else vars(cv2)["xfeatures2d"]
    found = getattr(room, f"{kind}_create")(**options).detect(eight_bits(image), None)
    return of_opencv(found)


def skimage(image: Any, camera_blur: float, **options: Any) -> Columns:
    """Detect with scikit-image's SIFT."""
    from skimage.feature import SIFT

    detector = SIFT(**options)
    try:
        detector.detect(image)
    except RuntimeError as error:
        if "no features" not in str(error):
            raise
        return dict.fromkeys(("y", "x", "scale"), np.zeros(0))
    y, x = np.asarray(detector.positions).T
    return {"y": y, "x": x, "scale": detector.sigmas}


def vlfeat(image: Any, camera_blur: float, **options: Any) -> Columns:
    """Detect with SIFT of VLFeat, of grey values up to 255, as its thresholds are meant."""
    from vlsift.sift.sift import sift

    pixels = np.ascontiguousarray(255 * image, dtype=np.float32)
    y, x, scale, _ = np.asarray(sift(pixels, **options)).reshape(-1, 4).T
    return {"y": y, "x": x, "scale": scale}


def colmap(image: Any, camera_blur: float, **options: Any) -> Columns:
    """Detect with COLMAP's SIFT on the processor."""
    import pycolmap

    pycolmap.logging.minloglevel = 2
    settings = pycolmap.FeatureExtractionOptions()
    settings.num_threads, settings.use_gpu = 1, False
    for name, value in options.items():
        setattr(settings.sift, name, value)
    extractor = pycolmap.FeatureExtractor.create(settings, pycolmap.Device.cpu)
    found, _ = extractor.extract_from_float32_array(np.clip(image, 0, 1).astype(np.float32))
    rows = [(k.y, k.x, k.compute_scale()) for k in found]
    y, x, scale = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    return {"y": y, "x": x, "scale": scale}


def kornia(image: Any, camera_blur: float, **options: Any) -> Columns:
    """Detect with the detector of kornia's SIFT in scale-space."""
    import torch
    from kornia.feature import SIFTFeatureScaleSpace

    torch.set_num_threads(1)
    detector = SIFTFeatureScaleSpace(upright=True, **options).detector
    with torch.inference_mode():
        frames, response = detector(torch.from_numpy(image.astype(np.float32))[None, None])
    (frames,), (value,) = frames.numpy(), response.numpy()
    scale = np.sqrt(np.abs(np.linalg.det(frames[:, :, :2])))
    columns = {"y": frames[:, 1, 2], "x": frames[:, 0, 2], "scale": scale, "value": value}
    return {name: each[scale > 0] for name, each in columns.items()}


LIBRARIES: dict[str, tuple[Callable[..., Columns], tuple[str, ...]]] = {
    "keystab": (keystab, ("keystab",)),
    "opencv": (opencv, ("opencv-contrib-python-headless", "opencv-python-headless",
                        "opencv-contrib-python", "opencv-python")),
    "skimage": (skimage, ("scikit-image",)),
    "vlfeat": (vlfeat, ("vlsift",)),
    "colmap": (colmap, ("pycolmap",)),
    "kornia": (kornia, ("kornia",)),
}  # fmt: skip
"""Detectors of libraries, and the distributions whose version is theirs."""


def eight_bits(image: Any) -> Any:
    """Image of 8 bits, as detectors read from files."""
    return np.ascontiguousarray(np.round(255 * np.clip(image, 0, 1)).astype(np.uint8))


# ---------------------------------------------------------------------------------------------
# Detectors of a person's own


def own_function(name: str, order: str) -> Callable[..., Columns]:
    """Detector ``module:function``; modules in the folder of work are found too."""
    sys.path.insert(0, os.getcwd())
    try:
        function = pkgutil.resolve_name(name)
    except ModuleNotFoundError as error:
        if error.name != name.partition(":")[0].partition(".")[0]:
            raise
        raise FileNotFoundError(
            f"there is no module {error.name} in {os.getcwd()}, nor is one installed"
        ) from None
    if not callable(function):
        raise TypeError(f"{name} is no function")
    try:
        takes_blur = len(inspect.signature(function).parameters) > 1
    except (TypeError, ValueError):  # of compiled code nothing is known
        takes_blur = True

    def detect(image: Any, camera_blur: float) -> Columns:
        found = function(image, camera_blur) if takes_blur else function(image)
        return columns_of(found, order)

    return detect


def own_command(command: str, folder: Path) -> Callable[..., Columns]:
    """Detector that is given a picture's path and writes a table."""
    words = shlex.split(command)

    def detect(image: Any, camera_blur: float) -> Columns:
        picture, table = folder / "picture.png", folder / "table.csv"
        table.unlink(missing_ok=True)
        picture.write_bytes(png(eight_bits(image)))
        names = {"{picture}": picture, "{table}": table, "{camera_blur}": camera_blur}
        filled = words
        for name, value in names.items():
            filled = [word.replace(name, str(value)) for word in filled]
        try:
            ended = subprocess.run(filled, stdin=subprocess.DEVNULL)
        except OSError as error:
            raise NotThereError(f"{filled[0]} cannot be started: {error.strerror}") from None
        if ended.returncode < 0:
            raise RuntimeError(f"it was ended by signal {-ended.returncode}")
        if ended.returncode:
            raise RuntimeError(f"it ended with status {ended.returncode}")
        return columns_of_file(table)

    return detect


def columns_of(found: Any, order: str) -> Columns:
    """Columns of whatever a function returned: a table, rows of numbers, or of cv2.KeyPoint."""
    if found is None:
        raise TypeError("it returned None; return a table with y, x and sigma")
    if isinstance(found, (str, bytes)):
        raise TypeError("it returned text; return a table with y, x and sigma")
    if hasattr(found, "keys"):
        names = {str(name): name for name in found.keys()}  # noqa: SIM118 (a table iterates too)
        missing = [name for name in ("y", "x") if name not in names]
        if missing or not {"sigma", "scale"} & names.keys():
            raise TypeError(f"its table has no column {(missing or ['sigma'])[0]}")
        own = {name: np.asarray(found[names[name]]) for name in KNOWN if name in names}
        return {**own, "scale": own["scale"] if "scale" in own else np.asarray(found["sigma"])}
    rows = list(found)
    if rows and all(hasattr(row, "pt") and hasattr(row, "size") for row in rows):
        return {**of_opencv(rows), "scale": np.array([row.size / 2 for row in rows])}
    array = np.asarray(rows, dtype=np.float64) if rows else np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] < 3:
        raise TypeError(
            f"it returned an array of the shape {array.shape}; return rows of y, x, sigma"
        )
    return {order[0]: array[:, 0], order[1]: array[:, 1], "scale": array[:, 2]}


def columns_of_file(path: Path) -> Columns:
    """Columns of a table that a command wrote: text, names in the first line."""
    if not path.is_file():
        raise FileNotFoundError("it wrote no table")
    if path.stat().st_size >= MOST_WRITTEN:
        raise ValueError(f"it wrote a table of more than {MOST_WRITTEN} bytes")
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        rows = csv.reader(file)
        names = [name.strip() for name in next(rows, [])]
        wanted = [name for name in (*KNOWN, "sigma") if name in names]
        if "y" not in names or "x" not in names or not {"sigma", "scale"} & {*names}:
            raise ValueError("the first line of its table does not name y, x and sigma")
        places = [names.index(name) for name in wanted]
        values = []
        for number, row in enumerate(rows, 1):
            if row:
                try:
                    values.append([float(row[place]) for place in places])
                except (IndexError, ValueError):
                    raise ValueError(f"row {number} of its table holds no numbers") from None
    columns = dict(zip(wanted, np.array(values).reshape(-1, len(wanted)).T, strict=True))
    return {**columns, "scale": columns.get("scale", columns.get("sigma"))}


def of_opencv(keypoints: Any) -> Columns:
    """Columns of a list of cv2.KeyPoint."""
    rows = [(k.pt[1], k.pt[0], k.size, k.response) for k in keypoints]
    y, x, scale, value = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return {"y": y, "x": x, "scale": scale, "value": value}


def png(pixels: Any) -> bytes:
    """Bytes of a grey picture of 8 bits."""
    height, width = pixels.shape
    lines = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines, 6)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


# ---------------------------------------------------------------------------------------------
# The process


class NotThereError(RuntimeError):
    """A detector that cannot be imported or started, whatever the image."""


def detector_of(job: dict[str, Any], folder: Path) -> tuple[Callable[..., Columns], str]:
    """Detector of a job, and its version."""
    kind, name = job["kind"], job["name"]
    if kind == "function":
        return own_function(name, job["order"]), version_of(
            (name.partition(":")[0].partition(".")[0],)
        )
    if kind == "command":
        return own_command(name, folder), ""
    function, distributions = LIBRARIES[name]
    options = job["options"]
    return (lambda image, blur: function(image, blur, **options)), version_of(distributions)


def version_of(distributions: tuple[str, ...]) -> str:
    """Version of the first of some distributions that is installed, else nothing."""
    for name in distributions:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError, ValueError):
            return importlib.metadata.version(name)
    return ""


def confine() -> None:
    """Limit what this process and those that it starts can write and hold, where that is known."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (MOST_WRITTEN, MOST_WRITTEN))
        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def write(path: Path, data: Callable[[Path], object]) -> None:
    """Write a file that appears whole."""
    part = path.with_name(f"part-{path.name}")
    data(part)
    part.replace(path)


def main(folder: Path) -> int:
    """Run the job of a folder."""
    confine()
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    try:
        detect, version = detector_of(job, folder)
    except BaseException as error:
        detect, version = refusing(error), ""
    write(folder / "started.json", partial(note, {"version": version}))
    problems: dict[str, str] = {}  # said of one image, and the same of all others
    for number, blur in enumerate(job["blurs"]):
        image = np.load(folder / f"view_{number:03d}.npy")
        start = time.perf_counter()
        try:
            columns = detect(image, blur)
            seconds = time.perf_counter() - start
            arrays = {name: np.asarray(columns[name]) for name in KNOWN if name in columns}
            numbers = {name: each.astype(np.float64) for name, each in arrays.items()}
            numbers["seconds"] = np.array(seconds)
            write(folder / f"found_{number:03d}.npz", partial(save, numbers))
        except Exception as error:
            problem = in_one_line(error)
            shape = f" (the image is grey, of shape {image.shape})"
            shown = job["kind"] == "function" and not isinstance(error, RuntimeError)
            problem = problems.setdefault(problem, problem + shape * shown)
            said = {"problem": problem, "not_there": isinstance(error, NotThereError)}
            write(folder / f"failed_{number:03d}.json", partial(note, said))
    return 0


def refusing(error: BaseException) -> Callable[..., Columns]:
    """Detector that could not be made: it fails with every image."""

    def detect(image: Any, camera_blur: float) -> Columns:
        raise NotThereError(in_one_line(error))

    return detect


def note(about: dict[str, Any], path: Path) -> None:
    """Write a few words."""
    path.write_text(json.dumps(about), encoding="utf-8")


def save(arrays: dict[str, Any], path: Path) -> None:
    """Write arrays under a name that need not end in .npz."""
    with path.open("wb") as file:
        np.savez(file, **arrays)


def in_one_line(error: BaseException) -> str:
    """An error in a few words, its kind first where it is no message for people."""
    words = " ".join(str(error).split())
    if isinstance(error, ModuleNotFoundError):
        return f"not installed: {words}"
    kind = type(error).__name__
    plain = ("RuntimeError", "FileNotFoundError", "NotThereError")
    return words if kind in plain and words else f"{kind}: {words}"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python worker.py FOLDER")
    sys.exit(main(Path(sys.argv[1]).resolve()))
