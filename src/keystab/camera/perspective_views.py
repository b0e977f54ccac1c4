r"""Views of a plane that is seen from the side: the camera's blur, integrated in the view.

The camera blurs what arrives at its sensor: a pixel of the view is

.. math:: u(p) = \int G_c(q - p) \, u_{ref}(P(q)) \, dq

with P from the view to the reference. Where P is no similarity, no blur of the reference does the
same. The integral is a sum over a fine lattice of the view (the trapezoidal rule, which converges
faster than exponentially for a Gaussian), and the reference is read at its points, with all the
frequencies that the blur leaves anywhere in the view.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.camera import perspective
from keystab.camera.views import ViewSpec, to_reference
from keystab.scalespace import cosine_series
from keystab.utils import memory

Array = NDArray[np.float64]

#: Standard deviations in frequency at which the blur leaves less than 1e-9 of a wave.
_KILLED = perspective.REACH

#: What the splines may get wrong of the reference, r.m.s.; a third of the rounding to float32.
_SPLINE_ERROR = 1e-8

#: Most samples of the reference per pixel of it, along each axis.
_FINEST = 8

#: Points of the lattice of the view that are read at a time.
_MOST_POINTS = 2**22


class _Lattice(NamedTuple):
    """How finely the reference and the view are sampled."""

    kept: float
    """Frequencies of the reference that are kept, cycles per pixel of it."""
    per_pixel: int
    """Points of the lattice per pixel of the view."""


def _lattice(spec: ViewSpec) -> _Lattice:
    """Choose the samplings: what they fold back, the blur of the camera has to remove."""
    reach = perspective.REACH * spec.blur
    y, x = (
        np.linspace(shift - n / 2 - reach, shift + n / 2 + reach, 17)
        for n, shift in zip(spec.shape, spec.shift, strict=True)
    )
    least, most = (
        part for part in perspective.stretch(spec.homography or _STRAIGHT, y[:, None], x[None, :])
    )
    removed = _KILLED / (2 * math.pi * spec.blur)  # from there on, cycles per pixel of the view
    of_reference = removed / (spec.step * float(least.min()))
    kept = min(of_reference, 0.5)
    per_pixel = math.ceil(kept * spec.step * float(most.max()) + removed)
    return _Lattice(kept, per_pixel)


_STRAIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _finer(kept: Array, shape: tuple[int, int]) -> int:
    """Samples of the reference per pixel of it, for splines that are good enough.

    A quintic spline that has a wave of f cycles per sample without error also has its first image,
    smaller by (f / (1 - f))^6, and the lattice of the view may fold that anywhere.
    """
    energy = kept**2
    energy[1:, :] /= 2
    energy[:, 1:] /= 2
    of_rows, of_columns = energy.sum(axis=1), energy.sum(axis=0)
    for finer in range(1, _FINEST):
        wrong = 0.0
        for part, n in ((of_rows, shape[0]), (of_columns, shape[1])):
            cycles = np.arange(part.size) / (2 * n * finer)
            wrong += float(part @ (cycles / (1 - cycles)) ** 12)
        if wrong <= _SPLINE_ERROR**2:
            return finer
    return _FINEST


def samples_of_view(reference_shape: tuple[int, int], spec: ViewSpec) -> float:
    """Samples of the view that are held at a time, and of the reference at one per pixel."""
    lattice = _lattice(spec)
    margin = 2 * perspective.REACH * spec.blur + 1
    points = [(n + margin) * lattice.per_pixel for n in spec.shape]
    weights = sum(n * p for n, p in zip(spec.shape, points, strict=True))
    height, width = reference_shape
    return 6.0 * min(points[0] * points[1], _MOST_POINTS) + 2 * weights + 3.0 * height * width


def integrate(coefs: Array, spec: ViewSpec) -> Array:
    """Take a view of a plane that is seen from the side.

    Parameters
    ----------
    coefs : ndarray, shape (H, W)
        Cosine series of the reference.
    spec : ViewSpec
        The view, with a blur above 0.

    Returns
    -------
    ndarray of float64, shape `spec.shape`
        Without noise.

    Notes
    -----
    Frequencies of the reference that the blur multiplies by less than 1e-9 everywhere in the view
    are left out. The others are read from quintic B-splines that have each of them without error,
    from as many samples of the reference, up to eight per pixel, as keep what the splines add below
    1e-8 r.m.s.; the lattice of the view is as fine as that takes for what it folds back.

    Limits: the reference is a plane; the blur is that of the sensor, the same in all of the view,
    and nothing is out of focus; samples grow with the square of what a small blur keeps, so that
    blurs far below one pixel of the reference are refused for memory.
    """
    from scipy import ndimage

    lattice = _lattice(spec)
    counts = [min(n, math.floor(2 * n * lattice.kept) + 1) for n in coefs.shape]
    weighted = coefs[: counts[0], : counts[1]].copy()
    finer = _finer(weighted, coefs.shape)
    for axis, n in enumerate(coefs.shape):
        cycles = np.arange(counts[axis]) / (2 * n * finer)  # per sample
        weighted *= np.expand_dims(np.sinc(cycles) ** -6, 1 - axis)
    fine = (coefs.shape[0] * finer, coefs.shape[1] * finer)
    memory.require(
        3 * 8.0 * fine[0] * fine[1],
        f"a reference of {coefs.shape[0]} x {coefs.shape[1]} pixels, {finer} times as fine",
        "give a larger blur or step, or a smaller reference",
    )
    spline = cosine_series.sampled(weighted, coefs.shape, fine)
    rows, columns = (_gaussian_rows(n, spec.blur, lattice.per_pixel) for n in spec.shape)
    view = np.zeros((rows.weights.shape[0], columns.weights.shape[0]))
    at_once = max(1, _MOST_POINTS // columns.places.size)
    for start in range(0, rows.places.size, at_once):
        part = slice(start, start + at_once)
        y, x = to_reference(spec, coefs.shape, rows.places[part, None], columns.places[None, :])
        where = np.stack([(p + 0.5) * finer - 0.5 for p in (y, x)])
        read = ndimage.map_coordinates(spline, where, order=5, mode="reflect", prefilter=False)
        view += rows.weights[:, part] @ (read @ columns.weights.T)
    return view


class _Rows(NamedTuple):
    """Points of the lattice along one axis, and what each counts in each pixel."""

    places: Array
    weights: Array


def _gaussian_rows(n: int, blur: float, per_pixel: int) -> _Rows:
    reach = math.ceil(perspective.REACH * blur * per_pixel)
    places = np.arange(-reach, (n - 1) * per_pixel + reach + 1) / per_pixel
    apart = (places[None, :] - np.arange(n)[:, None]) / blur
    weights = np.exp(-0.5 * apart**2) / (math.sqrt(2 * math.pi) * blur * per_pixel)
    weights[np.abs(apart) > perspective.REACH + 1] = 0.0
    return _Rows(places, weights)
