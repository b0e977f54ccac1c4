"""The camera blur of lenses of three kinds, many apertures and pixels, as tables (section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from keystab.camera.optics import MODELS, camera, fit_camera, psf_profile
from keystab.errors import InputError
from keystab.utils import validation

if TYPE_CHECKING:
    import pandas as pd


def optics_table(
    f_numbers: Sequence[float],
    pitches: Sequence[float],
    wavelength: float = 0.55,
    fill_factor: float = 1.0,
    defocus: float = 28.0,
    spherical: float = 2.7,
) -> pd.DataFrame:
    """Compute the camera blur for lenses of three kinds, many apertures and pixel pitches.

    Parameters
    ----------
    f_numbers : sequence of float
        F-numbers, > 0.
    pitches : sequence of float
        Pixel pitches in micrometres, > 0.
    wavelength : float, default 0.55
        In micrometres.
    fill_factor : float, default 1
        Share of a pixel's area that collects light.
    defocus : float, default 28
        Distance of the sensor from the focus in micrometres, for the model ``defocus``.
    spherical : float, default 2.7
        Spherical aberration at f/2 in wavelengths, for the model ``spherical``.

    Returns
    -------
    pandas.DataFrame
        One row per model, pitch and f-number: ``model``, ``pitch`` (micrometres), ``f_number``,
        ``c`` (pixels), ``c_um`` (micrometres), ``residual`` (see `GaussianFit`), ``w20`` and
        ``w40`` (wavelengths), ``wavelength`` and ``fill_factor``.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Examples
    --------
    >>> table = optics_table([1.4, 2.8, 8.0], [6.5]).set_index(["model", "f_number"])
    >>> table["c"].unstack().loc[["diffraction", "defocus"]].round(2).to_numpy().tolist()
    [[0.36, 0.37, 0.43], [0.95, 0.49, 0.43]]
    """
    import pandas as pd

    _check_lists(f_numbers=f_numbers, pitches=pitches)
    rows = []
    for model in MODELS:
        for pitch in pitches:
            for f_number in f_numbers:
                what = camera(model, wavelength, f_number, pitch, fill_factor, defocus, spherical)
                fit = fit_camera(what)
                rows.append(
                    {
                        "model": model,
                        "pitch": float(pitch),
                        "f_number": float(f_number),
                        "c": fit.blur,
                        "c_um": fit.blur * pitch,
                        "residual": fit.residual,
                        "w20": what.w20,
                        "w40": what.w40,
                        "wavelength": float(wavelength),
                        "fill_factor": float(fill_factor),
                    }
                )
    return pd.DataFrame(rows)


def range_table(
    f_numbers: Sequence[float],
    pitches: Sequence[float],
    confusions: Sequence[float],
    wavelength: float = 0.55,
    fill_factor: float = 1.0,
    shares: Sequence[float] = (0.0, 0.25, 0.5, 0.75, 1.0),
) -> pd.DataFrame:
    """Compute between which camera blurs a camera that counts as in focus may lie (section 4).

    A camera is focused at its largest aperture, of f-number N, where a sensor that is off by z
    makes a disc of diameter z / N of a point. Photographers call that sharp up to a diameter that
    belongs to the size of the sensor, the circle of confusion d: a sensor up to N d off the focus
    is in focus. The error stays when the lens is stopped down.

    Parameters
    ----------
    f_numbers, pitches, wavelength, fill_factor
        See `optics_table`.
    confusions : sequence of float
        Circles of confusion d in micrometres: 30 for sensors of 24 mm x 36 mm, 20 for those of two
        thirds of the size.
    shares : sequence of float, default 0 to 1 by quarters
        Focus errors in units of the largest that counts as in focus, >= 0.

    Returns
    -------
    pandas.DataFrame
        One row per pitch, circle of confusion and share: ``pitch``, ``confusion``, ``share``, the
        focus error ``defocus`` (all lengths in micrometres); the ``smallest`` and the ``largest``
        camera blur over all apertures, in pixels, and the f-numbers ``f_smallest, f_largest`` that
        have them.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Examples
    --------
    >>> table = range_table([1.4, 5.6], [6.5], [20.0], shares=[0.0, 1.0])
    >>> table[["defocus", "smallest", "largest"]].round(2).to_numpy().tolist()
    [[0.0, 0.36, 0.39], [28.0, 0.41, 0.95]]
    """
    import pandas as pd

    _check_lists(f_numbers=f_numbers, pitches=pitches, confusions=confusions)
    rows = []
    for pitch in pitches:
        for confusion in confusions:
            for share in shares:
                defocus = validation.number("shares", share, least=0) * confusion * min(f_numbers)
                lens = (wavelength, fill_factor)
                blurs = [
                    fit_camera(camera("defocus", lens[0], n, pitch, lens[1], defocus)).blur
                    for n in f_numbers
                ]
                least, most = int(np.argmin(blurs)), int(np.argmax(blurs))
                rows.append(
                    {
                        "pitch": float(pitch),
                        "confusion": float(confusion),
                        "share": float(share),
                        "defocus": float(defocus),
                        "smallest": blurs[least],
                        "largest": blurs[most],
                        "f_smallest": float(f_numbers[least]),
                        "f_largest": float(f_numbers[most]),
                    }
                )
    return pd.DataFrame(rows)


def profile_table(
    f_number: float,
    pitch: float,
    wavelength: float = 0.55,
    fill_factor: float = 1.0,
    defocus: float = 28.0,
    spherical: float = 2.7,
    reach: float = 2.0,
    count: int = 101,
) -> pd.DataFrame:
    """Compute point spread functions and their Gaussians along the radius, for the three models.

    Parameters
    ----------
    f_number, pitch : float
        The camera.
    wavelength, fill_factor, defocus, spherical : float
        See `optics_table`.
    reach : float, default 2
        Largest radius in pixels.
    count : int, default 101
        Number of radii from 0.

    Returns
    -------
    pandas.DataFrame
        One row per model and radius: ``model``, ``f_number``, ``pitch``, ``radius`` (pixels),
        ``psf``, the mean over the circle, and ``gaussian``, both per square pixel for a point
        spread function of integral 1; ``c`` and ``residual`` of the fit, see `GaussianFit`.
    """
    import pandas as pd

    validation.number("reach", reach, above=0)
    validation.integer("count", count, least=2)
    radius = np.linspace(0.0, reach, count)
    parts = []
    for model in MODELS:
        what = camera(model, wavelength, f_number, pitch, fill_factor, defocus, spherical)
        fit = fit_camera(what)
        gaussian = fit.height * np.exp(-0.5 * (radius / fit.blur) ** 2)
        parts.append(
            pd.DataFrame(
                {
                    "model": model,
                    "f_number": float(f_number),
                    "pitch": float(pitch),
                    "radius": radius,
                    "psf": psf_profile(what, radius * pitch) * pitch**2,
                    "gaussian": gaussian * pitch**2,
                    "c": fit.blur,
                    "residual": fit.residual,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _check_lists(**lists: Sequence[float]) -> None:
    """Raise `InputError` for a list that is empty or holds something else than numbers above 0."""
    for name, values in lists.items():
        if len(values) == 0:
            raise InputError(f"{name}: none were given; give numbers above 0")
        for value in values:
            validation.number(name, value, above=0)
