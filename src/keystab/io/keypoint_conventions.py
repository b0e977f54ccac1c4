"""What other programs mean by the position and the scale of a keypoint, and tables made of theirs.

Here (0, 0) is the centre of the top left pixel, y comes first and goes down, and the scale is
sigma, the blur of the slice of the scale-space in which a keypoint lies. Other programs count from
the corner of that pixel or from 1, put x first, or give a diameter. A `Convention` says which.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError

__all__ = [
    "COLMAP",
    "KEYSTAB",
    "OPENCV",
    "SCALES",
    "Convention",
    "from_lafs",
    "from_opencv",
    "to_lafs",
    "to_opencv",
]

SCALES = {"sigma": 1.0, "radius": math.sqrt(2.0), "diameter": 2.0}
"""Meanings of a scale that have names, over sigma. The radius is that of a blob of which sigma is
the standard deviation, where its Laplacian is 0; the diameter is that of ``cv2.KeyPoint.size``."""


def _is_number(value: Any) -> bool:
    try:
        return math.isfinite(float(value)) and not isinstance(value, str)
    except (TypeError, ValueError, OverflowError):
        return False


@dataclass(frozen=True)
class Convention:
    """What a program means by a keypoint's position and scale.

    Parameters
    ----------
    origin : float
        Coordinate of the centre of the top left pixel, in y and x: 0 here and in OpenCV, 0.5 where
        the corner of the picture is 0 (COLMAP), 1 where counting starts at 1 (MATLAB).
    order : {"yx", "xy"}
        Which coordinate comes first.
    scale : {"sigma", "radius", "diameter"} or float
        What the scale is, see `SCALES`; or how many times sigma it is.

    Raises
    ------
    InputError
        If a value is none of these.

    Examples
    --------
    >>> corner = Convention(origin=0.5, order="xy", scale="diameter")
    >>> corner.table([10.5], [4.5], [3.0])
         y     x  sigma
    0  4.0  10.0    1.5
    >>> print(corner)
    0.5 xy diameter
    """

    origin: float = 0.0
    order: str = "yx"
    scale: str | float = "sigma"

    def __post_init__(self) -> None:
        """Check every value."""
        if not _is_number(self.origin):
            raise InputError(f"origin is {self.origin!r}; give a number of pixels, such as 0.5")
        if self.order not in ("yx", "xy"):
            raise InputError(f"order is {self.order!r}; give yx or xy")
        if self.scale not in SCALES and not (_is_number(self.scale) and float(self.scale) > 0):
            raise InputError(
                f"scale is {self.scale!r}; give {', '.join(SCALES)} or how many times sigma it is"
            )

    def __str__(self) -> str:
        """The three in a row, as in a table."""
        scale = self.scale if isinstance(self.scale, str) else f"{self.scale:g} sigma"
        return f"{self.origin:g} {self.order} {scale}"

    @property
    def factor(self) -> float:
        """How many times sigma a scale is."""
        return SCALES[self.scale] if isinstance(self.scale, str) else float(self.scale)

    def table(self, first: ArrayLike, second: ArrayLike, scale: ArrayLike) -> pd.DataFrame:
        """Keypoints of this convention as a table of ours.

        Parameters
        ----------
        first, second : array_like, shape (n,)
            Coordinates in the order of the convention, pixels.
        scale : array_like, shape (n,)
            Scales as the convention has them.

        Returns
        -------
        DataFrame
            ``y, x, sigma`` in pixels.

        Raises
        ------
        InputError
            If there is not one finite number for each keypoint, or a scale is not above 0.
        """
        columns = {
            name: _numbers(name, values)
            for name, values in zip((*self.order, "sigma"), (first, second, scale), strict=True)
        }
        if len({len(values) for values in columns.values()}) > 1:
            sizes = ", ".join(f"{len(values)} {name}" for name, values in columns.items())
            raise InputError(f"the keypoints have {sizes}; give as many of each")
        if (columns["sigma"] <= 0).any():
            raise InputError(f"a scale is {columns['sigma'].min():g}; give scales above 0")
        return pd.DataFrame(
            {
                "y": columns["y"] - self.origin,
                "x": columns["x"] - self.origin,
                "sigma": columns["sigma"] / self.factor,
            }
        )

    def columns(
        self, keypoints: pd.DataFrame
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates in the order of the convention, and scales: the inverse of `table`.

        Examples
        --------
        >>> found = pd.DataFrame({"y": [4.0], "x": [10.0], "sigma": [1.5]})
        >>> [float(values[0]) for values in Convention(0.5, "xy", "diameter").columns(found)]
        [10.5, 4.5, 3.0]
        """
        checked = {name: _column(keypoints, name) for name in ("y", "x", "sigma")}
        first, second = (checked[name] + self.origin for name in self.order)
        return first, second, checked["sigma"] * self.factor


