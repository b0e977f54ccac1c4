r"""How much of a view is aliased (section 6.1 of the paper).

A view samples a scene that the camera has blurred. What the blur leaves at frequencies beyond half
a cycle per pixel is folded back to lower ones. The scene is a finite cosine series, so that its
energy beyond that limit is a finite sum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.scalespace.cosine_series import gaussian
from keystab.utils import validation

Array = NDArray[np.float64]


class Aliasing(NamedTuple):
    """Energy of a view, and the part of it that is aliased; means of squares of grey values.

    Attributes
    ----------
    view, aliased : float
        Of the view without its mean.
    dog, aliased_dog : float
        Of the difference of Gaussians of the view at one scale.
    """

    view: float
    aliased: float
    dog: float
    aliased_dog: float


def aliased_energy(
    coefs: Array, blur: float, step: float, sigma: float = 1.1, kappa: float = 2 ** (1 / 3)
) -> Aliasing:
    r"""Energy of a view, and the part beyond half a cycle per pixel of the view.

    A coefficient :math:`a_{kl}` of the scene's series is seen at :math:`k S / 2H` and
    :math:`l S / 2W` cycles per pixel of the view and carries :math:`w_k w_l a_{kl}^2` with
    :math:`w_0 = 1` and 1/2 else. It is aliased where either frequency exceeds 1/2; the difference
    of Gaussians then sees it at the distance to the nearest whole number.

    Parameters
    ----------
    coefs : ndarray, shape (H, W)
        Cosine series of the scene, `keystab.camera.simulation.Scene.coefficients`.
    blur : float
        Camera blur c in pixels of the view, >= 0.
    step : float
        Subsampling step S, > 0.
    sigma, kappa : float
        Scale, at least `blur`, and ratio of the difference of Gaussians.

    Returns
    -------
    Aliasing

    Raises
    ------
    InputError
        If a parameter is out of its range.

    Notes
    -----
    Means over all sub-pixel shifts of the view and over the whole scene: for a single shift,
    folded frequencies also interfere with those that were there before.

    Examples
    --------
    Waves of 0.4 and 0.6 cycles per pixel of the view, with equal contrast before the camera:

    >>> coefs = np.zeros((1, 100))
    >>> coefs[0, [8, 12]] = 1.0
    >>> found = aliased_energy(coefs, blur=0.0, step=10.0)
    >>> found.view, found.aliased
    (1.0, 0.5)
    """
    validation.number("blur", blur, least=0)
    validation.number("step", step, above=0)
    validation.number("sigma", sigma, least=blur)
    validation.number("kappa", kappa, above=1)
    energy = np.square(coefs)
    energy[1:, :] /= 2
    energy[:, 1:] /= 2
    energy[0, 0] = 0.0
    seen = [step * np.arange(n) / (2 * n) for n in coefs.shape]  # cycles per pixel of the view
    camera = [gaussian(n, blur * step) ** 2 for n in coefs.shape]
    folded = [frequency - np.round(frequency) for frequency in seen]
    wide, narrow = (
        [np.exp(-((s**2 - blur**2) / 2) * (2 * math.pi * f) ** 2) for f in folded]
        for s in (kappa * sigma, sigma)
    )
    # The square of a difference of two products is a sum of three products.
    terms = [(1.0, wide, wide), (-2.0, wide, narrow), (1.0, narrow, narrow)]
    beyond = [frequency > 0.5 for frequency in seen]
    within = [~each for each in beyond]
    everywhere = [np.ones(n, dtype=bool) for n in coefs.shape]
    # What is aliased is summed by itself: as a difference of sums it would drown in rounding.
    aliased_parts = ((beyond[0], everywhere[1]), (within[0], beyond[1]))

    def total(of: tuple[Array, Array], parts: tuple[tuple[Array, Array], ...]) -> float:
        return float(sum((of[0] * rows) @ energy @ (of[1] * columns) for rows, columns in parts))

    def of_dog(parts: tuple[tuple[Array, Array], ...]) -> float:
        return sum(
            sign * total((camera[0] * a[0] * b[0], camera[1] * a[1] * b[1]), parts)
            for sign, a, b in terms
        )

    plain = (camera[0], camera[1])
    all_parts = (*aliased_parts, (within[0], within[1]))
    return Aliasing(
        total(plain, all_parts),
        total(plain, aliased_parts),
        of_dog(all_parts),
        of_dog(aliased_parts),
    )
