"""What the noise of the reference does to views of it (section 4).

The paper calls its views noiseless, since each pixel of a view averages many of the reference. How
much noise the reference has is not known, but as much again, and several times as much, can be
added to it: what that changes says what its own can have changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.common_field import common_scales
from keystab.camera.simulation import Scene, simulate
from keystab.camera.views import ViewSpec
from keystab.detection.detector import detect_keypoints
from keystab.experiments.first_view import against_first
from keystab.matching.common_range import CommonRange
from keystab.prediction.noise_level import estimated_noise
from keystab.utils.random import random_generator


def noise_seen(noise: float, blur: float, step: float) -> float:
    r"""Noise of a view of a noisy reference, in closed form.

    White noise of standard deviation s, blurred by c S reference pixels and sampled, has the
    standard deviation :math:`s / (2 \sqrt{\pi} c S)`, and still the spectrum of the camera's blur.

    Parameters
    ----------
    noise : float
        Standard deviation s in the reference.
    blur, step : float
        Camera blur c in pixels of the view and step S; c S of at least one pixel of the reference.

    Examples
    --------
    >>> round(noise_seen(0.01, blur=1.1, step=10.0), 6)
    0.000256
    """
    return noise / (2 * math.sqrt(math.pi) * blur * step)


def reference_noise_table(
    reference: NDArray[np.floating[Any]],
    spec: ViewSpec,
    factors: Sequence[float],
    detector: Mapping[str, Any],
    compared: Mapping[str, Any],
    same: Mapping[str, Any],
) -> pd.DataFrame:
    """Add noise to the reference, in units of what it is estimated to have, and see what changes.

    Parameters
    ----------
    reference : ndarray, shape (H, W)
        Grey values of the reference.
    spec : ViewSpec
        The view, without noise of its own.
    factors : sequence of float
        Noise to add, in units of the estimated noise of the reference.
    detector : mapping
        Options of `keystab.detect_keypoints`, ``sigma_min`` among them.
    compared : mapping
        ``border`` in pixels of the view, ``first_scale`` and ``last_scale`` over ``sigma_min``.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    DataFrame
        One row per factor: ``factor``; ``noise_reference``, estimated; ``noise_added`` to the
        reference and ``noise_view``, what of it arrives in the view, and ``noise_theory``, the
        same in closed form; and the columns of `keystab.experiments.first_view.against_first`
        against the view without added noise.

    Notes
    -----
    The estimate takes the finest detail of a picture for noise where it cannot tell them apart, and
    what a picture's maker has smoothed away is not in it. One draw of noise, the same for all
    factors.
    """
    own = estimated_noise(np.asarray(reference, dtype=np.float64))
    draw = random_generator("noise of the reference").standard_normal(np.shape(reference))
    # The camera is linear: what it makes of the noise is added to what it makes of the scene.
    clean, noise = simulate(Scene(reference), spec), own * simulate(Scene(draw), spec)
    added = [0.0, *factors]
    found = [
        detect_keypoints(clean + factor * noise, spec.blur, **detector).assign(view=number)
        for number, factor in enumerate(added)
    ]
    specs = [spec] * len(added)
    ends = (compared["first_scale"], compared["last_scale"])
    scales = common_scales(specs, detector["sigma_min"], 1, *ends)
    everywhere = CommonRange(specs, np.shape(reference), compared["border"], *scales)
    table = against_first(pd.concat(found, ignore_index=True), everywhere, same)
    seen = float(np.std(noise))
    table.insert(0, "factor", added)
    theory = noise_seen(own, spec.blur, spec.step)
    of_own = {"noise_added": own, "noise_view": seen, "noise_theory": theory}
    table.insert(1, "noise_reference", own)
    for place, (name, unit) in enumerate(of_own.items(), 2):
        table.insert(place, name, unit * table["factor"])
    return table[table["factor"] > 0].drop(columns=["view", "blur", "zoom"]).reset_index(drop=True)