KEYSTAB = Convention()
OPENCV = Convention(0.0, "xy", "diameter")
COLMAP = Convention(0.5, "xy", "sigma")
"""Conventions of programs: pixel centres at whole numbers, the first at 0; OpenCV, whose size is
twice sigma; COLMAP, whose origin is the corner of the picture."""


def from_opencv(keypoints: Iterable[Any]) -> pd.DataFrame:
    """Keypoints of OpenCV as a table.

    Parameters
    ----------
    keypoints : iterable of cv2.KeyPoint
        Only ``pt``, ``size``, ``angle`` and ``response`` are looked at.

    Returns
    -------
    DataFrame
        ``y, x, sigma`` in pixels (``size`` is twice sigma), ``value`` (OpenCV's response) and
        ``angle`` in radians from x towards y; NaN where OpenCV has none (-1). A keypoint with
        several orientations comes as several rows, as OpenCV has it.

    Raises
    ------
    InputError
        If something else is in the list, or a number is not finite.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> one = SimpleNamespace(pt=(10.0, 4.0), size=3.0, angle=90.0, response=0.1)
    >>> from_opencv([one]).round(3)
         y     x  sigma  value  angle
    0  4.0  10.0    1.5    0.1  1.571
    """
    try:
        rows = [(*k.pt, k.size, k.angle, k.response) for k in keypoints]
        x, y, size, angle, response = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    except (AttributeError, TypeError, ValueError):
        raise InputError("these are no keypoints of OpenCV; give a list of cv2.KeyPoint") from None
    return OPENCV.table(x, y, size).assign(
        value=response, angle=np.where(angle < 0, np.nan, np.radians(angle))
    )


