"""What the pictures of all containers share: samples, their grey values, and the verdict.

Each case writes one file and says what its grey values are, computed from the samples that were
written, or in which words the file is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from keystab.errors import InputError
from keystab.io.pictures import picture_shape, read_picture

HEIGHT, WIDTH = 23, 37  # odd, and no multiple of 8
LUMA = np.array([0.299, 0.587, 0.114])


class Case(NamedTuple):
    """A file, and what is to be read from it."""

    name: str
    write: Callable[[Path], object]
    grey: np.ndarray | Callable[[Path], np.ndarray] | None = None  # expected, or who decodes it
    words: str = ""  # or of the refusal
    tolerance: float = 0.0


def samples(dtype: str, channels: int = 1, bits: int | None = None, seed: int = 0) -> np.ndarray:
    """Random samples over the whole range, with runs so that compression has something to do."""
    rng = np.random.default_rng([seed, channels, np.dtype(dtype).itemsize])
    shape = (HEIGHT, WIDTH) if channels == 1 else (HEIGHT, WIDTH, channels)
    dtype_ = np.dtype(dtype)
    if dtype_.kind == "b":
        values = rng.random(shape) < 0.5
    elif dtype_.kind == "f":
        values = rng.normal(size=shape).astype(dtype_)
    else:
        info = np.iinfo(dtype_)
        last = 2**bits - 1 if bits else int(info.max)
        values = rng.integers(min(0, info.min), last, shape, dtype_, endpoint=True)
        values[0, 0], values[-1, -1] = 0, last
    values[5:9] = values[5, 3]
    return values


def grey_of(values: np.ndarray, white: float | None = None) -> np.ndarray:
    """Grey values: the first channel, or the luma of three, over white."""
    if white is None:
        white = float(np.iinfo(values.dtype).max) if values.dtype.kind == "u" else 1.0
    real = values.astype(np.float64)
    if values.ndim == 3:
        real = real[..., :3] @ LUMA if values.shape[2] > 2 else real[..., 0]
    return real / white


def smooth_colours() -> np.ndarray:
    """Colours that JPEG keeps to a percent."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([100 + 3 * y, 60 + 2 * x, 200 - 2 * y - x], axis=-1).astype(np.uint8)


def packed(values: np.ndarray, bits: int) -> list[bytes]:
    """Rows of samples of any depth, the first bit of each sample first."""
    rows = []
    for row in values.reshape(len(values), -1):
        text = "".join(f"{int(v):0{bits}b}" for v in row)
        text += "0" * (-len(text) % 8)
        rows.append(int(text, 2).to_bytes(len(text) // 8, "big"))
    return rows


def seen_by_opencv(path: Path) -> np.ndarray:
    """Grey values that another decoder finds."""
    return grey_of(cv2.imread(str(path), cv2.IMREAD_COLOR_RGB))


def verdict(case: Case, folder: Path) -> str:
    """What is wrong with how a case is read or refused; nothing if empty."""
    path = folder / case.name
    case.write(path)
    try:
        grey, shape = read_picture(path), picture_shape(path)
    except InputError as error:
        message = str(error)
        asked = case.grey is None and case.words in message
        return "" if asked and "\n" not in message else f"refused: {message}"
    if case.grey is None:
        return f"read, instead of refused because it {case.words}"
    expected = case.grey(path) if callable(case.grey) else case.grey
    if not grey.shape == shape == expected.shape:
        return f"shape {grey.shape}, at first sight {shape}, instead of {expected.shape}"
    wrong = float(np.abs(grey - expected).max() / max(1.0, np.abs(expected).max()))
    return "" if wrong <= max(case.tolerance, 1e-15) else f"wrong by {wrong:.2g}"
