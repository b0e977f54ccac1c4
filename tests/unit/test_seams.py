"""Which octave reports an extremum at their seam, and which samples a refinement asks."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import blobs

from keystab.detection.detector import extrema_table, without_seams
from keystab.detection.extrema import extrema_and_cubes
from keystab.detection.refinement import trace
from keystab.scalespace.dog import scale_space

# Seams of octaves, by hand: sigma_min = 1 and n_spo = 3, so that the seam is at 2^(7/6) pixels.

SEAM = 2.0 ** (1 + 1 / 6)


def at_seam(*rows, step):
    """Detections of an octave: (s, y, x, scale, sign)."""
    columns = zip(("s", "y", "x", "scale", "sign"), np.array(rows, dtype=float).T, strict=True)
    return {**dict(columns), "step": np.full(len(rows), step)}


def kept(finer, coarser):
    return [it.tolist() for it in without_seams([finer, coarser], 3, 1.0)]


@pytest.mark.parametrize("axis", [1, 2])
def test_two_finer_detections_beside_one_coarser_are_one_and_another(axis):
    # Nearest on both sides alone are one extremum; the other has no counterpart, and stays.
    for near, far in ((0, 1), (1, 0)):
        rows = [[3, 10.0, 20.0, 0.99 * SEAM, 1], [3, 10.0, 20.0, 0.99 * SEAM, 1]]
        rows[near][axis] += 0.2
        rows[far][axis] += 0.9
        coarser = at_seam((1, 10.0, 20.0, 1.01 * SEAM, 1), step=1.0)
        finer, its = kept(at_seam(*rows, step=0.5), coarser)
        assert finer == [True, True] and its == [False]  # below the seam the finer octave has it
        for row in rows:
            row[3] = 1.001 * SEAM
        finer, its = kept(at_seam(*rows, step=0.5), coarser)
        assert finer[near] is False and finer[far] is True and its == [True]


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("way", [1, -1])
def test_what_is_one_extremum_at_a_seam_lies_within_a_coarse_sample_and_a_half(axis, way):
    for gap, one in ((1.5, True), (1.5 + 1e-6, False)):
        row = [1, 8.0, 16.0, SEAM, 1]
        row[axis] += way * gap * 2.0
        finer, coarser = kept(
            at_seam((3, 8.0, 16.0, 0.99 * SEAM, 1), step=1.0), at_seam(row, step=2.0)
        )
        assert (finer, coarser) == ([True], [not one])


def test_what_is_one_extremum_at_a_seam_lies_within_a_step_of_scale_and_has_its_sign():
    for ratio, sign, one in (
        (2 ** (0.999 / 3), 1, True), (2 ** (-0.999 / 3), 1, True), (2 ** (1.001 / 3), 1, False),
        (2 ** (-1.001 / 3), 1, False), (1.0, -1, False),
    ):  # fmt: skip
        scale = 0.99 * SEAM
        _, coarser = kept(
            at_seam((3, 8.0, 16.0, scale, 1), step=1.0),
            at_seam((1, 8.0, 16.0, scale * ratio, sign), step=2.0),
        )
        assert coarser == [not one]


def test_the_slice_below_and_above_an_octave_belong_to_its_neighbours():
    scales = [1.0, 1.3, 1.6, 2.0, 2.3]
    rows = [(s, 10.0 * s, 5.0, scales[s], 1) for s in range(5)]
    far = [(s, 500.0 + 10.0 * s, 5.0, 2 * scales[s], 1) for s in range(5)]
    finer, coarser = kept(at_seam(*rows, step=0.5), at_seam(*far, step=1.0))
    # n_spo = 3: slices 1 to 3 are its own, 0 is that of the octave before, 4 that of the next.
    assert finer == [True, True, True, True, False]  # before the first there is none
    assert coarser == [False, True, True, True, True]  # nor behind the last


def test_a_seam_goes_to_the_finer_octave_below_it_and_else_to_the_coarser():
    for scale, below in ((SEAM * (1 - 1e-9), True), (SEAM, False), (SEAM * (1 + 1e-9), False)):
        finer, coarser = kept(
            at_seam((3, 8.0, 16.0, scale, 1), step=1.0), at_seam((1, 8.0, 16.0, scale, 1), step=2.0)
        )
        assert (finer, coarser) == ([below], [not below])


def test_a_refinement_never_asks_the_same_sample_twice():
    space = scale_space(blobs((30, 44), 4), 1.1, 5)
    found = extrema_table(space, *extrema_and_cubes(space))
    for move in ("nearest", "unit_step"):
        for scale_moves in (True, False):
            models = trace(space, found, 0.1, move, scale_moves, 30)
            assert not models.duplicated(["keypoint", "s", "row", "column"]).any()
            first = models[models["model"] == 1]
            assert len(first) == len(found) < len(models)
            numbers = models.groupby("keypoint")["model"]
            assert (numbers.max() == numbers.count()).all()  # 1, 2, ... without a gap
            if not scale_moves:
                assert (models.groupby("keypoint")["s"].nunique() == 1).all()
