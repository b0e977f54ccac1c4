"""The Gaussian nearest to a measured point spread function: the camera blur c of one's own camera.

The paper obtains c by "fitting a Gaussian function to the estimated camera point-spread-function"
(section 4). Here a picture of such a function is fitted in least squares over its samples, twice:
by an isotropic Gaussian, whose standard deviation is c, and by one with two principal axes, which
says how far the camera is from being isotropic. `keystab.camera.optics` does the same for models of
cameras.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.utils import validation
from keystab.utils.masks import unmasked

__all__ = ["PsfFit", "border_level", "fit_psf"]

_NARROWEST = 0.3
"""Standard deviation in samples below which samples of a Gaussian say nothing of its width: the
sample beside the centre is then below 0.4 % of the maximum."""

_BUMP = 0.5
"""Share of the maximum above which samples are taken for the bump when the fit begins."""

_MOST_SAMPLES = 10**6
"""Samples of a picture whose fit ends within a minute."""

_MOST_BUMPS = 10
"""Separate bright areas in a picture of a point spread function; a photograph has hundreds."""


@dataclass(frozen=True)
class PsfFit:
    """A Gaussian fitted to a point spread function.

    Attributes
    ----------
    blur : float
        Standard deviation c of the isotropic Gaussian, in pixels of the camera.
    y, x : float
        Its centre, in samples of the picture.
    height : float
        Its maximum, in units of the picture.
    residual : float
        Root mean square of the difference to the picture over that of the picture.
    major, minor : float
        Standard deviations along the principal axes of the general Gaussian, in pixels.
    angle : float
        Direction of the longer axis, in radians from the rows' direction x towards y, from
        -pi / 2 to pi / 2.
    general_residual : float
        As `residual`, for the general Gaussian.
    background : float
        Level that was subtracted, in units of the picture.
    """

    blur: float
    y: float
    x: float
    height: float
    residual: float
    major: float
    minor: float
    angle: float
    general_residual: float
    background: float


def fit_psf(
    psf: ArrayLike, oversampling: float = 1.0, background: float | Literal["border"] = 0.0
) -> PsfFit:
    """Fit a Gaussian to a picture of a point spread function, in least squares.

    Height, centre and width are free. What is fitted is what the sensor samples, the spread of the
    lens and of the pixel together: a function estimated for the lens alone lacks the pixel.

    Parameters
    ----------
    psf : array_like, shape (height, width)
        The point spread function, its largest values in the bump. No gamma: proportional to light.
    oversampling : float, default 1
        Samples of the picture per pixel of the camera, > 0.
    background : float or "border", default 0
        Level that is subtracted first, in units of the picture; or that of the picture's border,
        see `border_level`.

    Returns
    -------
    PsfFit

    Raises
    ------
    InputError
        If the picture is constant, holds NaN or infinities, has less than 3 x 3 samples, has no
        bump above the background, or one that is narrower than its samples or wider than itself.

    Notes
    -----
    Noise that is the same everywhere and a wrong background count as parts of the function. Crop
    the picture to some standard deviations around the bump.

    Examples
    --------
    >>> y, x = np.mgrid[:33, :33]
    >>> psf = np.exp(-0.5 * ((y - 16.3) ** 2 + (x - 15.8) ** 2) / 2.8**2)
    >>> fit = fit_psf(psf, oversampling=4)
    >>> round(fit.blur, 4), round(fit.y, 4), round(fit.x, 4)
    (0.7, 16.3, 15.8)
    """
    validation.number("oversampling", oversampling, above=0)
    level = border_level(psf) if background == "border" else background
    light = _picture(psf) - validation.number("background", level)
    if light.size > _MOST_SAMPLES:
        raise InputError(
            f"the picture has {light.shape[0]} x {light.shape[1]} samples, allowed are "
            f"{_MOST_SAMPLES:.0e} in all: crop it to the point spread function; of a photograph, "
            "keystab.edge_blur or --camera-blur auto tells the blur from edges"
        )
    y, x, width = _start(light)
    _require_bump(light)
    scale = float(light.max())
    light = light / scale
    isotropic, residual = _least_squares(light, np.array([1.0, y, x, math.log(width)]))
    height, y, x, log_width = isotropic
    _check_width(math.exp(log_width), light.shape)
    if height <= 0 or not (0 <= y <= light.shape[0] - 1 and 0 <= x <= light.shape[1] - 1):
        raise InputError(
            "the picture has no bump that a Gaussian fits; crop it to the point spread function"
        )
    # exp of a symmetric matrix is positive definite: the logarithm of the widths may be anything.
    general, general_residual = _least_squares(light, np.array([height, y, x, log_width, 0.0, 0.0]))
    _, _, _, log_mean, stretch_x, stretch_xy = general
    stretch = math.hypot(stretch_x, stretch_xy)
    angle = 0.5 * math.atan2(stretch_xy, stretch_x)
    return PsfFit(
        blur=math.exp(log_width) / oversampling,
        y=float(y),
        x=float(x),
        height=float(height * scale),
        residual=residual,
        major=math.exp(log_mean + stretch) / oversampling,
        minor=math.exp(log_mean - stretch) / oversampling,
        angle=angle if angle > 1e-9 - math.pi / 2 else angle + math.pi,  # one name for one axis
        general_residual=general_residual,
        background=float(level),
    )


def border_level(psf: ArrayLike) -> float:
    """Return the median of the outermost samples of a picture, a guess at its background.

    Parameters
    ----------
    psf : array_like, shape (height, width)
        The picture.

    Returns
    -------
    float
        In units of the picture.

    Raises
    ------
    InputError
        If it is no picture of finite values with at least 3 x 3 samples.

    Examples
    --------
    >>> border_level([[1.0, 1.0, 1.0], [1.0, 9.0, 2.0], [1.0, 1.0, 1.0]])
    1.0
    """
    light = _picture(psf)
    inner = np.zeros(light.shape, dtype=bool)
    inner[1:-1, 1:-1] = True
    return float(np.median(light[~inner]))


def _picture(psf: ArrayLike) -> NDArray[np.float64]:
    light = np.asarray(unmasked("the picture", psf), dtype=np.float64)
    if light.ndim != 2 or min(light.shape) < 3:
        raise InputError(
            f"the picture has the shape {light.shape}; give one of at least 3 x 3 samples"
        )
    if not np.isfinite(light).all():
        raise InputError("the picture holds NaN or infinite values; replace them by finite ones")
    return light


def _start(light: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return centre and width at which the fit begins: those of the samples near the maximum."""
    if np.ptp(light) == 0:
        raise InputError("the picture is constant; give one of a point spread function")
    top = light.max()
    if top <= 0:
        raise InputError("nothing in the picture lies above the background; give a lower one")
    rows, columns = np.nonzero(light >= _BUMP * top)
    # Of several bumps, the one around the maximum.
    peak_y, peak_x = np.unravel_index(int(np.argmax(light)), light.shape)
    # A Gaussian exceeds half its maximum on a disc of area 2 pi ln 2 times its variance.
    width = math.sqrt(len(rows) / (2 * math.pi * math.log(2)))
    near = np.hypot(rows - peak_y, columns - peak_x) <= 3 * width + 1
    weights = light[rows[near], columns[near]]
    y, x = (float((weights * place[near]).sum() / weights.sum()) for place in (rows, columns))
    return y, x, max(width, 0.5)


