"""Views of a scene: how one is described, and where its pixels look."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.camera import perspective
from keystab.errors import InputError

__all__ = ["ViewSpec", "effective_blur", "local_step", "to_reference", "to_view"]

#: Lengths in reference pixels from which on float64 tells no half pixels apart.
_FARTHEST = 2.0**52


@dataclass(frozen=True)
class ViewSpec:
    """One view of a scene: where the camera stands, what it blurs, and its noise.

    Parameters
    ----------
    blur : float
        Camera blur c: standard deviation of its Gaussian in view pixels, >= 0.
    step : float
        Subsampling step S: reference pixels per view pixel, > 0. The zoom.
    shape : (int, int)
        Height and width of the view in pixels.
    shift : (float, float)
        Displacement of the camera in view pixels, (down, right), along the axes of the view.
    rotation : float
        Angle in radians by which the camera is turned about its centre, counter-clockwise as seen
        on a screen. The scene then appears turned clockwise.
    noise : float
        Standard deviation of white Gaussian noise, in units of the range [0, 1].
    seed : int, str or tuple of them, optional
        What the noise is for, for `random_generator`. Needed where there is noise.
    homography : 3 x 3 numbers, optional
        How the camera sees a plane from the side, `keystab.camera.perspective`: it takes positions
        from the centre of the view, (down, right) with the shift, to the plane, before rotation
        and step. None looks straight at it.

    Raises
    ------
    InputError
        If a value is out of its range, there is noise without a seed, the view sees the horizon of
        the plane, or the blur or the farthest position is 2**52 reference pixels or more, where
        float64 tells no half pixels apart.

    Examples
    --------
    >>> ViewSpec(blur=1.1, step=10.0, shape=(225, 400)).rotation
    0.0
    """

    blur: float
    step: float
    shape: tuple[int, int]
    shift: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    noise: float = 0.0
    seed: int | str | tuple[int | str, ...] | None = None
    homography: perspective.Homography | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        _check_number("camera blur", self.blur, "a number of view pixels, 0 or more", least=0.0)
        _check_number("noise", self.noise, "a standard deviation, 0 or more", least=0.0)
        _check_number("rotation", self.rotation, "a finite angle in radians")
        _check_number("step", self.step, "a number of reference pixels above 0", least=0.0)
        if self.step == 0:
            raise InputError("step is 0; give a number of reference pixels above 0")
        try:
            down, right = self.shift
        except (TypeError, ValueError):
            raise InputError(
                f"shift is {self.shift!r}; give two numbers of view pixels: down, right"
            ) from None
        for component in (down, right):
            _check_number("shift", component, "finite numbers of view pixels: down, right")
        try:
            height, width = (operator.index(size) for size in self.shape)
        except (TypeError, ValueError):
            height = width = 0
        if height < 1 or width < 1:
            raise InputError(f"shape is {self.shape}; give a height and a width of 1 pixel or more")
        self._check_lengths()
        self._check_seed()
        if self.homography is not None:
            object.__setattr__(self, "homography", perspective.as_homography(self.homography))
            self._check_horizon(self.homography)

    def _check_horizon(self, homography: perspective.Homography) -> None:
        """Refuse a plane that ends within the view; its horizon is a line."""
        # The camera's Gaussian blur reaches a little beyond the outermost pixels.
        reach = 0.5 + perspective.REACH * self.blur
        down, right = (
            np.array([shift - n / 2 - reach, shift + n / 2 + reach])
            for n, shift in zip(self.shape, self.shift, strict=True)
        )
        depth = perspective.homogeneous(homography, down[:, None], right[None, :])[2]
        if not (depth > 1e-6 * np.abs(np.array(homography)).max()).all():
            raise InputError(
                "homography: the view reaches the horizon of the plane; tilt it less, or give a "
                "smaller shape"
            )

    def _check_lengths(self) -> None:
        step = float(self.step)
        if not float(self.blur) * step < _FARTHEST:
            raise InputError(
                f"camera blur is {self.blur:g} and step {self.step:g}, a blur of 2**52 reference "
                "pixels or more; give a smaller blur or step"
            )
        # No shape is too large for the comparison, though one may be for a float.
        sizes = (min(n, 2**53) for n in self.shape)
        reach = max(abs(float(d)) + n for d, n in zip(self.shift, sizes, strict=True))
        if not reach * step < _FARTHEST:
            raise InputError(
                f"shift is {self.shift}, shape {self.shape} and step {self.step:g}: the view "
                "reaches 2**52 reference pixels away or more; give smaller ones"
            )

    def _check_seed(self) -> None:
        if self.seed is not None:
            parts = self.seed if isinstance(self.seed, tuple) else (self.seed,)
            try:
                for part in parts:
                    part if isinstance(part, str) else operator.index(part)
            except TypeError:
                raise InputError(
                    f"seed is {self.seed!r}; give a whole number, text, or a tuple of them"
                ) from None
        elif self.noise > 0:
            raise InputError(
                "noise without a seed would differ from run to run; "
                "give a seed that says what the noise is for"
            )


def to_reference(
    spec: ViewSpec, reference_shape: tuple[int, int], y: ArrayLike, x: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where positions of a view lie in the reference.

    Parameters
    ----------
    spec : ViewSpec
        The view.
    reference_shape : (int, int)
        Height and width of the reference in pixels.
    y, x : array_like
        Positions in view pixels; shapes that broadcast.

    Returns
    -------
    y, x : ndarray of float64
        Positions in reference pixels.

    Examples
    --------
    >>> spec = ViewSpec(blur=1.0, step=10.0, shape=(225, 400))
    >>> y, x = to_reference(spec, (2250, 4000), 0, 399)
    >>> float(y), float(x)
    (4.5, 3994.5)
    """
    cos, sin = _rotation(spec.rotation)
    (mid_y, mid_x), (ref_y, ref_x) = _centre(spec.shape), _centre(reference_shape)
    down = np.asarray(y, dtype=np.float64) - mid_y + spec.shift[0]
    right = np.asarray(x, dtype=np.float64) - mid_x + spec.shift[1]
    if spec.homography is not None:
        down, right = perspective.to_plane(spec.homography, down, right)
    # y points down, so a counter-clockwise turn takes "right" towards smaller y.
    return (
        ref_y + spec.step * (cos * down - sin * right),
        ref_x + spec.step * (sin * down + cos * right),
    )


