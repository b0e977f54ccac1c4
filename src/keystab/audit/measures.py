"""What is asked of a detector in one condition: rows of tables, each number with its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.audit.conditions import BLOBS, HIGH, KNOWN, LOW, MARGIN, Condition, View
from keystab.camera.common_field import to_common_frame
from keystab.evaluation.location_errors import (
    NOTHING,
    Estimate,
    Phases,
    coverage,
    drift,
    phase_pattern,
    quantile,
    share,
    spread,
    strongest_phase,
)
from keystab.evaluation.repeatability import (
    Common,
    displaced,
    distinct,
    in_common,
    one_to_one,
    seam_deficit,
)
from keystab.io.keypoint_conventions import Convention

__all__ = ["DISTANCES", "Measured", "measured", "own_definition", "unmeasured"]

DISTANCES = (0.1, 0.5, 1.0, 3.0)
"""Pixels within which two views must agree."""

PER_KEYPOINT = 400.0
"""Pixels per keypoint where detectors are compared at the same number of them."""

_FEWEST_PHASES = 30
_NEAR = 0.5  # of half a pixel beside the others, drifts do not ask: many are false matches
_OCTAVES = ((LOW, 2 * LOW), (2 * LOW, HIGH))
_BANDS = tuple((LOW * 2 ** (k / 2), LOW * 2 ** ((k + 1) / 2)) for k in range(4))


class Measured(NamedTuple):
    """What was measured of a detector in one condition.

    Attributes
    ----------
    row : dict
        One number for each question.
    octaves : list of dict
        Bias, errors and recall of every octave.
    phases : list of dict
        Dependence of the errors on the sub-pixel phase, by band of scales.
    """

    row: dict[str, Any]
    octaves: list[dict[str, Any]]
    phases: list[dict[str, Any]]


class _Seen(NamedTuple):
    """One view with what was found in it, and which of both belong together."""

    view: View
    found: pd.DataFrame
    counted: NDArray[np.bool_]
    partner: NDArray[np.intp]
    copies: int


def measured(
    condition: Condition, columns: Sequence[pd.DataFrame], convention: Convention
) -> Measured:
    """Measure what was found in the views of a condition.

    Parameters
    ----------
    condition : Condition
    columns : sequence of DataFrame
        ``y, x, scale`` of the keypoints of every view, as the detector has them, and others.
    convention : Convention
        What the detector says that these mean.

    Returns
    -------
    Measured
    """
    seen = [
        _seen(condition, view, raw, convention)
        for view, raw in zip(condition.views, columns, strict=True)
    ]
    pairs = _pairs(seen)
    row: dict[str, Any] = _counts(condition, seen)
    row |= _places(pairs, condition.views[0].image.shape)
    row |= _repeatabilities(condition, seen)
    deficit, at = seam_deficit(*_recalled(seen))
    row |= {**deficit.named("seam_deficit"), "seam_at": at}
    bands = _phases(condition, pairs)
    known = [band for band in bands if band[1].n >= _FEWEST_PHASES]
    strongest = max(known, key=lambda band: band[1].explained)[1] if known else None
    row |= _phase_columns(strongest)
    return Measured(
        row,
        [_octave(low, high, seen, pairs) for low, high in _OCTAVES],
        [
            {"sigma_low": low, "n": phases.n, **_phase_columns(phases)}
            for low, phases in bands
            if phases.n
        ],
    )


def unmeasured() -> Measured:
    """Row of a detector of which nothing could be measured."""
    return Measured({}, [], [])


# ---------------------------------------------------------------------------------------------
# What belongs together


def _seen(condition: Condition, view: View, raw: pd.DataFrame, convention: Convention) -> _Seen:
    """Take a detector's own columns for ours, merge copies, and look for what each stands for."""
    named = Convention(convention.origin, "yx", convention.scale)  # columns have their names
    others = raw.drop(columns=["y", "x", "scale"])
    found = pd.concat([named.table(raw["y"], raw["x"], raw["scale"]), others], axis=1)
    found = found[found["sigma"].between(LOW / KNOWN, HIGH * KNOWN)].reset_index(drop=True)
    kept = distinct(found)
    counted = found["sigma"].between(LOW, HIGH).to_numpy()
    if condition.stage is not None and view.spec is not None:
        counted = counted & condition.stage.compared(
            view.spec, found["y"].to_numpy(), found["x"].to_numpy()
        )
    copies = int((counted & ~kept).sum())
    found, counted = found[kept].reset_index(drop=True), counted[kept]
    return _Seen(view, found, counted, one_to_one(found, view.truth), copies)


