r"""The blur of a real camera: lens, pixel, and the Gaussian that stands for both (section 4).

The paper models the point spread function of a camera by a Gaussian of standard deviation c, and
reports c = 0.35 to 0.95 pixels for a reflex camera, from fits to measured point spread functions,
"blur level increases with aperture size". This module computes c for a model of a camera in
incoherent light of one wavelength :math:`\lambda`:

lens
    a circular pupil at f-number N, whose wavefront is off by
    :math:`W(\rho) = W_{20} \rho^2 + W_{40} \rho^4` wavelengths at the share :math:`\rho` of its
    radius. Diffraction alone (W = 0) blurs in proportion to :math:`\lambda N`.
defocus
    a sensor at the distance z from the focus: :math:`W_{20} = z / (8 N^2 \lambda)`. In
    geometrical optics a disc of diameter z / N.
spherical aberration
    :math:`W_{40} = (2 / N)^4 W_s` for a lens of fixed focal length that has :math:`W_s` wavelengths
    at f/2, refocused for every aperture to the least wavefront variance, :math:`W_{20} = -W_{40}`.
pixel
    a square that collects light, of side :math:`p \sqrt{\text{fill factor}}` for the pitch p.

The transfer function is the product of both; what the sensor samples is the lens's point spread
function convolved with the pixel's. c is that of the isotropic Gaussian, of free height and centred
on the axis, that is nearest to it in the image plane in least squares. By Parseval's theorem, with
H the transfer function, the best height leaves

.. math:: |h|^2 - 4 \pi c^2 \left( \int H(f) e^{-2 \pi^2 c^2 |f|^2} df \right)^2,

and c is where the second term is greatest, a root of its derivative. Only the mean of H over
directions enters, which makes the integral one-dimensional. Lengths are in micrometres of the image
plane and frequencies in cycles per micrometre, unless they are said to be in pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.utils import validation
from keystab.utils.roots import root_between

Array = NDArray[np.float64]

MODELS = ("diffraction", "defocus", "spherical")
"""Lenses: perfect; out of focus; with spherical aberration. All are also limited by diffraction."""

SPHERICAL_F_NUMBER = 2.0
"""F-number at which the strength of the spherical aberration is given."""

_MOST_WAVES = 50.0
"""Largest wavefront error in wavelengths. Of such a lens no Gaussian would say anything."""

_MOST_NODES = 2**20
"""Nodes of the overlap of two pupils that are held at a time."""

_MOST_PERIODS = 1000.0
"""Largest pitch times cut-off frequency of the lens: 1000 um pixels at f/1.8."""


@dataclass(frozen=True)
class Camera:
    """A lens and the pixels behind it.

    Parameters
    ----------
    wavelength : float
        In micrometres, > 0.
    f_number : float
        Focal length over the diameter of the aperture, > 0.
    pitch : float
        Distance of adjacent pixels in micrometres, > 0.
    fill_factor : float, default 1
        Share of a pixel's area that collects light, in (0, 1].
    w20, w40 : float, default 0
        Wavefront error of defocus and of spherical aberration at the edge of the pupil, in
        wavelengths.

    Raises
    ------
    InputError
        If a parameter is out of range.
    """

    wavelength: float
    f_number: float
    pitch: float
    fill_factor: float = 1.0
    w20: float = 0.0
    w40: float = 0.0

    def __post_init__(self) -> None:
        for name in ("wavelength", "f_number", "pitch", "fill_factor"):
            validation.number(name, getattr(self, name), above=0)
        if self.fill_factor > 1:
            raise InputError(f"fill_factor is {self.fill_factor}, allowed is a number up to 1")
        for name in ("w20", "w40"):
            if abs(validation.number(name, getattr(self, name))) > _MOST_WAVES:
                raise InputError(
                    f"{name} is {getattr(self, name):.4g} wavelengths at f/{self.f_number:g}, "
                    f"allowed are {_MOST_WAVES:g}: give less aberration or a larger f-number"
                )
        if self.pitch * self.cutoff > _MOST_PERIODS:
            raise InputError(
                f"pitch is {self.pitch:g} um, allowed are {_MOST_PERIODS / self.cutoff:.4g} at "
                f"f/{self.f_number:g}: give a smaller pitch or a larger f-number"
            )

    @property
    def cutoff(self) -> float:
        """Frequency above which the lens passes nothing, in cycles per micrometre."""
        return 1.0 / (self.wavelength * self.f_number)

    @property
    def side(self) -> float:
        """Side of the square that collects light, in micrometres."""
        return self.pitch * math.sqrt(self.fill_factor)


@dataclass(frozen=True)
class GaussianFit:
    """The Gaussian that is nearest to a point spread function.

    Attributes
    ----------
    blur : float
        Standard deviation c in pixels.
    height : float
        Its maximum, per square micrometre, for a point spread function of integral 1.
    residual : float
        Norm of the difference over the norm of the point spread function: 0 for a Gaussian.
    """

    blur: float
    height: float
    residual: float


def defocus_waves(distance: float, wavelength: float, f_number: float) -> float:
    """Return the wavefront error of a sensor that is off the focus.

    Parameters
    ----------
    distance : float
        Distance z of the sensor from the focus in micrometres.
    wavelength, f_number : float
        See `Camera`.

    Returns
    -------
    float
        ``z / (8 N**2 wavelength)`` wavelengths at the edge of the pupil.

    Examples
    --------
    >>> defocus_waves(8.8, wavelength=0.55, f_number=2.0)
    0.5
    """
    return distance / (8.0 * f_number**2 * wavelength)


def spherical_waves(strength: float, f_number: float) -> float:
    """Return the spherical aberration of a lens that is stopped down.

    Parameters
    ----------
    strength : float
        Wavefront error at the edge of the pupil at f/2, in wavelengths.
    f_number : float
        See `Camera`.

    Returns
    -------
    float
        ``(2 / N)**4 * strength`` wavelengths at the edge of the pupil.

    Examples
    --------
    >>> spherical_waves(1.0, f_number=4.0)
    0.0625
    """
    return strength * (SPHERICAL_F_NUMBER / f_number) ** 4


def camera(
    model: str,
    wavelength: float,
    f_number: float,
    pitch: float,
    fill_factor: float = 1.0,
    defocus: float = 0.0,
    spherical: float = 0.0,
) -> Camera:
    """Return a camera of one of the three models.

    Parameters
    ----------
    model : {"diffraction", "defocus", "spherical"}
        Which of the two last parameters counts: none, the first, the second.
    wavelength, f_number, pitch, fill_factor : float
        See `Camera`.
    defocus : float, default 0
        Distance of the sensor from the focus in micrometres.
    spherical : float, default 0
        Spherical aberration at f/2 in wavelengths.

    Raises
    ------
    InputError
        If `model` is none of the three or a parameter is out of range.

    Examples
    --------
    >>> camera("spherical", 0.55, 4.0, 5.0, spherical=1.6).w40
    0.1
    """
    if model not in MODELS:
        raise InputError(f"model: {model!r} is not known; choose one of {', '.join(MODELS)}")
    plain = Camera(wavelength, f_number, pitch, fill_factor)  # refuses what cannot be computed with
    if model == "defocus":
        w20 = defocus_waves(defocus, wavelength, f_number)
        return Camera(wavelength, f_number, pitch, fill_factor, w20)
    if model == "spherical":
        w40 = spherical_waves(spherical, f_number)
        return Camera(wavelength, f_number, pitch, fill_factor, -w40, w40)
    return plain


def diffraction_mtf(frequency: ArrayLike) -> Array:
    """Return the modulation transfer function of a perfect lens with a circular aperture.

    Parameters
    ----------
    frequency : array_like
        In units of the cut-off frequency ``1 / (wavelength * N)``, >= 0.

    Returns
    -------
    ndarray
        ``2 / pi * (acos(f) - f * sqrt(1 - f**2))``; 0 beyond the cut-off.

    Examples
    --------
    >>> diffraction_mtf([0.0, 0.5, 1.0, 2.0]).round(3).tolist()
    [1.0, 0.391, 0.0, 0.0]
    """
    f = np.minimum(np.asarray(frequency, dtype=np.float64), 1.0)
    return np.asarray(2 / np.pi * (np.arccos(f) - f * np.sqrt(1 - f**2)))


def lens_transfer(frequency: ArrayLike, w20: float = 0.0, w40: float = 0.0) -> Array:
    """Return the transfer function of a lens with defocus and spherical aberration.

    The autocorrelation of the pupil, by Gauss-Legendre quadrature over the overlap of two discs;
    negative where the aberration reverses contrast.

    Parameters
    ----------
    frequency : array_like
        In units of the cut-off frequency ``1 / (wavelength * N)``, >= 0.
    w20, w40 : float, default 0
        Defocus and spherical aberration at the edge of the pupil, in wavelengths.

    Returns
    -------
    ndarray
        1 at frequency 0, 0 beyond the cut-off.

    Examples
    --------
    >>> lens_transfer([0.0, 0.5, 1.0]).round(3).tolist()  # a perfect lens: diffraction_mtf
    [1.0, 0.391, 0.0]
    >>> lens_transfer([0.5], w20=1.0).round(3).tolist()
    [-0.02]
    """
    f = np.minimum(np.asarray(frequency, dtype=np.float64), 1.0)
    # Nodes for the phase, which without spherical aberration does not depend on y.
    across = _unit_nodes(40 + math.ceil(6 * (abs(w20) + abs(w40))))
    along = _unit_nodes(16 + math.ceil(3 * abs(w40)) if w40 else 1)
    at_once = max(1, _MOST_NODES // (len(across[0]) * len(along[0])))
    flat = f.ravel()
    parts = [
        _overlap_of_pupils(flat[start : start + at_once], w20, w40, across, along)
        for start in range(0, flat.size, at_once)
    ]
    return np.concatenate([np.empty(0), *parts]).reshape(f.shape)


def _overlap_of_pupils(
    frequency: Array,
    w20: float,
    w40: float,
    across: tuple[Array, Array],
    along: tuple[Array, Array],
) -> Array:
    """Integrate over one quarter of the overlap of discs centred on -f and f along x."""
    (u, weight_u), (v, weight_v) = across, along
    f = frequency[:, None, None]
    # The height of the overlap ends as a square root, which x = (1 - f) (1 - u^2) makes smooth.
    x = (1 - f) * (1 - u[:, None] ** 2)
    height = np.sqrt(np.maximum(1 - (x + f) ** 2, 0.0))
    area = 2 * (1 - f) * u[:, None] * height * weight_u[:, None] * weight_v
    # W at (x + f, y) less W at (x - f, y), in wavelengths.
    waves = 4 * f * x * w20 + 8 * f * x * (x**2 + (height * v) ** 2 + f**2) * w40
    return np.asarray(4 / np.pi * (np.cos(2 * np.pi * waves) * area).sum(axis=(-2, -1)))


def pixel_transfer(frequency_y: ArrayLike, frequency_x: ArrayLike, side: float) -> Array:
    """Return the transfer function of a square pixel.

    Parameters
    ----------
    frequency_y, frequency_x : array_like
        In cycles per micrometre.
    side : float
        Side of the square in micrometres, > 0.

    Returns
    -------
    ndarray
        The product of ``sin(pi f side) / (pi f side)`` along both axes.

    Examples
    --------
    >>> pixel_transfer([0.0, 0.1, 0.2], 0.0, side=5.0).round(3).tolist()
    [1.0, 0.637, 0.0]
    """
    fy, fx = (np.asarray(f, dtype=np.float64) for f in (frequency_y, frequency_x))
    return np.sinc(side * fy) * np.sinc(side * fx)


def fit_camera(what: Camera) -> GaussianFit:
    """Fit a Gaussian to the point spread function of a camera, in least squares over the plane.

    Parameters
    ----------
    what : Camera
        The camera.

    Returns
    -------
    GaussianFit

    Examples
    --------
    Where the lens is perfect and the pixels are large, c is that of the pixel alone:

    >>> round(fit_camera(Camera(wavelength=0.5, f_number=1.0, pitch=20.0)).blur, 3)
    0.358

    Where they are small, c is that of diffraction, in proportion to the f-number:

    >>> [round(fit_camera(Camera(0.5, N, 0.1)).blur * 0.1 / (0.5 * N), 3) for N in (4, 8)]
    [0.412, 0.412]
    """
    nodes = _Spectrum.of(what)

    def explained(blur: float) -> float:
        return 4 * math.pi * blur**2 * nodes.overlap(blur) ** 2

    # A lens that is far out of focus makes rings, and so more than one maximum: the range between
    # a fraction of the finest detail and the extent of the widest disc is searched first.
    widest = 4 * (what.side + (1 + 8 * (abs(what.w20) + abs(what.w40))) / what.cutoff)
    least = 0.02 * widest / (1 + what.side * what.cutoff)
    grid = np.linspace(math.log(least), math.log(widest), 160)
    best = int(np.argmax([explained(math.exp(log_blur)) for log_blur in grid]))
    ends = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    blur = math.exp(root_between(lambda log_blur: nodes.slope(math.exp(log_blur)), *ends))
    return GaussianFit(
        blur=blur / what.pitch,
        height=nodes.overlap(blur) * 2.0,
        residual=math.sqrt(max(1 - explained(blur) / nodes.energy, 0.0)),
    )


def psf_profile(what: Camera, radius: ArrayLike) -> Array:
    """Return the mean of a camera's point spread function over circles around its centre.

    Parameters
    ----------
    what : Camera
        The camera; lens and pixel together.
    radius : array_like, shape (n,)
        Radii of the circles in micrometres.

    Returns
    -------
    ndarray, shape (n,)
        Per square micrometre, for an integral of 1.
    """
    from scipy.special import j0

    r = np.asarray(radius, dtype=np.float64)
    if r.ndim != 1 or not np.isfinite(r).all():
        raise InputError("radius: must be a list of finite numbers, in micrometres")
    nodes = _Spectrum.of(what, float(np.abs(r).max(initial=0.0)))
    return np.asarray(j0(2 * np.pi * r[:, None] * nodes.frequency) @ (nodes.weight * nodes.mean))


@dataclass(frozen=True)
class _Spectrum:
    """A camera's transfer function at nodes of an integral over the plane of frequencies."""

    frequency: Array
    weight: Array  # of each circle of frequencies; sums to the area of the disc
    mean: Array  # of the transfer function over each circle
    energy: float  # integral of its square

    @classmethod
    def of(cls, what: Camera, radius: float = 0.0) -> _Spectrum:
        """Choose the nodes; `radius` is the largest at which the spread function is wanted."""
        periods = what.side * what.cutoff
        waves = abs(what.w20) + 2 * abs(what.w40)
        n = 96 + math.ceil(6 * (waves + periods + radius * what.cutoff))
        unit, weight = _unit_nodes(n)
        frequency = unit * what.cutoff
        weight = 2 * np.pi * frequency * weight * what.cutoff
        lens = lens_transfer(unit, what.w20, what.w40)
        # The midpoint rule converges exponentially for functions of period pi / 2.
        n_angles = 32 + math.ceil(4 * periods)
        angle = (np.arange(n_angles) + 0.5) * (np.pi / 2 / n_angles)
        rows, columns = (frequency[:, None] * turn(angle) for turn in (np.sin, np.cos))
        pixel = pixel_transfer(rows, columns, what.side)
        energy = float((weight * lens**2 * (pixel**2).mean(axis=1)).sum())
        return cls(frequency, weight, lens * pixel.mean(axis=1), energy)

    def overlap(self, blur: float) -> float:
        """Integral of the transfer function times that of a Gaussian of integral 1."""
        gaussian = np.exp(-2 * (np.pi * blur * self.frequency) ** 2)
        return float((self.weight * self.mean * gaussian).sum())

    def slope(self, blur: float) -> float:
        """Derivative of the blur times the overlap, whose square is what is explained."""
        square = (2 * np.pi * blur * self.frequency) ** 2
        return float((self.weight * self.mean * np.exp(-square / 2) * (1 - square)).sum())


def _unit_nodes(least: int) -> tuple[Array, Array]:
    """Return nodes and weights of the Gauss-Legendre rule on [0, 1], at least so many."""
    return _rule(least if least < 16 else 32 * math.ceil(least / 32))


@lru_cache(maxsize=64)
def _rule(n: int) -> tuple[Array, Array]:
    """Return the rule of `n` nodes; making one costs more than using it."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return (nodes + 1) / 2, weights / 2
