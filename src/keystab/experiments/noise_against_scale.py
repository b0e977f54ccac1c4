"""White noise of a view in its scale-spaces, against scale (section 6.3)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from keystab.parameters import Scales
from keystab.scalespace.white_noise import dog_noise, gaussian_noise

__all__ = ["noise_against_scale"]


def noise_against_scale(scales: Scales, camera_blur: float, n_oct: int) -> pd.DataFrame:
    r"""Noise of both scale-spaces against scale, and its ratio from octave to octave (figure 12).

    Parameters
    ----------
    scales : Scales
        First scale and ratio of the two blurs.
    camera_blur : float
        Blur c of the camera, which the noise does not have, pixels.
    n_oct : int
        Octaves.

    Returns
    -------
    DataFrame
        One row per scale: ``sigma``; ``dog_noise`` of unit white noise in the difference of
        Gaussians, and its ``octave_ratio``, that at :math:`\sigma` over that at :math:`2\sigma`;
        ``gaussian_noise`` and ``gaussian_octave_ratio``, the same of the Gaussian scale-space.

    Examples
    --------
    >>> table = noise_against_scale(Scales(1.1, 2 ** (1 / 3)), 0.8, 2)
    >>> table[["octave_ratio", "gaussian_octave_ratio"]].iloc[[0, -1]].round(2).to_numpy().tolist()
    [[3.91, 2.71], [2.06, 2.03]]
    """
    sigma = scales.sigma_min * 2.0 ** np.linspace(0, n_oct, 20 * n_oct + 1)
    here, above = (dog_noise(each, camera_blur, scales.kappa) for each in (sigma, 2 * sigma))
    columns = {"sigma": sigma, "dog_noise": here, "octave_ratio": here / above}
    here, above = (gaussian_noise(np.sqrt(v**2 - camera_blur**2)) for v in (sigma, 2 * sigma))
    return pd.DataFrame(columns | {"gaussian_noise": here, "gaussian_octave_ratio": here / above})