class _Pairs(NamedTuple):
    """Detections that stand for a true extremum that is compared."""

    error: NDArray[np.float64]
    position: NDArray[np.float64]
    sigma: NDArray[np.float64]
    scale: NDArray[np.float64]
    """Logarithm of the detected sigma over the true one."""
    view: NDArray[np.intp]
    extremum: NDArray[np.intp]
    """Which extremum it is, the same number in all views."""
    found: pd.DataFrame


def _pairs(seen: Sequence[_Seen]) -> _Pairs:
    parts = []
    for number, each in enumerate(seen):
        rows = np.flatnonzero(each.partner >= 0)
        rows = rows[each.view.wanted[each.partner[rows]]]
        found, true = each.found.iloc[rows], each.view.truth.iloc[each.partner[rows]]
        position = true[["y", "x"]].to_numpy(dtype=float)
        sigma = true["sigma"].to_numpy(dtype=float)
        parts.append(
            _Pairs(
                found[["y", "x"]].to_numpy(dtype=float) - position,
                position,
                sigma,
                np.log(found["sigma"].to_numpy(dtype=float) / sigma),
                np.full(len(rows), number),
                _extrema(each.view, number)[each.partner[rows]],
                found,
            )
        )
    return _Pairs(
        np.concatenate([part.error for part in parts]),
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.sigma for part in parts]),
        np.concatenate([part.scale for part in parts]),
        np.concatenate([part.view for part in parts]),
        np.concatenate([part.extremum for part in parts]),
        pd.concat([part.found for part in parts], ignore_index=True),
    )


def _extrema(view: View, number: int) -> NDArray[np.intp]:
    """Which extremum each row of the truth is; below 0, one that no other view has."""
    own: NDArray[np.intp] = -1 - number * 2**24 - np.arange(len(view.truth))
    return own if view.extremum is None else view.extremum


def _recalled(
    seen: Sequence[_Seen],
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.intp]]:
    """Scale, whether found, and view of every true extremum that is compared."""
    sigma, found, view = [], [], []
    for number, each in enumerate(seen):
        hit = np.zeros(len(each.view.truth), dtype=bool)
        hit[each.partner[each.partner >= 0]] = True
        sigma.append(each.view.truth["sigma"].to_numpy()[each.view.wanted])
        found.append(hit[each.view.wanted])
        view.append(np.full(int(each.view.wanted.sum()), number))
    return np.concatenate(sigma), np.concatenate(found), np.concatenate(view)


# ---------------------------------------------------------------------------------------------
# Numbers


def _counts(condition: Condition, seen: Sequence[_Seen]) -> dict[str, Any]:
    """How much is found, how much of it is right, and what chance would find."""
    _, found, _ = _recalled(seen)
    n_counted = sum(int(each.counted.sum()) for each in seen)
    n_right = sum(int((each.counted & (each.partner >= 0)).sum()) for each in seen)
    near = [_near(each) for each in seen]
    hits = turns = 0
    for each in seen:
        height, width = each.view.image.shape
        for moved in displaced(each.found, (0.0, height - 1.0, 0.0, width - 1.0)):
            partner = one_to_one(moved, each.view.truth)
            hits += int(each.view.wanted[partner[partner >= 0]].sum())
            turns += int(each.view.wanted.sum())
    on_blobs = condition.name == BLOBS  # where what lies between the blobs is not listed
    return {
        "n_views": len(seen),
        "n_keypoints": n_counted / len(seen),
        "duplicates": sum(each.copies for each in seen) / len(seen),
        "twins": math.nan if on_blobs else sum(near) / len(seen),
        "n_true": len(found) / len(seen),
        **share(int(found.sum()), len(found)).named("recall"),
        **(NOTHING if on_blobs else share(n_right, n_counted)).named("precision"),
        "chance": share(hits, turns).value,
    }


