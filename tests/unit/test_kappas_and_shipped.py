"""Figure 9's tables and SIFT's filters, on detections that are known."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scenes import blob

from keystab.detection.refinement import refined_keypoints
from keystab.detection.sift_filters import passes_filters
from keystab.detection.view_detector import Detector, detect_in_view
from keystab.errors import InputError
from keystab.experiments.kappa_stability import common_normalised_scales, kappa_tables

SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
KAPPAS = [2 ** (1 / 30), 2 ** (1 / 6), 2**0.5]


def test_one_blob_is_one_keypoint_whatever_the_ratio():
    size, blur = 1.6, 0.9
    image = blob((35, 39), (17.0, 19.0), math.hypot(size, blur))
    parts = []
    for kappa in KAPPAS:
        found = refined_keypoints(*detect_in_view(image, Detector(blur, 15, kappa=kappa)), 0.6, 2)
        parts.append(found[found["sign"] < 0].assign(kappa=kappa))
    tables = kappa_tables(pd.concat(parts), KAPPAS, 15, 1.1, image.shape, 3.0, SAME)
    (keypoint,) = tables.keypoints.itertuples()
    assert abs(keypoint.sigma / size - 1) < 0.01  # s / sqrt(kappa) times sqrt(kappa)
    assert (keypoint.n_kappas, keypoint.stability) == (3, 1.0)
    assert tables.occurrence["detected"].tolist() == [1, 1, 1]
    assert tables.counts["n_common"].tolist() == [1, 1, 1]


def test_range_of_the_largest_and_the_smallest_ratio():
    low, high = common_normalised_scales(KAPPAS, 1.1)
    rows = [(kappa, 20.0, 20.0, scale / kappa**0.5, 1)
            for kappa in KAPPAS for scale in (low * 0.999, low * 1.001, high * 0.999, high * 1.001)]  # fmt: skip
    table = pd.DataFrame(rows, columns=["kappa", "y", "x", "sigma", "sign"])
    tables = kappa_tables(table, KAPPAS, 15, 1.1, (41, 41), 3.0, SAME)
    assert tables.counts["n_common"].tolist() == [2, 2, 2]
    empty = kappa_tables(table[:0], KAPPAS, 15, 1.1, (41, 41), 3.0, SAME)
    assert empty.counts["n_common"].tolist() == [0, 0, 0] and empty.keypoints.empty


@pytest.mark.parametrize("ratio", [2.0, 10.0])
def test_edge_filter_is_the_ratio_of_principal_curvatures(ratio):
    rng = np.random.default_rng(3)
    curvature = np.column_stack([np.ones(200), rng.uniform(-0.5, 1.5, 200)])
    angle = rng.uniform(0, math.pi, 200)
    cos, sin = np.cos(angle), np.sin(angle)
    a, b = curvature.T
    table = pd.DataFrame(
        {
            "value": 1.0,
            "h_yy": a * cos**2 + b * sin**2,
            "h_xx": a * sin**2 + b * cos**2,
            "h_yx": (a - b) * cos * sin,
        }
    )
    expected = (b > 0) & (np.maximum(a / np.maximum(b, 1e-9), b / a) < ratio)
    assert passes_filters(table, 0.0, ratio).tolist() == expected.tolist()
    assert passes_filters(table, 0.0, math.inf).tolist() == (b > 0).tolist()


def test_contrast_filter_and_its_limits():
    table = pd.DataFrame({"value": [-0.03, 0.029], "h_yy": 1.0, "h_xx": 1.0, "h_yx": 0.0})
    assert passes_filters(table).tolist() == [True, False]
    for wrong in ({"contrast": -1.0}, {"edge_ratio": 0.5}, {"contrast": math.nan}):
        with pytest.raises(InputError, match="change it"):
            passes_filters(table, **wrong)


def test_an_isotropic_structure_passes_the_smallest_ratio_and_no_contrast_fails():
    def table(h_yy, h_xx, h_yx=0.0, value=1.0):
        return pd.DataFrame({"h_yy": [h_yy], "h_xx": [h_xx], "h_yx": [h_yx], "value": [value]})

    for h_yy, h_xx in ((2.0, 3.0), (3.0, 2.0), (-2.0, -3.0)):
        assert not passes_filters(table(h_yy, h_xx), 0.0, 1.0 + 1e-9).any()
        assert passes_filters(table(h_yy, h_xx), 0.0, 1.6).all()
    assert not passes_filters(table(2.0, -2.0), 0.0, math.inf).any()  # a saddle
    assert not passes_filters(table(1.0, 1.0, 1.0), 0.0, math.inf).any()  # a ridge
    for sign in (1, -1):  # the sign of an extremum does not decide, and h_yx neither
        for h_yx in (0.5, -0.5):
            assert passes_filters(table(1.0, 1.0, h_yx, sign), 0.5, 4.0).all()
            assert not passes_filters(table(1.0, 1.0, h_yx, sign), 0.5, 2.9).any()  # (1.5 / 0.5)
