r"""What error bars are good for: motion and depth from keypoints, weighted by them and not.

Two shots of one picture from two places are matched, and asked for three things a person wants:

``translation``
    The shift between the shots, rotation and zoom being known: two numbers from all matches.
``homography``
    The projective map between them: eight numbers from all matches.
``triangulation``
    The shift of each match along the direction in which the camera moved, which is what its depth
    follows from: one number from each match, whose two coordinates both see it.

Motion is solved by `scipy.optimize.least_squares` with Cauchy's loss. Its unit is the scatter of
the residuals themselves, so that no way to weight them has to know how large errors are: what
differs is how they compare. A match is weighted by the sum of both covariances: the same for all
(``equal``), one per octave (``octave``, as SLAM programs assume), or that of the error bars
(``bars``), predicted from the noisy shots alone. All matches are kept, or those of which both
keypoints have a survival of at least `LEAST_SURVIVAL`.

Matches are what a tracker has that predicts motion within a pixel: the nearest of the same sign,
one to one, sought again after a first fit. Some are wrong.

Criteria, written before the first run, at each noise, from the interval of the error over that with
equal weights and all matches:

1. weights *help* where the interval's upper end is below 1, and *harm* where its lower end is above
   1; they help much where the ratio is below 0.8;
2. dropping low survival *helps* where the same holds of the error over that with the same weights
   and all matches.

``docs/findings/error_bars.md`` says what came of it on the default picture. One error per octave
helps nowhere and harms some. Dropping low survival helps triangulation, where what is left is
better, and harms homographies where much is dropped: weights already say what survival does. On
``casamila``, which steered nothing, ratios are 0.43 to 0.63 (translation), 0.43 to 0.69
(homography) and 0.59 to 0.87 (triangulation) at noise of 0.003 to 0.03 (12 pairs).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.evaluation.intervals import bootstrap_counts
from keystab.experiments.uncertainty_calibration import counterparts, shot
from keystab.prediction.uncertainty import keypoint_uncertainty
from keystab.utils.random import random_generator

__all__ = [
    "KEPT",
    "LEAST_SURVIVAL",
    "TASKS",
    "WEIGHTS",
    "Motion",
    "moved_shots",
    "motion_errors",
    "weights_table",
]

TASKS = ("translation", "homography", "triangulation")
WEIGHTS = ("equal", "octave", "bars")
KEPT = ("all", "surviving")
LEAST_SURVIVAL = 0.5

#: Residuals beyond so many units count less and less.
_LOSS_SCALE = 2.0

#: How far the predicted motion is off: pixels of the shift, and of rotation and zoom at 100 pixels.
_ROUGH = 0.5

#: Distances of matches in the scale-space's own units, before and after a first fit.
_RADII = (1.0, 0.5)

#: Keypoints nearer to the border than this many times sigma see the mirror image beyond it, which
#: does not move as the scene does.
_FROM_BORDER = 4.0

#: Fewer matches are not asked.
_FEWEST = 12

_RESAMPLES = 1000


class Motion(NamedTuple):
    """Where places of one view lie in another: matrix @ (place - centre) + shift.

    Attributes
    ----------
    matrix : ndarray, shape (2, 2)
    shift, centre : ndarray, shape (2,)
        (y, x) in pixels.
    """

    matrix: NDArray[np.float64]
    shift: NDArray[np.float64]
    centre: NDArray[np.float64]

    @classmethod
    def between(cls, first: ViewSpec, second: ViewSpec, reference_shape: tuple[int, int]) -> Motion:
        """Motion from the view `first` to `second`, as the camera moved."""
        centre = (np.array(first.shape) - 1) / 2
        corners = centre + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        there = np.column_stack(
            to_view(second, reference_shape, *to_reference(first, reference_shape, *corners.T))
        )
        return cls((there[1:] - there[0]).T, there[0], centre)

    def __call__(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where places, shape (n, 2), lie in the second view."""
        return (places - self.centre) @ self.matrix.T + self.shift

    def rough(self, *purpose: int | str) -> Motion:
        """As a tracker would predict it."""
        off = _ROUGH * (2 * random_generator("rough motion", *purpose).random(4) - 1)
        turn = np.array([[off[0], -off[1]], [off[1], off[0]]]) / 100
        return self._replace(matrix=self.matrix @ (np.eye(2) + turn), shift=self.shift + off[2:])