def to_opencv(keypoints: pd.DataFrame) -> list[Any]:
    """Table of keypoints as a list of ``cv2.KeyPoint``.

    Parameters
    ----------
    keypoints : DataFrame
        ``y, x, sigma`` in pixels; ``value`` and ``angle`` (radians) where there are any.

    Returns
    -------
    list of cv2.KeyPoint
        In single precision, as OpenCV has them: a position of 1000 is rounded by 3e-5 pixels.

    Raises
    ------
    InputError
        If a column is missing or holds anything but finite numbers, or OpenCV is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise InputError("OpenCV is not installed: pip install opencv-python-headless") from None
    x, y, size = OPENCV.columns(keypoints)
    response = keypoints.get("value", pd.Series(0.0, keypoints.index)).to_numpy(dtype=float)
    angle = np.degrees(keypoints.get("angle", pd.Series(np.nan, keypoints.index)).to_numpy(float))
    angle = np.where(np.isnan(angle), -1.0, angle % 360.0)
    return [
        cv2.KeyPoint(*(float(value) for value in row))
        for row in zip(x, y, size, angle, response, strict=True)
    ]


def from_lafs(lafs: Any, mr_size: float = 6.0) -> pd.DataFrame:
    """Local affine frames, as kornia has them, as a table of keypoints.

    Parameters
    ----------
    lafs : array_like or torch.Tensor, shape (1, n, 2, 3) or (n, 2, 3)
        The last column is the centre (x, y), the others span the frame.
    mr_size : float
        Size of the frame over sigma; detectors of kornia have 6 unless told otherwise.

    Returns
    -------
    DataFrame
        ``y, x, sigma`` in pixels, sigma from the area of the frame, and ``angle`` in radians, that
        of the frame's first axis from x towards y. A skew is lost.

    Raises
    ------
    InputError
        If the shape is another one, a number is not finite, or a frame has no area.

    Examples
    --------
    >>> from_lafs([[[[9.0, 0.0, 10.0], [0.0, 9.0, 4.0]]]])
         y     x  sigma  angle
    0  4.0  10.0    1.5    0.0
    """
    values = lafs.detach().cpu().numpy() if hasattr(lafs, "detach") else lafs
    try:
        frames = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        frames = np.zeros(0)
    if frames.ndim == 4 and len(frames) == 1:
        frames = frames[0]
    if frames.shape[1:] != (2, 3):
        raise InputError(
            f"the frames have the shape {np.shape(values)}; give (1, n, 2, 3) of one picture"
        )
    area = np.linalg.det(frames[:, :, :2]) if len(frames) else np.zeros(0)
    table = Convention(order="xy", scale=mr_size).table(
        frames[:, 0, 2], frames[:, 1, 2], np.sqrt(np.abs(area))
    )
    return table.assign(angle=np.arctan2(frames[:, 1, 0], frames[:, 0, 0]))


def to_lafs(keypoints: pd.DataFrame, mr_size: float = 6.0) -> NDArray[np.float32]:
    """Table of keypoints as local affine frames; ``torch.from_numpy`` makes kornia's of them.

    Parameters
    ----------
    keypoints : DataFrame
        ``y, x, sigma`` in pixels; ``angle`` (radians) where there is any, else frames are upright.
    mr_size : float
        Size of the frame over sigma.

    Returns
    -------
    ndarray of float32, shape (1, n, 2, 3)

    Raises
    ------
    InputError
        If a column is missing or holds anything but finite numbers.

    Examples
    --------
    >>> to_lafs(pd.DataFrame({"y": [4.0], "x": [10.0], "sigma": [1.5]})).tolist()
    [[[[9.0, 0.0, 10.0], [0.0, 9.0, 4.0]]]]
    """
    x, y, size = Convention(order="xy", scale=mr_size).columns(keypoints)
    angle = angles(keypoints)
    along, across = size * np.cos(angle), size * np.sin(angle)
    rows = [np.stack([along, -across, x], axis=-1), np.stack([across, along, y], axis=-1)]
    return np.stack(rows, axis=1)[None].astype(np.float32) + np.float32(0.0)  # no -0


def angles(keypoints: pd.DataFrame) -> NDArray[np.float64]:
    """Angles of keypoints in radians, 0 where there are none."""
    if "angle" not in keypoints:
        return np.zeros(len(keypoints))
    known: NDArray[np.float64] = np.nan_to_num(keypoints["angle"].to_numpy(dtype=float))
    return known


def _column(keypoints: pd.DataFrame, name: str) -> NDArray[np.float64]:
    if name not in keypoints:
        raise InputError(f"the keypoints have no column {name!r}; needed are y, x and sigma")
    return _numbers(name, keypoints[name])


def _numbers(name: str, values: ArrayLike | Sequence[Any] | pd.Series) -> NDArray[np.float64]:
    """One-dimensional array of finite numbers."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} holds something else than numbers; give numbers") from None
    if numbers.ndim != 1:
        raise InputError(f"{name} has the shape {numbers.shape}; give one number per keypoint")
    finite = np.isfinite(numbers)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InputError(f"{name} is {numbers[row]} in row {row}; give finite numbers")
    return numbers
