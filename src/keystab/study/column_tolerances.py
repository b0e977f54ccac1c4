"""What the numbers of a table may differ by between machines, column by column.

Processors and their libraries add, multiply and call exp in other orders and ways: sums differ by
some 1e-16 of what is summed. How much of that reaches a column depends on what the column is. Whole
numbers, texts and verdicts may not differ at all, and nor may a column that is not named here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

__all__ = ["COLUMNS", "NOTHING", "Allowed", "allowed_in"]


class Allowed(NamedTuple):
    """Numbers may differ by ``absolute + relative * abs(number)``.

    Parameters
    ----------
    relative : float, default 0
        Share of the number, for what is known to so many digits of itself.
    absolute : float, default 0
        In the units of the column, for what is a difference of larger numbers, or zero but for
        rounding.
    """

    relative: float = 0.0
    absolute: float = 0.0


NOTHING = Allowed()

SET = Allowed(relative=1e-13)
"""Settings, and closed forms of them: some operations, each right to 1e-16."""

COUNTED = Allowed(relative=1e-12, absolute=1e-14)
"""Shares and means of whole numbers, which are the same, and intervals that follow from them."""

SOLVED = Allowed(relative=1e-11, absolute=1e-12)
"""Roots and integrals that hold no picture: as exact as sums of some hundred terms."""

GREY = Allowed(absolute=1e-13)
"""Grey values and their differences: at most 2^-46 of the range [0, 1] is rounding in each."""

STEPWISE = Allowed(relative=1e-11, absolute=1e-11)
"""Differences of grey values over the square of a step, down to 0.07 of the scale."""

PLACE = Allowed(absolute=1e-7)
"""Places and scales of single keypoints, pixels: rounding over the second differences, 1e-5, and
over the conditioning, down to 1e-4, times the step."""

SPREAD = Allowed(absolute=1e-9)
"""Deviations of places and scales, in the mean or the median over a hundred keypoints and more."""

CONDITION = Allowed(relative=1e-7)
"""Condition numbers of single Hessians, up to 1e5, whose largest entry is right to 1e-12."""

WEIGHED = Allowed(relative=4e-7)
"""Medians of solutions of iterated, robust least squares, stopped at changes of 1e-8."""

LEARNT = Allowed(absolute=1e-6)
"""Scores of models that were fitted to many keypoints until their gradient was nearly zero."""

_SHARES = (
    "share recall precision held found stability specificity sensitivity stable_below "
    "unstable_below rate new_rate lost_rate kept rejected share_always share_found share_right "
    "percentage_of_images percentage_of_unique percentage_seen mean_detections mean_above "
    "mean_common auc best_auc gain n_new n_lost n_true n_found n_detections n_right n_twin "
    "extrema_ratio common_ratio unique_ratio octave_ratio ratio_drop share_duplicates above_dog "
    "range_drop share_chance kept_always kept_others step"
)
_ENDS = (
    "low high low_detections high_detections low_above high_above low_always high_always "
    "low_found high_found low_right high_right new_low new_high lost_low lost_high recall_low "
    "recall_high precision_low precision_high auc_low auc_high rejected_low rejected_high "
    "gain_low gain_high low_extrema high_extrema low_common high_common low_unique high_unique "
    "low_octave high_octave low_drop high_drop low_duplicates high_duplicates low_chance "
    "high_chance low_step high_step low_kept high_kept low_others high_others low_range "
    "high_range"
)

COLUMNS: tuple[tuple[str, str, Allowed], ...] = (
    (
        ".*",
        "n_spo delta_min kappa blur step noise blur_spread sigma_from seen_by max_offset c level "
        "max_iterations sigma sigma_min pitch f_number w20 w40 wavelength fill_factor camera_blur "
        "assumed_blur theory radius epsilon limit tilt zoom factor",
        SET,
    ),
    (".*", _SHARES, COUNTED),
    (".*", _ENDS, COUNTED),
    ("fig1", "repeated_blur single_blur residual", SOLVED),
    ("fig1_samplings", "increment .*_error moved_.d widened_.d", SOLVED),
    ("fig2", "mean standard_deviation", GREY),
    ("fig(2|12)_pixels", "value grey", GREY),
    (
        "fig3",
        "median_condition q25_condition q75_condition low_condition high_condition",
        CONDITION,
    ),
    ("fig4_keypoints|fig6", "y x sigma", SET),  # of discrete extrema: places of the grid
    ("fig4_summary", "value", COUNTED),
    ("fig5_features|predictors_detections", "dog", GREY),
    ("fig5_features|predictors_detections", "difference laplacian", STEPWISE),
    ("fig5_features|predictors_detections|fig6", "condition condition_normalised", CONDITION),
    # Of all features; a threshold is the feature of some keypoint.
    ("fig5_(roc|thresholds)", "threshold", Allowed(CONDITION.relative, STEPWISE.absolute)),
    ("fig6", "level", GREY),
    ("fig6_cubes", "value", GREY),
    ("fig(7|8|S1|S5)_precision", "mean median low high low_median high_median", SPREAD),
    ("fig(7|8|S1|S5)_differences", "value other difference", COUNTED),
    ("fig7_edges", "along across low_along high_along low_across high_across", SPREAD),
    ("fig9_keypoints", "y x sigma scale_slope", PLACE),
    ("fig12_theory", "dog_noise octave_ratio gaussian_noise gaussian_octave_ratio", SOLVED),
    ("figS2", "error value", SET),
    ("figS2", "scale_shift q25_shift q75_shift", SPREAD),
    ("figS2", "blob_shift dilation_shift", SOLVED),
    ("figS3|figS3_profiles", "c c_um residual psf gaussian", SOLVED),
    ("figS4", "blob theory", SET),
    ("figS4", "detected error", SPREAD),  # error: of scales of some pixels, over their size
    ("predictors_detections", "y x sigma keypoint_y keypoint_x", PLACE),
    ("predictors_detections", "eigenvalue edge degeneracy saddle annulus end persistence", SPREAD),
    ("predictors_detections", "(stability|inside|truth)_.*", LEARNT),
    ("floor_(readings|summary)", "n_unique", COUNTED),
    ("dead_range", "end", SET),
    ("dead_range", "(share|low|high)_below", COUNTED),
    ("large_scales_octaves", "space_tolerance", SET),
    ("unbalanced_interpolation", "condition", CONDITION),
    ("unbalanced_interpolation", "(share|low|high)_accepted", COUNTED),
    ("unbalanced_interpolation", "(low_|high_)?spread spread_scale (low|high)_scale", SPREAD),
    ("blur_zooms_pairs", "distance scale_shift q25_shift q75_shift", SPREAD),
    ("figS3_ranges", "confusion defocus f_smallest f_largest", SET),
    ("figS3_ranges", "smallest largest", SOLVED),
    ("aliasing_energy", "contrast dog aliased.*", SOLVED),
    ("reference_noise", "noise_.*", SOLVED),
    ("reference_noise", "distance scale_shift q25_shift q75_shift", SPREAD),
    ("wrong_blur_identity", "assumed dilated", SET),
    ("wrong_blur_identity", "difference undilated", SOLVED),  # the largest of all grey values
    ("zoomed_truth", "(scale|location)_residual (q95|low|high)_(scale|location)", SPREAD),
    (
        "truth_.*|refinement_choices",
        "median_location p90_location rms_location median_scale p90_scale rms_scale",
        SPREAD,
    ),
    ("truth_views", "value", SET),
    ("truth_views", "low_rms high_rms", SPREAD),
    ("uncertainty_.*", "level", SET),
    ("uncertainty_reliability", "predicted_survival", SPREAD),
    ("uncertainty_strata", "middle", Allowed(relative=1e-8, absolute=1e-8)),
    ("uncertainty_weights", "noise matches", COUNTED),
    ("uncertainty_weights", "(error|ratio|dropping)(_low|_high)?", WEIGHED),
)
"""Tables by a regular expression for their names without suffix, columns by ones for theirs, and
what these may differ by; of several lines for one column the last counts."""


def allowed_in(table: str, columns: Iterable[str]) -> dict[str, Allowed]:
    """What each column of a table may differ by.

    Parameters
    ----------
    table : str
        Name of the table, without suffix.
    columns : iterable of str
        Its columns.

    Returns
    -------
    dict of str to Allowed
        Without those that may not differ.

    Examples
    --------
    >>> allowed_in("fig6", ["panel", "level", "x"])
    {'level': Allowed(relative=0.0, absolute=1e-13), 'x': Allowed(relative=1e-13, absolute=0.0)}
    """
    asked = list(columns)
    allowed: dict[str, Allowed] = {}
    for tables, names, most in COLUMNS:
        if re.fullmatch(tables, table):
            own = re.compile("|".join(names.split()))
            allowed |= {column: most for column in asked if own.fullmatch(column)}
    return allowed
