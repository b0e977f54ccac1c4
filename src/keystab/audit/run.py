"""An audit: every detector under every condition, as tables."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pandas as pd

from keystab.audit.conditions import (
    BLOBS,
    KNOWN,
    LOW,
    Condition,
    View,
)
from keystab.audit.controls import CONTROLS
from keystab.audit.detectors import Detector
from keystab.audit.isolation import Found, Limits, detections
from keystab.audit.measures import DISTANCES, Measured, measured, own_definition, unmeasured
from keystab.evaluation.convention_found import found_convention
from keystab.io.keypoint_conventions import KEYSTAB
from keystab.truth.true_extrema import true_extrema

__all__ = ["CONTROL", "Audit", "Tables", "audited", "joined", "with_conventions"]

CONTROL = "control"
"""Name of the controls in the column of detectors."""


class Tables(NamedTuple):
    """What an audit found.

    Attributes
    ----------
    audit : DataFrame
        One row per detector, setting and condition.
    octaves, phases : DataFrame
        The same by octave, and the dependence on the sub-pixel phase by band of scales.
    durations : DataFrame
        Seconds per picture: the only numbers that another run does not give again.
    """

    audit: pd.DataFrame
    octaves: pd.DataFrame
    phases: pd.DataFrame
    durations: pd.DataFrame


_ESTIMATES = (
    "recall", "precision", "own_recall", "own_precision", "own_error_median", "bias_y", "bias_x",
    "error_median", "error_p90", "error_over_sigma", "scale_bias", "scale_spread",
    *(f"repeatability_{distance:g}" for distance in DISTANCES), "repeatability_matched",
    "drift_y", "drift_x", "seam_deficit", "coverage_90",
)  # fmt: skip
_FIRST = (
    "detector", "setting", "version", "condition", "problem", "convention_declared",
    "convention_found", "n_views", "n_keypoints", "duplicates", "twins", "n_true", "chance",
)  # fmt: skip
_LAST = (
    "n_matched", "seam_at", "phase_pattern", "phase_step",
    *(f"phase_{name}{end}" for name in ("yy", "yx", "xy", "xx") for end in ("", "_half")),
)  # fmt: skip
_ENDS = ("", "_low", "_high")
COLUMNS = (*_FIRST, *(f"{name}{end}" for name in _ESTIMATES for end in _ENDS), *_LAST)
"""Columns of `Tables.audit`."""

_OWN = ("translations", "blur", "noise")
"""Conditions in which detectors are held against their own definition."""

_WHO = ("detector", "setting", "condition")
_OCTAVES = (
    *_WHO, "sigma_low", "sigma_high", "n",
    *(f"{name}{end}" for name in ("recall", "bias_y", "bias_x", "error_median", "scale_bias")
      for end in _ENDS),
)  # fmt: skip
_PHASES = (*_WHO, "sigma_low", "n", *_LAST[2:])
_DURATIONS = (*_WHO, "version", "n_views", "seconds_first", "seconds_median")


@dataclass
class Audit:
    """The conditions of an audit, and what all detectors need of them.

    Parameters
    ----------
    conditions : list of Condition
        Blobs first, where conventions are found.
    """

    conditions: list[Condition]
    _own: dict[tuple[str, float, float], pd.DataFrame] = field(default_factory=dict)

    def own_truth(self, condition: Condition, kappa: float, blur: float) -> pd.DataFrame:
        """Extrema of the image of the first view, with what a detector assumes of it."""
        key = (condition.name, kappa, blur)
        if key not in self._own:
            low, high = LOW / KNOWN, 2 * LOW * KNOWN
            image = condition.views[0].image
            self._own[key] = true_extrema(image, min(blur, low), low, high, kappa, n_spo=[13])
        return self._own[key]

    def rows(
        self,
        detector: Detector,
        limits: Limits | None = None,
        python: str = sys.executable,
        told: Callable[[str], None] = lambda line: None,
        found: Sequence[Sequence[Found]] | None = None,
    ) -> Tables:
        """Audit one detector under all conditions; `found` is what it found, where known."""
        if found is None:
            found = _by_condition(detector, self.conditions, limits, python)
        tables = []
        problems: dict[str, list[str]] = {}
        for condition, answers in zip(self.conditions, found, strict=True):
            columns = [each.keypoints for each in answers if each.keypoints is not None]
            problem = next((each.problem for each in answers if each.keypoints is None), "")
            if not problem and not any(map(len, columns)):
                problem = "it found nothing"
            done = unmeasured()
            if len(columns) == len(answers):
                done = measured(condition, columns, detector.convention)
                done.row.update(self._own_definition(detector, condition, columns))
            if problem:
                problems.setdefault(problem, []).append(condition.name)
            head = {
                "detector": detector.name,
                "setting": detector.setting,
                "condition": condition.name,
                "version": answers[0].version,
                "problem": problem,
                "convention_declared": str(detector.convention),
                "convention_found": _convention(condition, columns, detector.convention.order),
            }
            tables.append(_tables(head, done, [each.seconds for each in answers]))
        for problem, names in problems.items():
            where = "" if len(names) == len(self.conditions) else f" ({', '.join(names)})"
            told(f"{detector.name}, {detector.setting}: {problem}{where}")
        return joined(tables)

    def controls(self) -> Tables:
        """Audit what is known to be right, wrong in known ways, and chance."""
        tables = []
        for setting, control in CONTROLS.items():
            for condition in self.conditions:
                columns = [
                    control(view, number).rename(columns={"sigma": "scale"})
                    for number, view in enumerate(condition.views)
                ]
                head = {
                    "detector": CONTROL,
                    "setting": setting,
                    "condition": condition.name,
                    "version": "",
                    "problem": "",
                    "convention_declared": str(KEYSTAB),
                    "convention_found": _convention(condition, columns, KEYSTAB.order),
                }
                tables.append(_tables(head, measured(condition, columns, KEYSTAB), []))
        return joined(tables)

    def _own_definition(
        self, detector: Detector, condition: Condition, columns: Sequence[pd.DataFrame]
    ) -> dict[str, float]:
        """Recall and precision by the detector's own definition, where it is known."""
        view = condition.views[0]
        if detector.kappa is None or condition.name.split()[0] not in _OWN:
            return {}
        truth = self.own_truth(condition, detector.kappa, detector.own_blur(view.blur))
        return own_definition(view, columns[0], detector.convention, truth)