def _near(each: _Seen) -> int:
    """Detections that stand for nothing beside a true extremum that another stands for."""
    left = each.found[each.counted & (each.partner < 0)]
    return int((one_to_one(left, each.view.truth) >= 0).sum())


def _places(pairs: _Pairs, shape: tuple[int, ...]) -> dict[str, Any]:
    """Where what is found lies beside what it stands for."""
    distance = np.hypot(*pairs.error.T)
    bias = quantile(pairs.scale)
    extent = (float(shape[0]), float(shape[1]))
    drifts = drift(pairs.error, pairs.position, extent, pairs.extremum, _NEAR)
    held = NOTHING
    if {"std_y", "std_x"} <= {*pairs.found} and len(pairs.found):
        std_y, std_x = (pairs.found[name].to_numpy(dtype=float) for name in ("std_y", "std_x"))
        held = coverage(pairs.error, std_y, std_x, pairs.found.get("cov_yx", 0.0))
    return {
        **quantile(pairs.error[:, 0]).named("bias_y"),
        **quantile(pairs.error[:, 1]).named("bias_x"),
        **quantile(distance).named("error_median"),
        **quantile(distance, 0.9).named("error_p90"),
        **quantile(distance / pairs.sigma).named("error_over_sigma"),
        **Estimate(*(math.expm1(each) for each in bias)).named("scale_bias"),
        **spread(pairs.scale).named("scale_spread"),
        **drifts[0].named("drift_y"),
        **drifts[1].named("drift_x"),
        **held.named("coverage_90"),
    }


def _repeatabilities(condition: Condition, seen: Sequence[_Seen]) -> dict[str, Any]:
    """What each further view has in common with the first."""
    none = Common(0, 0)
    counts = dict.fromkeys(DISTANCES, none)
    matched, numbers = none, [0]
    stage = condition.stage
    for other in seen[1:] if stage is not None else ():
        first, second = _in_first_frame(condition, seen[0], other)
        area = _common_area(condition, seen[0], other)
        number = int(area / PER_KEYPOINT)
        numbers.append(number)
        for distance in DISTANCES:
            counts[distance] += in_common(first, second, distance)
        matched += in_common(first, second, 1.0, number=number)
    row: dict[str, Any] = {}
    for distance, count in counts.items():
        row |= count.repeatability.named(f"repeatability_{distance:g}")
    return {
        **row,
        **matched.repeatability.named("repeatability_matched"),
        "n_matched": max(numbers) or math.nan,
    }


def _in_first_frame(condition: Condition, first: _Seen, other: _Seen) -> list[pd.DataFrame]:
    """Keypoints of two views that both can see, in the frame of the first, with their strengths."""
    stage, spec, first_spec = condition.stage, other.view.spec, first.view.spec
    assert stage is not None and spec is not None and first_spec is not None
    ratio = spec.step / first_spec.step
    frames = []
    for each, own, factor in ((first, first_spec, 1.0), (other, spec, ratio)):
        y, x = to_common_frame(own, first_spec, stage.scene.shape, each.found["y"], each.found["x"])
        sigma = each.found["sigma"].to_numpy() * factor
        there = to_common_frame(first_spec, spec, stage.scene.shape, y, x)
        both = stage.compared(first_spec, y, x) & stage.compared(spec, *there)
        both &= (sigma >= LOW * max(1.0, ratio)) & (sigma <= HIGH * min(1.0, ratio))
        strength = each.view.strength(each.found)
        table = pd.DataFrame({"y": y, "x": x, "sigma": sigma, "strength": strength})
        frames.append(table[both].reset_index(drop=True))
    return frames