def moved_shots(
    views: Sequence[NDArray[np.float64]],
    specs: Sequence[ViewSpec],
    reference_shape: tuple[int, int],
    levels: Sequence[float],
    n_shots: int,
    search: Mapping[str, Any],
) -> pd.DataFrame:
    """Ask pairs of shots from different places, the first and the second view, the next two, ...

    Parameters
    ----------
    views : sequence of ndarray
        Views without noise.
    specs : sequence of ViewSpec
        Where each was taken.
    reference_shape : tuple of int
        Height and width of the scene.
    levels : sequence of float
        Standard deviations of the noise, which is estimated from each shot.
    n_shots : int
        Shots of each view.
    search : mapping
        Options of `keystab.keypoint_uncertainty`.

    Returns
    -------
    DataFrame
        Rows of `motion_errors`, ``noise``, and ``pair``, which tells pairs apart.
    """
    rows = []
    for level in levels:
        for draw in range(n_shots):
            found = [
                _seen(shot(view, "additive", level, "moved", number, draw), spec.blur, search)
                for number, (view, spec) in enumerate(zip(views, specs, strict=True))
            ]
            for number in range(0, len(found) - 1, 2):
                motion = Motion.between(specs[number], specs[number + 1], reference_shape)
                pair = {"noise": level, "pair": draw * len(found) + number}
                asked = motion_errors(found[number], found[number + 1], motion, draw, number)
                rows += [{**row, **pair} for row in asked]
    names = ["task", "weights", "kept", "matches", "error", "noise", "pair"]
    return pd.DataFrame(rows, columns=names)


def _seen(image: NDArray[np.float64], blur: float, search: Mapping[str, Any]) -> pd.DataFrame:
    """Keypoints with error bars of a shot, those that do not see beyond its border."""
    found = keypoint_uncertainty(image, blur, **search)
    room = np.minimum(found[["y", "x"]], np.array(image.shape) - 1 - found[["y", "x"]])
    inside: pd.DataFrame = found[room.min(axis=1) >= _FROM_BORDER * found["sigma"]]
    return inside


class _Matches(NamedTuple):
    """Matched places and the covariances of their difference in the second view."""

    first: NDArray[np.float64]
    second: NDArray[np.float64]
    covariance: dict[str, NDArray[np.float64]]
    survival: NDArray[np.float64]

    def kept(self) -> _Matches:
        rows = self.survival >= LEAST_SURVIVAL
        return _Matches(
            self.first[rows],
            self.second[rows],
            {name: values[rows] for name, values in self.covariance.items()},
            self.survival[rows],
        )


def motion_errors(
    first: pd.DataFrame, second: pd.DataFrame, motion: Motion, *purpose: int | str
) -> Iterator[dict[str, str | float]]:
    """Errors of what is asked of a pair of shots.

    Parameters
    ----------
    first, second : DataFrame
        From `keystab.keypoint_uncertainty`.
    motion : Motion
        The true one.
    *purpose : int or str
        Names the draw of the predicted motion.

    Yields
    ------
    dict
        ``task``, ``weights``, ``kept`` (``all`` or ``surviving``), ``matches`` and ``error``:
        pixels of the second view; of a translation the length of its error, of a homography the
        root mean square over the view, of triangulation what 68 % of the errors are below.
    """
    rough = motion.rough(*purpose)
    for radius in _RADII:
        matches = _matched(first, second, rough, radius)
        if len(matches.first) < _FEWEST:
            return
        rough = _affine(matches, rough)
    corners = [grid.ravel() for grid in np.mgrid[0:1:9j, 0:1:9j]]
    places = np.column_stack(corners) * 2 * motion.centre
    along = motion.shift - motion.centre
    along = along / max(float(np.hypot(*along)), 1e-12)
    for kept in KEPT:
        used = matches if kept == "all" else matches.kept()
        if len(used.first) < _FEWEST:
            continue
        for weights in WEIGHTS:
            covariance = used.covariance[weights]
            shift = _translation(used, motion, covariance) - motion.shift
            projected = _homography(used, rough, covariance)(places) - motion(places)
            inverse = np.linalg.inv(covariance) @ along
            off = used.second - motion(used.first)
            depth = np.einsum("ni,ni->n", inverse, off) / (inverse @ along)
            errors = (
                float(np.hypot(*shift)),
                float(np.sqrt((projected**2).sum(axis=1).mean())),
                float(np.quantile(np.abs(depth), 0.68)),
            )
            for task, error in zip(TASKS, errors, strict=True):
                yield {
                    "task": task, "weights": weights, "kept": kept,
                    "matches": float(len(used.first)), "error": error,
                }  # fmt: skip


def _matched(first: pd.DataFrame, second: pd.DataFrame, motion: Motion, radius: float) -> _Matches:
    """Match keypoints by where the motion predicts them."""
    zoom = float(np.sqrt(np.abs(np.linalg.det(motion.matrix))))
    there = motion(first[["y", "x"]].to_numpy(dtype=np.float64))
    predicted = first.assign(y=there[:, 0], x=there[:, 1], sigma=first["sigma"] * zoom)
    rows = counterparts(predicted, second, one_to_one=True, radius=radius)
    one, other = first[rows >= 0], second.iloc[rows[rows >= 0]]
    turned = motion.matrix @ _covariance(one) @ motion.matrix.T
    octaves = zoom**2 * 4.0 ** one["octave"].to_numpy() + 4.0 ** other["octave"].to_numpy()
    return _Matches(
        one[["y", "x"]].to_numpy(dtype=np.float64),
        other[["y", "x"]].to_numpy(dtype=np.float64),
        {
            "equal": np.tile(np.eye(2), (len(one), 1, 1)),
            "octave": octaves[:, None, None] * np.eye(2),
            "bars": turned + _covariance(other),
        },
        np.minimum(one["survival"].to_numpy(), other["survival"].to_numpy()),
    )