def with_conventions(table: pd.DataFrame) -> pd.DataFrame:
    """Table of an audit in which what was found on blobs stands in all rows of a setting.

    Parameters
    ----------
    table : DataFrame
        `Tables.audit`, with ``convention_found`` in the rows of blobs.

    Returns
    -------
    DataFrame
    """
    on_blobs = table[table["condition"] == BLOBS].set_index(["detector", "setting"])
    found = on_blobs["convention_found"].to_dict()
    keys = zip(table["detector"], table["setting"], strict=True)
    return table.assign(convention_found=[found.get(key, "") for key in keys])


def _convention(condition: Condition, columns: Sequence[pd.DataFrame], order: str) -> str:
    """What positions and scales seem to mean, where that can be told: on blobs."""
    if condition.name != BLOBS or len(columns) < len(condition.views):
        return ""
    return str(found_convention(columns, [view.truth for view in condition.views], order))


def audited(
    audit: Audit,
    detectors: Iterable[Detector],
    limits: Limits | None = None,
    python: str = sys.executable,
    told: Callable[[str], None] = lambda line: None,
    controls: bool = True,
) -> Iterator[Tables]:
    """Audit detectors one after the other.

    Parameters
    ----------
    audit : Audit
    detectors : iterable of Detector
    limits : Limits, optional
    python : str
        The Python that runs detectors of other libraries than this.
    told : callable
        Takes one line for each problem.
    controls : bool
        Whether the controls come first.

    Yields
    ------
    Tables
        What is found of conventions stands in the rows of blobs; see `with_conventions`.
    """
    # One detector works while what others found is measured.
    pool = ThreadPoolExecutor(1)
    try:
        asked = [
            (
                each,
                pool.submit(_by_condition, each, audit.conditions, limits, _python(each, python)),
            )
            for each in detectors
        ]
        if controls:
            yield audit.controls()
        for detector, answer in asked:
            yield audit.rows(detector, told=told, found=answer.result())
    finally:
        pool.shutdown(cancel_futures=True)


def _python(detector: Detector, python: str) -> str:
    """Python that runs a detector: this one where it is this project's own."""
    own = detector.kind == "library" and detector.runs == "keystab"
    return sys.executable if own else python


def joined(tables: Sequence[Tables]) -> Tables:
    """Tables under one another.

    Rows of several detectors keep their order; columns are those of `COLUMNS`.
    """
    return Tables(*(pd.concat(each, ignore_index=True) for each in zip(*tables, strict=True)))


def _by_condition(
    detector: Detector,
    conditions: Sequence[Condition],
    limits: Limits | None,
    python: str,
) -> list[list[Found]]:
    """What a detector finds; one process for all conditions, another for those after a crash.

    A detector that is too slow, prints too much or crashes twice is not asked again.
    """
    found: list[list[Found]] = []
    crashes = 0
    while len(found) < len(conditions):
        left = conditions[len(found) :]
        views: list[View] = [view for condition in left for view in condition.views]
        images, blurs = [view.image for view in views], [view.blur for view in views]
        answers = list(detections(detector, images, blurs, limits, python))
        batches = []
        for condition in left:
            batches.append(answers[: len(condition.views)])
            answers = answers[len(condition.views) :]
        broken = next(
            (number for number, batch in enumerate(batches) if any(each.ended for each in batch)),
            None,
        )
        crashes += broken is not None
        again = broken is not None and crashes < 2 and _may_go_on(batches[broken])
        found += batches[: broken + 1] if again and broken is not None else batches
    return found


def _may_go_on(batch: Sequence[Found]) -> bool:
    problem = next(each.problem for each in batch if each.ended)
    return problem.startswith("it was ended") or problem.startswith("it ended")


def _tables(head: dict[str, Any], done: Measured, seconds: Sequence[float]) -> Tables:
    who = {name: head[name] for name in _WHO}
    known = [each for each in seconds if not math.isnan(each)]
    duration = {
        **who,
        "version": head["version"],
        "n_views": len(known),
        "seconds_first": known[0] if known else math.nan,
        "seconds_median": float(pd.Series(known[1:] or known, dtype=float).median()),
    }
    durations = [duration] if seconds else []
    return Tables(
        pd.DataFrame([{**head, **done.row}]).reindex(columns=list(COLUMNS)),
        pd.DataFrame([{**who, **row} for row in done.octaves]).reindex(columns=list(_OCTAVES)),
        pd.DataFrame([{**who, **row} for row in done.phases]).reindex(columns=list(_PHASES)),
        pd.DataFrame(durations).reindex(columns=list(_DURATIONS)),
    )