def _require_bump(light: NDArray[np.float64]) -> None:
    """Refuse what is no point spread function, such as a photograph: its bright samples scatter."""
    from scipy.ndimage import label

    n_bumps = label(light >= _BUMP * light.max())[1]
    if n_bumps > _MOST_BUMPS:
        raise InputError(
            f"the picture is no point spread function: {n_bumps} separate areas lie above half of "
            f"its maximum, allowed are {_MOST_BUMPS}; crop it to one bump; of a photograph, "
            "--camera-blur auto of keystab detect tells the blur from edges"
        )


def _least_squares(
    light: NDArray[np.float64], start: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Fit a Gaussian; return its parameters and the relative norm of what is left.

    The parameters are height, y, x, logarithm of the (mean) width, and of the general Gaussian
    also the two of the traceless part of the logarithm of its matrix of widths.
    """
    from scipy.optimize import least_squares

    rows, columns = (np.arange(n, dtype=np.float64) for n in light.shape)

    def misfit(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        height, y, x, log_width, *stretches = parameters
        dy, dx = np.meshgrid(rows - y, columns - x, indexing="ij")
        square = dy**2 + dx**2
        if stretches:
            # The inverse of the matrix of variances, exp(-2 L) for L = log_width + stretch.
            stretch = math.hypot(*stretches)
            slope = math.sinh(2 * stretch) / stretch if stretch else 2.0
            along = stretches[0] * (dx**2 - dy**2) + 2 * stretches[1] * dx * dy
            square = math.cosh(2 * stretch) * square - slope * along
        exponent = -0.5 * square * math.exp(-2 * float(np.clip(log_width, -20, 20)))
        return np.asarray(height * np.exp(exponent) - light).ravel()

    fit = least_squares(misfit, start, x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return fit.x, float(np.linalg.norm(fit.fun) / np.linalg.norm(light))


def _check_width(width: float, shape: tuple[int, ...]) -> None:
    if width < _NARROWEST:
        raise InputError(
            f"the bump has a standard deviation of {width:.2g} samples, below {_NARROWEST:g} "
            "nothing can be said; give a point spread function that is sampled more finely"
        )
    if width > min(shape) / 3:
        raise InputError(
            "the picture holds less than 1.5 standard deviations of its bump to each side; give "
            "more of the point spread function, or subtract its background"
        )
