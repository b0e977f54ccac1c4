"""An audit: every detector under every condition, as tables."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pandas as pd

from keystab.audit.conditions import (
    BLOBS,
    KNOWN,
    LOW,
    Condition,
    Plan,
    Stage,
    View,
    blobs,
    conditions,
    taken,
)
from keystab.audit.controls import CONTROLS
from keystab.audit.detectors import Detector
from keystab.audit.isolation import Found, Limits, detections
from keystab.audit.measures import DISTANCES, Measured, measured, own_definition, unmeasured
from keystab.evaluation.convention_found import found_convention
from keystab.io.keypoint_conventions import KEYSTAB
from keystab.truth.true_extrema import true_extrema

__all__ = ["CONTROL", "Audit", "Tables", "audited", "condition_of", "names_of_conditions"]

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
    ) -> Tables:
        """Audit one detector under all conditions."""
        found = _by_condition(detector, self.conditions, limits, python)
        convention = ""
        tables = []
        problems: dict[str, list[str]] = {}
        for condition, answers in zip(self.conditions, found, strict=True):
            problem = next((each.problem for each in answers if each.keypoints is None), "")
            empty = not problem and all(not len(_some(each)) for each in answers)
            problem = problem or ("it found nothing" if empty else "")
            if problem:
                problems.setdefault(problem, []).append(condition.name)
            done = unmeasured()
            if all(each.keypoints is not None for each in answers):
                columns = [_some(each) for each in answers]
                if condition.name == BLOBS:
                    truths = [view.truth for view in condition.views]
                    order = detector.convention.order
                    convention = str(found_convention(columns, truths, order))
                done = measured(condition, columns, detector.convention)
                if condition.name != BLOBS and detector.kappa is not None:
                    own = self.own_truth(
                        condition, detector.kappa, detector.own_blur(condition.views[0].blur)
                    )
                    done.row.update(
                        own_definition(condition.views[0], columns[0], detector.convention, own)
                    )
            head = {
                "detector": detector.name,
                "setting": detector.setting,
                "condition": condition.name,
                "version": answers[0].version,
                "problem": problem,
                "convention_declared": str(detector.convention),
            }
            tables.append(_tables(head, done, [each.seconds for each in answers]))
        for problem, names in problems.items():
            where = "" if len(names) == len(self.conditions) else f" ({', '.join(names)})"
            told(f"{detector.name}, {detector.setting}: {problem}{where}")
        whole = joined(tables)
        whole.audit["convention_found"] = convention
        return whole

    def controls(self) -> Tables:
        """Audit what is known to be right, wrong in known ways, and chance."""
        tables = []
        for setting, control in CONTROLS.items():
            convention = ""
            own = []
            for condition in self.conditions:
                columns = [
                    control(view, number).rename(columns={"sigma": "scale"})
                    for number, view in enumerate(condition.views)
                ]
                if condition.name == BLOBS:
                    truths = [view.truth for view in condition.views]
                    convention = str(found_convention(columns, truths))
                head = {
                    "detector": CONTROL,
                    "setting": setting,
                    "condition": condition.name,
                    "version": "",
                    "problem": "",
                    "convention_declared": str(KEYSTAB),
                }
                own.append(_tables(head, measured(condition, columns, KEYSTAB), []))
            whole = joined(own)
            whole.audit["convention_found"] = convention
            tables.append(whole)
        return joined(tables)


def names_of_conditions(plan: Plan) -> list[str]:
    """Names of all conditions, that of the blobs first.

    Examples
    --------
    >>> names_of_conditions(Plan())[:3]
    ['blobs', 'translations', 'blur 0.3']
    """
    return [BLOBS, *conditions(plan)]


def condition_of(name: str, plan: Plan, stage: Stage | None) -> Condition:
    """Take the views of a condition; only blobs need no scene."""
    if name == BLOBS or stage is None:
        return blobs(plan)
    return taken(name, conditions(plan)[name], stage)


def audited(
    audit: Audit,
    detectors: Iterable[Detector],
    limits: Limits | None = None,
    python: str = sys.executable,
    told: Callable[[str], None] = lambda line: None,
) -> Iterator[Tables]:
    """Audit detectors one after the other; the controls come first.

    Parameters
    ----------
    audit : Audit
    detectors : iterable of Detector
    limits : Limits, optional
    python : str
        The Python that runs detectors of other libraries than this.
    told : callable
        Takes one line for each problem.

    Yields
    ------
    Tables
    """
    yield audit.controls()
    for detector in detectors:
        runs_here = detector.kind == "library" and detector.runs == "keystab"
        yield audit.rows(detector, limits, sys.executable if runs_here else python, told)


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


def _some(found: Found) -> pd.DataFrame:
    assert found.keypoints is not None
    return found.keypoints


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