def _covariance(keypoints: pd.DataFrame) -> NDArray[np.float64]:
    y, x, yx = (keypoints[name].to_numpy(dtype=np.float64) for name in ("std_y", "std_x", "cov_yx"))
    return np.stack([y**2, yx, yx, x**2], axis=1).reshape(-1, 2, 2)


def _solved(
    matches: _Matches,
    covariance: NDArray[np.float64],
    mapped: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Parameters of a map for which the whitened residuals are least, with Cauchy's loss."""
    from scipy.optimize import least_squares

    whitening = np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        off = mapped(parameters) - matches.second
        return np.asarray(np.einsum("nij,nj->ni", whitening, off).ravel(), dtype=np.float64)

    for _ in range(2):
        unit = max(1.4826 * float(np.median(np.abs(residuals(start)))), 1e-12)
        found = least_squares(residuals, start, loss="cauchy", f_scale=_LOSS_SCALE * unit)
        start = np.asarray(found.x, dtype=np.float64)
    return start


def _affine(matches: _Matches, start: Motion) -> Motion:
    """Affine map of matches, all alike."""
    values = _solved(
        matches,
        matches.covariance["equal"],
        lambda p: Motion(p[:4].reshape(2, 2), p[4:], start.centre)(matches.first),
        np.concatenate([start.matrix.ravel(), start.shift]),
    )
    return Motion(values[:4].reshape(2, 2), values[4:], start.centre)


def _translation(
    matches: _Matches, motion: Motion, covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Shift of a motion whose rotation and zoom are known."""
    return _solved(
        matches, covariance, lambda p: motion._replace(shift=p)(matches.first), motion.shift
    )


def _homography(
    matches: _Matches, start: Motion, covariance: NDArray[np.float64]
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Projective map of matches."""
    size = float(start.centre.max())

    def mapped(parameters: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
        affine = Motion(parameters[:4].reshape(2, 2), parameters[4:6], start.centre)
        depth = 1 + (places - start.centre) @ parameters[6:] / size
        centred = affine(places) - start.centre
        return np.asarray(start.centre + centred / depth[:, None], dtype=np.float64)

    begin = np.concatenate([start.matrix.ravel(), start.shift, [0.0, 0.0]])
    found = _solved(matches, covariance, lambda p: mapped(p, matches.first), begin)
    return lambda places: mapped(found, places)


def weights_table(errors: pd.DataFrame, levels: Sequence[float]) -> pd.DataFrame:
    """Errors of all pairs of shots, with intervals.

    Parameters
    ----------
    errors : DataFrame
        From `moved_shots`.
    levels : sequence of float
        Standard deviations of the noise.

    Returns
    -------
    DataFrame
        For every ``task, noise, weights, kept``: ``n`` pairs, mean number of ``matches``, the root
        mean square ``error`` over pairs with its 95 % bootstrap interval ``low, high``, its
        ``ratio`` to that with equal weights and all matches of the same pairs, and its ratio
        ``dropping`` to that with the same weights and all matches, each with ``_low`` and
        ``_high``. NaN where no pair has enough matches.
    """
    rows = []
    cases = [(weights, kept) for weights in WEIGHTS for kept in KEPT]
    for task, level in product(TASKS, levels):
        part = errors[(errors["task"] == task) & (errors["noise"] == level)]
        wide = part.pivot(index="pair", columns=["weights", "kept"], values=["error", "matches"])
        wide = wide.reindex(
            columns=[(name, *case) for name in ("error", "matches") for case in cases]
        )
        wide = wide.dropna()  # pairs of which all are known
        squares = wide["error"].to_numpy(dtype=np.float64) ** 2
        counts = bootstrap_counts(len(wide), _RESAMPLES, "weights", task, f"{level:g}")
        counts = np.vstack([np.ones_like(counts[:1]), counts])
        means = np.sqrt(counts @ squares / (len(wide) or np.nan))
        own = dict(zip(cases, means.T, strict=True))
        for case in cases:
            row: dict[str, Any] = {
                "task": task,
                "noise": level,
                "weights": case[0],
                "kept": case[1],
            }
            row |= {"n": len(wide), "matches": wide["matches", *case].mean()}
            for name, values in (
                ("", own[case]),
                ("ratio_", own[case] / own["equal", "all"]),
                ("dropping_", own[case] / own[case[0], "all"]),
            ):
                low, high = np.quantile(values[1:], [0.025, 0.975])
                row[name.rstrip("_") or "error"] = float(values[0])
                row |= {f"{name}low": float(low), f"{name}high": float(high)}
            rows.append(row)
    return pd.DataFrame(rows)
