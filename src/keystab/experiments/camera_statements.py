"""What sections 3 to 6 of the paper say of the camera itself, without any keypoint.

The scene is its cosine series, so that a view, the scale-space of a view and the part of it that is
aliased are finite sums: what the text states can be computed without sampling anything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from keystab.camera.aliasing import aliased_energy
from keystab.camera.simulation import Scene, simulate
from keystab.camera.views import ViewSpec
from keystab.errors import InputError
from keystab.scalespace.cosine_series import coefficients, sampled

#: Margin of what is compared, in units of the largest blur: what the mirror at the border of the
#: view does is below 1e-9 there.
_MARGIN = 6.0


def aliasing_table(
    scene: Scene, blurs: Sequence[float], step: float, sigma: float, kappa: float
) -> pd.DataFrame:
    """How much of a view is aliased, against the blur of the camera (section 6.1).

    Parameters
    ----------
    scene : Scene
        What the camera looks at.
    blurs : sequence of float
        Camera blurs c in pixels of the view.
    step : float
        Subsampling step S.
    sigma, kappa : float
        First scale and ratio of the difference of Gaussians.

    Returns
    -------
    DataFrame
        One row per blur: ``blur``; r.m.s. ``contrast`` of the view about its mean and ``aliased``
        of what is folded back into it, in grey values; ``aliased_share``, the ratio of the two;
        ``dog``, ``aliased_dog`` and ``aliased_share_dog``, the same of the difference of Gaussians.
        Means over all sub-pixel shifts, see `keystab.camera.aliasing.aliased_energy`.
    """
    rows = []
    for blur in blurs:
        energy = aliased_energy(scene.coefficients, blur, step, sigma, kappa)
        view, aliased, dog, aliased_dog = (math.sqrt(part) for part in energy)
        rows.append(
            {
                "blur": float(blur),
                "contrast": view,
                "aliased": aliased,
                "aliased_share": aliased / view if view else np.nan,
                "dog": dog,
                "aliased_dog": aliased_dog,
                "aliased_share_dog": aliased_dog / dog if dog else np.nan,
            }
        )
    return pd.DataFrame(rows)


def wrong_blur_table(
    scene: Scene, spec: ViewSpec, assumed: Sequence[float], scales: Sequence[float]
) -> pd.DataFrame:
    r"""Hold the scale-space under a wrong blur against the right one, dilated along the scales.

    By the semigroup property (section 3.3) the scale-space of a view of blur c for which c' was
    assumed is, at :math:`\sigma`, that of the scene at :math:`\sqrt{\sigma^2 - c'^2 + c^2}`. The
    first is computed from the pixels of the view, the second from the scene.

    Parameters
    ----------
    scene : Scene
        What the camera looks at.
    spec : ViewSpec
        The view, of blur c, without noise.
    assumed : sequence of float
        Blurs c' that are assumed instead, in pixels of the view.
    scales : sequence of float
        Scales in pixels of the view, at least c'.

    Returns
    -------
    DataFrame
        One row per blur and scale: ``blur, assumed, sigma``; ``dilated``, the scale of the scene;
        ``difference``, the largest absolute difference of the two in grey values, over the pixels
        that lie six times the larger blur within the view; ``undilated``, the same to the scene at
        `sigma` itself.

    Raises
    ------
    InputError
        If a scale is below an assumed blur, or no pixel lies so far within the view.
    """
    series = coefficients(simulate(scene, spec))
    rows = []
    for wrong in assumed:
        for sigma in scales:
            if sigma < wrong:
                raise InputError(f"a scale is {sigma:g}, allowed is at least the blur {wrong:g}")
            dilated = math.sqrt(sigma**2 - wrong**2 + spec.blur**2)
            margin = math.ceil(_MARGIN * max(dilated, sigma))
            inside = tuple(slice(margin, n - margin) for n in spec.shape)
            seen = sampled(series, spec.shape, spec.shape, sigma**2 - wrong**2)[inside]
            if not seen.size:
                raise InputError(
                    f"a view of {spec.shape[0]} x {spec.shape[1]} px has no pixel {margin} px "
                    "within it: lower the scales or the step"
                )
            difference, undilated = (
                float(np.abs(seen - simulate(scene, replace(spec, blur=blur))[inside]).max())
                for blur in (dilated, sigma)
            )
            rows.append(
                {
                    "blur": spec.blur,
                    "assumed": float(wrong),
                    "sigma": float(sigma),
                    "dilated": dilated,
                    "difference": difference,
                    "undilated": undilated,
                }
            )
    return pd.DataFrame(rows)
