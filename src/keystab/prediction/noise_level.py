r"""The noise of a picture, from the picture alone.

A camera's blur leaves next to nothing of a scene at the highest frequencies of the pixel grid, and
white noise is the same at all: what is found there is noise. This is Donoho's estimator (the median
of the absolute values of the finest details) with the corner of the cosine transform in the place
of a wavelet's diagonal details, which begin at half the frequencies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError

__all__ = ["estimated_noise"]

#: Frequencies of both axes from which on a coefficient counts, over the highest.
_CORNER = 0.75

#: Rows and columns that a picture needs at least: four coefficients are looked at.
_LEAST = 8

#: Median of the absolute value of a standard normal variable.
_MEDIAN = 0.6744897501960817


def estimated_noise(image: NDArray[np.float64]) -> float:
    r"""Standard deviation of white noise, estimated from the highest frequencies.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Grey values; at least eight pixels a side.

    Returns
    -------
    float
        :math:`\mathrm{median}|d| / 0.6745` over the coefficients d of the orthonormal cosine
        transform from 0.75 of the highest frequency on along both axes; in the units of the image.

    Raises
    ------
    keystab.errors.InputError
        If the image has fewer than eight rows or columns.

    Notes
    -----
    Measured on views of 288 x 160 pixels of nine photographs: with a camera blur of 0.8 what is
    found without noise is at most 0.0005 of the grey range, and noise of 0.003 to 0.07 is found
    within 7 %. With a blur of 0.5 aliased detail counts as noise: 0.0024 to 0.012 is found where
    there is none. (``skimage.restoration.estimate_sigma``, which looks at wavelets, finds 0.001 to
    0.008 at a blur of 0.8 and 0.0025 to 0.021 at 0.5.)

    What correlates neighbouring pixels (demosaicing, denoising, JPEG) takes away the finest noise
    first and lowers the estimate, down to 0. It is one number for a picture: noise that depends on
    the grey value has to be given.

    Examples
    --------
    >>> noise = 0.02 * np.random.default_rng(0).standard_normal((200, 200))
    >>> round(estimated_noise(np.linspace(0, 1, 200) + noise), 3)
    0.02
    """
    from scipy.fft import dctn

    height, width = image.shape
    if min(height, width) < _LEAST:
        raise InputError(
            f"the image has {height} x {width} pixels, too few to estimate its noise from: "
            f"give noise, or an image of at least {_LEAST} x {_LEAST} pixels"
        )
    spectrum = dctn(image - image.mean(), norm="ortho")
    corner = spectrum[int(_CORNER * height) :, int(_CORNER * width) :]
    return float(np.median(np.abs(corner)) / _MEDIAN)