def _common_area(condition: Condition, first: _Seen, other: _Seen) -> float:
    """Pixels of the first view that both views compare."""
    stage, spec, first_spec = condition.stage, other.view.spec, first.view.spec
    assert stage is not None and spec is not None and first_spec is not None
    y, x = (each.ravel().astype(float) for each in np.mgrid[: stage.shape[0], : stage.shape[1]])
    there = to_common_frame(first_spec, spec, stage.scene.shape, y, x)
    return float((stage.compared(first_spec, y, x) & stage.compared(spec, *there)).sum())


def _octave(low: float, high: float, seen: Sequence[_Seen], pairs: _Pairs) -> dict[str, Any]:
    """Bias, errors and recall of one octave."""
    sigma, found, _ = _recalled(seen)
    own, rows = (sigma >= low) & (sigma < high), (pairs.sigma >= low) & (pairs.sigma < high)
    return {
        "sigma_low": low,
        "sigma_high": high,
        "n": int(rows.sum()),
        **share(int(found[own].sum()), int(own.sum())).named("recall"),
        **quantile(pairs.error[rows, 0]).named("bias_y"),
        **quantile(pairs.error[rows, 1]).named("bias_x"),
        **quantile(np.hypot(*pairs.error[rows].T)).named("error_median"),
        **Estimate(*(math.expm1(each) for each in quantile(pairs.scale[rows]))).named("scale_bias"),
    }


def _phases(condition: Condition, pairs: _Pairs) -> list[tuple[float, Phases]]:
    """Dependence on the phase by band of scales; of blobs, by their size."""
    found = []
    for low, high in _BANDS:
        rows = (pairs.sigma >= low) & (pairs.sigma < high)
        found.append((low, strongest_phase(pairs.error[rows], pairs.position[rows])))
    return found


def _phase_columns(phases: Phases | None) -> dict[str, Any]:
    names = ("yy", "yx", "xy", "xx")
    if phases is None:
        nothing = {f"phase_{name}{end}": math.nan for name in names for end in ("", "_half")}
        return {"phase_pattern": "", "phase_step": math.nan, **nothing}
    numbers = zip(names, phases.matrix.ravel(), phases.half_width.ravel(), strict=True)
    row: dict[str, Any] = {"phase_pattern": phase_pattern(phases), "phase_step": phases.step}
    for name, value, half in numbers:
        row |= {f"phase_{name}": float(value), f"phase_{name}_half": float(half)}
    return row


def own_definition(
    view: View, raw: pd.DataFrame, convention: Convention, truth: pd.DataFrame
) -> dict[str, float]:
    """Whether a detector computes what it says: its keypoints against the extrema of its own image.

    Parameters
    ----------
    view : View
    raw : DataFrame
        ``y, x, scale`` as the detector has them.
    convention : Convention
        What the detector says that these mean.
    truth : DataFrame
        ``y, x, sigma`` of the extrema of the image's own scale-space, for the detector's ratio of
        blurs and the camera blur that it assumes; those of the first octave, and what is around.

    Returns
    -------
    dict
        ``own_recall, own_precision`` with intervals, and ``own_error_median``.
    """
    seen = _seen(Condition("", [view], None), view, raw, convention)
    found = seen.found
    partner = one_to_one(found, truth)

    def compared(table: pd.DataFrame) -> NDArray[np.bool_]:
        inside = table["sigma"].between(LOW, 2 * LOW).to_numpy()
        for name, size in zip(("y", "x"), view.image.shape, strict=True):
            inside = inside & table[name].between(MARGIN, size - 1 - MARGIN).to_numpy()
        return inside

    counted, wanted = compared(found), compared(truth)
    hit = np.zeros(len(truth), dtype=bool)
    hit[partner[partner >= 0]] = True
    rows = np.flatnonzero((partner >= 0) & counted)
    apart = found[["y", "x"]].to_numpy()[rows] - truth[["y", "x"]].to_numpy()[partner[rows]]
    return {
        **share(int(hit[wanted].sum()), int(wanted.sum())).named("own_recall"),
        **share(len(rows), int(counted.sum())).named("own_precision"),
        **quantile(np.hypot(*apart.T)).named("own_error_median"),
    }
