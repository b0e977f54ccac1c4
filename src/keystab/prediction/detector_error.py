"""What the detector itself adds to the error of a keypoint, as the study measured it.

Detections were held against the true extrema of the same view, without noise: the default picture
(``config/images/coldwarm.png``) seen in 400 x 225 pixels with a camera blur of 1.1, true extrema of
scale 1.39 to 2.2, cubic spline, balanced sampling from sigma_min = 1.1 (figure truth,
``results/reference/tables/truth_samplings.csv``, columns ``recall``, ``median_location`` and
``median_scale``). Other scenes, and scales nearer to the camera blur, may have other errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["DetectorError", "detector_error"]

_SIGMA_MIN = 1.1

#: n_spo, sampling step in pixels, and for discrete and for refined detections each: recall, and
#: the median error of the location in pixels and of log2 sigma.
_MEASURED = np.array(
    [
        [3, 0.5094, 0.9103, 0.2121, 0.0745, 0.8460, 0.04822, 0.01565],
        [4, 0.3708, 0.9356, 0.1603, 0.0728, 0.8897, 0.03296, 0.01020],
        [5, 0.2914, 0.9770, 0.1271, 0.0436, 0.9310, 0.01874, 0.00626],
        [6, 0.2400, 0.9793, 0.1102, 0.0433, 0.9494, 0.01543, 0.00474],
        [7, 0.2040, 0.9931, 0.0894, 0.0329, 0.9770, 0.01132, 0.00354],
        [8, 0.1774, 0.9954, 0.0785, 0.0302, 0.9747, 0.00908, 0.00272],
        [9, 0.1569, 0.9931, 0.0701, 0.0300, 0.9770, 0.00773, 0.00235],
        [10, 0.1407, 0.9954, 0.0610, 0.0237, 0.9839, 0.00706, 0.00196],
        [11, 0.1275, 0.9977, 0.0607, 0.0247, 0.9862, 0.00641, 0.00171],
        [12, 0.1165, 0.9977, 0.0518, 0.0187, 0.9885, 0.00562, 0.00147],
        [13, 0.1073, 0.9954, 0.0480, 0.0188, 0.9908, 0.00517, 0.00136],
        [14, 0.0995, 0.9977, 0.0436, 0.0167, 0.9816, 0.00473, 0.00122],
        [15, 0.0927, 1.0000, 0.0408, 0.0151, 0.9954, 0.00463, 0.00123],
        [16, 0.0868, 0.9977, 0.0386, 0.0172, 0.9931, 0.00452, 0.00116],
        [17, 0.0816, 0.9977, 0.0375, 0.0139, 0.9954, 0.00419, 0.00113],
        [18, 0.0769, 0.9977, 0.0339, 0.0146, 0.9931, 0.00420, 0.00114],
        [19, 0.0728, 0.9977, 0.0340, 0.0131, 0.9885, 0.00407, 0.00099],
    ]
)

#: Median length of a normal vector of two components, and of one, over the standard deviation.
_MEDIAN_LENGTH, _MEDIAN_NUMBER = 1.177410, 0.674490


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

    The errors have a long tail: 90 % of those of refined detections are below some three times the
    median, where normal ones are below 1.8 times. The standard deviations are those of the normal
    distribution with the same median.

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
    ([0.0039, 0.0079], [0.0013, 0.0013], 0.995)
    """
    scales, steps = np.log(_MEASURED[:, 0]), np.log(_MEASURED[:, 1] / _SIGMA_MIN)
    recall, location, log_sigma = _MEASURED[:, 5:8].T if refined else _MEASURED[:, 2:5].T
    relative = np.exp(np.interp(-np.log(delta_min / sigma_min), -steps, np.log(location)))
    along = math.log(2) * np.exp(np.interp(np.log(n_spo), scales, np.log(log_sigma)))
    size = sigma_min / _SIGMA_MIN * 2.0**octave
    return DetectorError(
        relative * size / _MEDIAN_LENGTH,
        np.full(octave.size, along / _MEDIAN_NUMBER),
        float(np.interp(np.log(n_spo), scales, recall)),
    )
