"""How a scale-space is sampled: scales, sampling step, grid size and what they cost.

Section 2 and equation (23) of the paper. All lengths are in pixels of the input image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from keystab.errors import InputError
from keystab.utils import validation

# Beyond this many samples in one axis an index times delta_min loses digits that matter, and no
# machine that we know of finishes the octave.
_MOST_SAMPLES_PER_AXIS = 2**22
_MOST_SCALES = 10_000

# Scales that differ by less than this share are the same: a blur of 1.1 in single precision is the
# blur of 1.1.
_SAME = 1e-6


def balanced_delta(n_spo: int, kappa: float = 2 ** (1 / 3), sigma_min: float = 1.1) -> float:
    r"""Sampling step that balances space against scale, equation (23) of the paper.

    .. math:: \delta_{min} = \sqrt 2 \, \kappa \, \sigma_{min} \, (2^{1/n_{spo}} - 1)

    Parameters
    ----------
    n_spo : int
        Scales per octave, at least 1.
    kappa : float
        Ratio of the two blurs of the difference of Gaussians, above 1.
    sigma_min : float
        First scale, in pixels of the input image.

    Returns
    -------
    float
        Distance of adjacent fine samples, in pixels of the input image.

    Examples
    --------
    >>> round(balanced_delta(15), 4)
    0.0927
    """
    _check_scales(n_spo, sigma_min, kappa)
    return math.sqrt(2) * kappa * sigma_min * (2 ** (1 / n_spo) - 1)


@dataclass(frozen=True)
class Sampling:
    """One octave of a sampled difference-of-Gaussians scale-space.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the input image, in pixels.
    camera_blur : float
        Blur c that the input image already has, in pixels.
    n_spo : int
        Scales per octave.
    delta_min : float
        Distance of adjacent samples of the first octave, in pixels of the input image.
    sigma_min : float
        Scale of slice 0 of the first octave.
    kappa : float
        Ratio of the two blurs of a difference-of-Gaussians slice.
    octave : int
        0 for the first. Each further octave doubles the scales and keeps every second sample.
    slices : tuple of int
        First slice and one past the last, ``(0, n_spo + 2)`` in the paper.
    """

    shape: tuple[int, int]
    camera_blur: float
    n_spo: int
    delta_min: float
    sigma_min: float
    kappa: float
    octave: int = 0
    slices: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        _check_scales(self.n_spo, self.sigma_min, self.kappa)
        validation.integer("octave", self.octave, least=0, most=40)
        for name in ("sigma_min", "kappa", "camera_blur", "delta_min"):
            above = None if name == "camera_blur" else 0
            least = 0 if name == "camera_blur" else None
            # Plain floats, whatever kind of number was given: they go into stores as they are.
            value = validation.number(name, getattr(self, name), least, above)
            object.__setattr__(self, name, value)
        if self.slices is not None and not self.slices[0] < self.slices[1]:
            raise InputError(f"slices are {self.slices}, allowed is a first and a later last one")
        if self.sigma_min < self.camera_blur * (1 - _SAME):
            raise InputError(
                f"sigma_min is {self.sigma_min:g} but the image already has a blur of "
                f"{self.camera_blur:g} px: give a sigma_min of at least {self.camera_blur:g}"
            )
        if self.sigma[0] < self.camera_blur * (1 - _SAME):
            raise InputError(
                f"slice {self.first_slice} has the scale {self.sigma[0]:.4g} px, below the camera "
                f"blur of {self.camera_blur:g} px: begin at a later slice"
            )
        if min(self.grid_shape) < 3:
            raise InputError(
                f"an image of {self.shape[0]} x {self.shape[1]} px holds fewer than 3 samples a "
                f"side at a step of {self.step:g} px (octave {self.octave}): give a larger image, "
                "a smaller delta_min or fewer octaves"
            )
        if max(self.base_grid_shape) > _MOST_SAMPLES_PER_AXIS:
            raise InputError(
                f"delta_min = {self.delta_min:g} px on an image of {self.shape[0]} x "
                f"{self.shape[1]} px asks for {max(self.base_grid_shape):,} samples a side, at "
                f"most {_MOST_SAMPLES_PER_AXIS:,} are allowed: give a larger delta_min"
            )

    @classmethod
    def balanced(
        cls, shape: tuple[int, int], camera_blur: float, n_spo: int, sigma_min: float, kappa: float
    ) -> Sampling:
        """First octave at the step of `balanced_delta`."""
        step = balanced_delta(n_spo, kappa, sigma_min)
        return cls(shape, camera_blur, n_spo, step, sigma_min, kappa)

    @property
    def first_slice(self) -> int:
        """Index s of the first slice held."""
        return self.slices[0] if self.slices else 0

    @property
    def n_slices(self) -> int:
        """Number of difference-of-Gaussians slices."""
        return self.slices[1] - self.slices[0] if self.slices else self.n_spo + 2

    @property
    def sigma(self) -> np.ndarray:
        """Scale of every slice, ``sigma_min * 2**(octave + s/n_spo)``, shape (n_slices,)."""
        s = np.arange(self.first_slice, self.first_slice + self.n_slices)
        return self.sigma_min * 2.0 ** (self.octave + s / self.n_spo)

    @property
    def stride(self) -> int:
        """Samples of the first octave's grid from one sample of this octave to the next."""
        return 1 << self.octave

    @property
    def step(self) -> float:
        """Distance of adjacent samples of this octave, in pixels of the input image."""
        return self.delta_min * self.stride

    @property
    def base_grid_shape(self) -> tuple[int, int]:
        """Samples of the first octave's grid: ``int(size / delta_min)`` a side."""
        return (int(self.shape[0] / self.delta_min), int(self.shape[1] / self.delta_min))

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Samples of this octave's grid, height and width."""
        height, width = self.base_grid_shape
        return (-(-height // self.stride), -(-width // self.stride))

    @property
    def n_samples(self) -> int:
        """Samples of all slices together."""
        height, width = self.grid_shape
        return self.n_slices * height * width

    def blurs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gaussian blurs to be added to the input image for every slice.

        A slice is the image blurred to ``kappa * sigma`` minus the image blurred to ``sigma``,
        both straight from the input. Where ``kappa`` is a whole number of scale steps, the two
        families share their members, which is found here by index so that rounding cannot
        separate them.

        Returns
        -------
        blur : ndarray, shape (n_blurs,)
            Distinct blurs in pixels of the input image, ascending.
        lower, upper : ndarray of int, shape (n_slices,)
            Index into `blur` of the two Gaussians of each slice.
        """
        s = np.arange(self.first_slice, self.first_slice + self.n_slices)
        shift = self.n_spo * math.log2(self.kappa)
        if abs(shift - round(shift)) < 1e-9:
            shift = round(shift)
        scale_index, inverse = np.unique(np.concatenate([s, s + shift]), return_inverse=True)
        scale = self.sigma_min * 2.0 ** (self.octave + scale_index / self.n_spo)
        blur = np.sqrt(np.maximum(scale**2 - self.camera_blur**2, 0.0))
        return blur, inverse[: s.size], inverse[s.size :]


def _check_scales(n_spo: int, sigma_min: float, kappa: float) -> None:
    validation.integer("n_spo", n_spo, least=1, most=_MOST_SCALES)
    validation.number("sigma_min", sigma_min, above=0)
    validation.number("kappa", kappa, above=1)
