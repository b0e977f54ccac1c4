"""The search in single precision never loses what double precision decides."""

import numpy as np
import plain_detector as plain
import pytest
from scenes import blobs

from keystab import extrema
from keystab.dog_space import scale_space


@pytest.mark.parametrize("scale", [1.0, 1e-4, 255.0])
@pytest.mark.parametrize(("n_spo", "delta_min"), [(3, None), (12, None), (9, 0.5), (4, 0.1)])
def test_single_precision_errs_less_than_its_bound(n_spo, delta_min, scale):
    space = scale_space(scale * blobs((50, 70), seed=5), 1.1, n_spo, delta_min)
    rows = [(0, 40), (40, space.shape[1])]
    everything = (0, space.shape[2]), (0, space.shape[0])
    blocks = [space.axes[0].block(*part) for part in rows]
    double = np.concatenate([dog.copy() for dog in space.blocks(blocks, *everything)], axis=1)
    single = [block.as_type(np.float32) for block in blocks]
    rough = np.concatenate([dog.copy() for dog in space.blocks(single, *everything)], axis=1)
    assert rough.dtype == np.float32
    error = rough.astype(float) - double
    bound = space.error_bound(np.float32)
    # A difference of two samples errs by at most the spread of all errors.
    assert 0 < np.ptp(error) < bound
    assert bound < 1e-4 * np.abs(space.source).max()


def test_crowded_blocks_are_searched_in_double_precision(monkeypatch):
    image = np.full((60, 80), 0.3)
    image[:, :40] = blobs((60, 40), seed=9)
    space = scale_space(image, 1.1, 9)
    usual = extrema.discrete_extrema(space)
    windows = []
    evaluate = type(space).window

    def counted(self, **box):
        windows.append(box)
        return evaluate(self, **box)

    monkeypatch.setattr(type(space), "window", counted)
    monkeypatch.setattr(extrema, "CROWD", 0)
    np.testing.assert_array_equal(extrema.discrete_extrema(space), usual)
    assert windows and len(usual) > 10
    expected = plain.discrete_extrema(space.window(), space.rounding)
    assert {tuple(map(int, row)) for row in usual} == expected