def to_view(
    spec: ViewSpec, reference_shape: tuple[int, int], y: ArrayLike, x: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where positions of the reference appear in a view: the inverse of `to_reference`.

    Parameters
    ----------
    spec : ViewSpec
        The view.
    reference_shape : (int, int)
        Height and width of the reference in pixels.
    y, x : array_like
        Positions in reference pixels; shapes that broadcast.

    Returns
    -------
    y, x : ndarray of float64
        Positions in view pixels.

    Examples
    --------
    >>> spec = ViewSpec(blur=1.0, step=10.0, shape=(225, 400), shift=(0.0, 2.0))
    >>> y, x = to_view(spec, (2250, 4000), 4.5, 4.5)
    >>> float(y), float(x)
    (0.0, -2.0)
    """
    cos, sin = _rotation(spec.rotation)
    (mid_y, mid_x), (ref_y, ref_x) = _centre(spec.shape), _centre(reference_shape)
    dy = (np.asarray(y, dtype=np.float64) - ref_y) / spec.step
    dx = (np.asarray(x, dtype=np.float64) - ref_x) / spec.step
    if spec.homography is None:
        return (
            mid_y - spec.shift[0] + cos * dy + sin * dx,
            mid_x - spec.shift[1] - sin * dy + cos * dx,
        )
    back = perspective.inverse(spec.homography)
    down, right = perspective.to_plane(back, cos * dy + sin * dx, cos * dx - sin * dy)
    return mid_y - spec.shift[0] + down, mid_x - spec.shift[1] + right


def within_line(
    spec: ViewSpec,
    reference_shape: tuple[int, int],
    axis: int,
    sign: float,
    limit: float,
    y: ArrayLike,
    x: ArrayLike,
) -> NDArray[np.float64]:
    """How far places of the reference lie within a row or a column of a view, as a linear function.

    Parameters
    ----------
    spec, reference_shape, y, x
        See `to_view`.
    axis : {0, 1}
        Rows or columns.
    sign, limit : float
        Wanted is ``sign * position >= limit`` along the axis.

    Returns
    -------
    ndarray of float64
        ``sign * position - limit`` in view pixels, times the depth where a plane is seen from the
        side: linear in the place, and negative behind the camera for one of two opposite lines.

    Examples
    --------
    >>> spec = ViewSpec(blur=1.0, step=10.0, shape=(225, 400))
    >>> within_line(spec, (2250, 4000), 1, -1.0, -390.0, 4.5, [4.5, 3994.5]).tolist()
    [390.0, -9.0]
    """
    if spec.homography is None:
        return sign * to_view(spec, reference_shape, y, x)[axis] - limit
    straight = replace(spec, homography=None, shift=(0.0, 0.0))
    middle = _centre(spec.shape)
    y, x = to_view(straight, reference_shape, y, x)
    back = perspective.inverse(spec.homography)
    *position, depth = perspective.homogeneous(back, y - middle[0], x - middle[1])
    centre = middle[axis] - spec.shift[axis]
    return sign * position[axis] + (sign * centre - limit) * depth


def local_step(spec: ViewSpec, y: ArrayLike, x: ArrayLike) -> NDArray[np.float64]:
    """Reference pixels per pixel of a view, at positions of the view; S where it looks straight.

    Parameters
    ----------
    spec : ViewSpec
        The view.
    y, x : array_like
        Positions in view pixels; shapes that broadcast.

    Returns
    -------
    ndarray of float64
        Of a plane that is seen from the side, the root of the area of the reference that a pixel
        sees.

    Examples
    --------
    >>> local_step(ViewSpec(blur=1.1, step=10.0, shape=(20, 20)), 3.0, [4.0, 5.0]).tolist()
    [10.0, 10.0]
    """
    (mid_y, mid_x), steps = _centre(spec.shape), np.full(np.broadcast(y, x).shape, spec.step)
    if spec.homography is None:
        return steps
    down = np.asarray(y, dtype=np.float64) - mid_y + spec.shift[0]
    right = np.asarray(x, dtype=np.float64) - mid_x + spec.shift[1]
    return steps * perspective.zoom(spec.homography, down, right)


def effective_blur(blur: float, step: float, reference_blur: float) -> float:
    """Blur of a view whose reference is itself blurred, sqrt(c^2 + (c_ref/S)^2) (section 4).

    Parameters
    ----------
    blur : float
        Camera blur c in view pixels.
    step : float
        Subsampling step S.
    reference_blur : float
        Blur c_ref of the reference in reference pixels.

    Returns
    -------
    float
        Blur in view pixels.

    Examples
    --------
    >>> effective_blur(0.4, 10.0, 3.0)
    0.5
    """
    return math.hypot(blur, reference_blur / step)


def _rotation(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at multiples of a right angle."""
    quarter_turns = angle / (math.pi / 2)
    if quarter_turns == round(quarter_turns):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter_turns) % 4]
    return math.cos(angle), math.sin(angle)


def _centre(shape: tuple[int, int]) -> tuple[float, float]:
    return (shape[0] - 1) / 2, (shape[1] - 1) / 2


def _check_number(name: str, value: float, allowed: str, least: float = -math.inf) -> None:
    try:
        good = math.isfinite(value) and value >= least
    except (TypeError, ValueError, OverflowError):  # text, arrays, integers beyond any float
        good = False
    if not good:
        raise InputError(f"{name} is {value!r}; give {allowed}")
