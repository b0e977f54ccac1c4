r"""Planes seen from the side: homographies between a view and the plane of the scene.

A homography here is a 3 x 3 matrix M that takes positions of a view, (down, right) from its centre
in its pixels, to positions of the plane, (down, right) from its centre in the same unit:

.. math:: (d', r') = (m_0, m_1) / m_2, \qquad m = M (d, r, 1)^T

with :math:`m_2 > 0` wherever the view looks at the plane. The paper's camera only looks straight at
it (section 3.1); that its analysis extends to perspective views is said in section 5.5.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError

Homography = tuple[tuple[float, float, float], ...]
"""Three rows of three numbers; tuples, so that views can be compared."""

Array = NDArray[np.float64]

REACH = 6.5
"""Standard deviations at which a Gaussian is cut: beyond, it is below 1e-9 of its height."""


def tilted(tilt: float, azimuth: float, focal_length: float) -> Homography:
    r"""Homography of a camera that looks at the centre of the plane from the side.

    The camera is turned about the centre of the plane by the tilt :math:`\theta`, at a distance at
    which a pixel there sees :math:`S` reference pixels along the axis of the turn and
    :math:`S / \cos \theta` across it. With u along the direction in which the plane recedes, v
    across, f the focal length:

    .. math:: (u', v') = (u, v \cos\theta) / (\cos\theta - \sin\theta\, u / f)

    Parameters
    ----------
    tilt : float
        Angle between the optical axis and the normal of the plane, in degrees, 0 <= tilt < 90.
    azimuth : float
        Direction in the view in which the plane recedes, in degrees: 0 to the right, 90 down.
    focal_length : float
        In pixels of the view, > 0.

    Returns
    -------
    Homography

    Raises
    ------
    InputError
        If a number is out of its range.

    Examples
    --------
    >>> to_plane(tilted(60.0, 0.0, 1000.0), 0.0, 1.0)[1].round(3).item()
    2.003
    """
    if not 0 <= tilt < 90:
        raise InputError(f"tilt is {tilt:g}, allowed are degrees from 0 to below 90: change it")
    if not math.isfinite(azimuth):
        raise InputError(f"azimuth is {azimuth}, allowed is a finite number of degrees: change it")
    if not 0 < focal_length < math.inf:
        raise InputError(f"focal_length is {focal_length}, allowed are pixels above 0: change it")
    theta, turn = math.radians(tilt), math.radians(azimuth)
    cos, sin = math.cos(theta), math.sin(theta)
    down, right = math.sin(turn), math.cos(turn)
    along = np.array([down, right, 0.0])  # u and v of a position of the view
    across = np.array([-right, down, 0.0])
    matrix = np.stack(
        [
            down * along - right * cos * across,
            right * along + down * cos * across,
            np.array([0.0, 0.0, cos]) - sin / focal_length * along,
        ]
    )
    return as_homography(matrix)


def as_homography(matrix: Any) -> Homography:
    """Three rows of three numbers, checked.

    Raises
    ------
    InputError
        If they are no finite 3 x 3 numbers, or the matrix has no inverse.
    """
    try:
        values = np.asarray(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (3, 3) or not np.isfinite(values).all():
        raise InputError("homography: give 3 x 3 finite numbers")
    size = float(np.abs(values).max())
    if size == 0 or abs(np.linalg.det(values / size)) < 1e-12:
        raise InputError("homography: the matrix has no inverse, and would see a line: change it")
    first, second, third = (tuple(row) for row in values.tolist())
    return first, second, third


def inverse(homography: Homography) -> Homography:
    """Homography from the plane to the view, of positive last entry in front of the camera."""
    # Applied to a position of the plane, its third component is 1 / m_2.
    return as_homography(np.linalg.inv(np.array(homography)))


def homogeneous(homography: Homography, down: ArrayLike, right: ArrayLike) -> list[Array]:
    """Return the three components of M (down, right, 1), of the shape of the positions."""
    y, x = np.asarray(down, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return [a * y + b * x + c for a, b, c in homography]


def to_plane(homography: Homography, down: ArrayLike, right: ArrayLike) -> tuple[Array, Array]:
    """Where positions of a view lie in the plane; NaN for those beyond its horizon."""
    y, x, depth = homogeneous(homography, down, right)
    depth = np.where(depth > 0, depth, np.nan)
    return y / depth, x / depth


def zoom(homography: Homography, down: ArrayLike, right: ArrayLike) -> Array:
    """Root of the area of the plane that a unit of area of the view sees, at positions of the view.

    Examples
    --------
    >>> round(zoom(((2.0, 0, 0), (0, 8.0, 0), (0, 0, 1.0)), 0.0, 0.0).item(), 9)
    4.0
    """
    depth = homogeneous(homography, down, right)[2]
    return np.asarray(math.sqrt(abs(np.linalg.det(np.array(homography)))) / np.abs(depth) ** 1.5)


def stretch(homography: Homography, down: ArrayLike, right: ArrayLike) -> tuple[Array, Array]:
    """Smallest and largest length in the plane of a unit of length of the view, at positions."""
    matrix = np.array(homography)
    y, x, depth = homogeneous(homography, down, right)
    jacobian = np.empty((*np.shape(depth), 2, 2))
    for row, place in enumerate((y, x)):
        for column in range(2):
            slope = matrix[row, column] * depth - matrix[2, column] * place
            jacobian[..., row, column] = slope / depth**2
    lengths = np.linalg.svd(jacobian, compute_uv=False)
    return lengths[..., 1], lengths[..., 0]
