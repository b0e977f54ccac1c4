"""What the detector itself adds to the error of a keypoint, as the study measured it.

Detections were held against the true extrema of the same view, without noise: the default picture
(``config/images/coldwarm.png``) seen in 400 x 225 pixels with a camera blur of 1.1, true extrema of
scale 1.39 to 2.2, cubic spline, balanced sampling from sigma_min = 1.1 (figure truth,
``results/reference/tables/truth_samplings.csv``, columns ``recall``, ``p90_location`` and
``p90_scale``). Other scenes, and scales nearer to the camera blur, may have other errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["DetectorError", "detector_error"]

_SIGMA_MIN = 1.1

#: n_spo, sampling step in pixels, and for discrete and for refined detections each: recall, and
#: what 90 % of the errors are below, of the location in pixels and of log2 sigma.
_MEASURED = np.array(
    [
        [3, 0.5094, 0.9103, 0.3813, 0.1564, 0.8460, 0.12624, 0.05386],
        [4, 0.3708, 0.9356, 0.3063, 0.1177, 0.8897, 0.09860, 0.03767],
        [5, 0.2914, 0.9770, 0.2162, 0.0896, 0.9310, 0.05930, 0.02156],
        [6, 0.2400, 0.9793, 0.2067, 0.0780, 0.9494, 0.04891, 0.01628],
        [7, 0.2040, 0.9931, 0.1706, 0.0686, 0.9770, 0.04041, 0.01338],
        [8, 0.1774, 0.9954, 0.1364, 0.0553, 0.9747, 0.03016, 0.01063],
        [9, 0.1569, 0.9931, 0.1316, 0.0520, 0.9770, 0.02924, 0.00880],
        [10, 0.1407, 0.9954, 0.1134, 0.0453, 0.9839, 0.02329, 0.00765],
        [11, 0.1275, 0.9977, 0.1098, 0.0418, 0.9862, 0.02103, 0.00715],
        [12, 0.1165, 0.9977, 0.0933, 0.0379, 0.9885, 0.01686, 0.00629],
        [13, 0.1073, 0.9954, 0.0845, 0.0349, 0.9908, 0.01724, 0.00595],
        [14, 0.0995, 0.9977, 0.0798, 0.0322, 0.9816, 0.01564, 0.00560],
        [15, 0.0927, 1.0000, 0.0819, 0.0306, 0.9954, 0.01583, 0.00567],
        [16, 0.0868, 0.9977, 0.0725, 0.0297, 0.9931, 0.01566, 0.00539],
        [17, 0.0816, 0.9977, 0.0719, 0.0271, 0.9954, 0.01500, 0.00563],
        [18, 0.0769, 0.9977, 0.0636, 0.0246, 0.9931, 0.01385, 0.00541],
        [19, 0.0728, 0.9977, 0.0609, 0.0254, 0.9885, 0.01381, 0.00528],
    ]
)

#: 90 % of the lengths of a normal vector of two components, and of one, are below so many
#: standard deviations.
_P90_LENGTH, _P90_NUMBER = 2.145966, 1.644854


class DetectorError(NamedTuple):
    """Error of keypoints that stems from sampling and refinement.

    Attributes
    ----------
    location : ndarray
        Standard deviation in y and in x, pixels.
    log_sigma : ndarray
        Standard deviation of ln sigma.
    recall : float
        Share of the true extrema that are detected.
    """

    location: NDArray[np.float64]
    log_sigma: NDArray[np.float64]
    recall: float


def detector_error(
    octave: NDArray[np.int64], n_spo: int, delta_min: float, sigma_min: float, refined: bool
) -> DetectorError:
    """Error of the detector at a sampling.

    Parameters
    ----------
    octave : ndarray of int, shape (n,)
        Octave of each keypoint.
    n_spo, delta_min, sigma_min
        The sampling, see `keystab.detect_keypoints`.
    refined : bool
        Whether extrema were refined.

    Returns
    -------
    DetectorError
        Location by the sampling step relative to `sigma_min`, scale and recall by `n_spo`, between
        those measured on a logarithmic axis; beyond 3 and 19 scales per octave as at the end.

    Examples
    --------
    >>> error = detector_error(np.array([0, 1]), 15, 0.0927, 1.1, refined=True)
    >>> error.location.round(4).tolist(), error.log_sigma.round(4).tolist(), round(error.recall, 3)
    ([0.0074, 0.0148], [0.0024, 0.0024], 0.995)
    """
    scales, steps = np.log(_MEASURED[:, 0]), np.log(_MEASURED[:, 1] / _SIGMA_MIN)
    recall, location, log_sigma = _MEASURED[:, 5:8].T if refined else _MEASURED[:, 2:5].T
    relative = np.exp(np.interp(-np.log(delta_min / sigma_min), -steps, np.log(location)))
    along = math.log(2) * np.exp(np.interp(np.log(n_spo), scales, np.log(log_sigma)))
    size = sigma_min / _SIGMA_MIN * 2.0**octave
    return DetectorError(
        relative * size / _P90_LENGTH,
        np.full(octave.size, along / _P90_NUMBER),
        float(np.interp(np.log(n_spo), scales, recall)),
    )
