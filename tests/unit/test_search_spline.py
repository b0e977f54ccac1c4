"""The search from few samples finds what the search of all samples finds, and its bound holds."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import blobs

from keystab.detection import extrema, search_cosine, search_spline
from keystab.detection.search_cosine import BandLimitedSearch
from keystab.detection.search_rows import axis_blocks
from keystab.detection.search_scan import scan
from keystab.detection.search_spline import InterpolatedSearch, applies, expansion
from keystab.scalespace.dog import scale_space


def both(image, n_spo, epsilon=0.0, camera_blur=1.1, **options):
    """Extrema of the two searches."""
    space = scale_space(image, camera_blur, n_spo, **options)
    assert applies(space) or search_cosine.applies(space)
    with (
        patch.object(search_spline, "applies", return_value=False),
        patch.object(search_cosine, "applies", return_value=False),
    ):
        dense = extrema.discrete_extrema(space, epsilon)
    return extrema.discrete_extrema(space, epsilon), dense


def scene(kind: str) -> np.ndarray:
    rng = np.random.default_rng(5)
    image = blobs((31, 43), 1)
    if kind == "noise":
        return rng.random((31, 43))
    if kind == "faint":
        return 0.5 + 1e-9 * image
    if kind == "edge":
        return (np.add.outer(np.arange(31), 2 * np.arange(43)) > 55).astype(float)
    if kind == "flat and strong":
        image[:, 20:] = 0.3
        image[12:, 30:] = 0.3 + 1e-4 * image[12:, :13]
    return image


@pytest.mark.parametrize("kind", ["blobs", "noise", "faint", "edge", "flat and strong"])
@pytest.mark.parametrize("n_spo", [12, 15])
@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_every_extremum_is_found(kind, n_spo, oversampling):
    found, dense = both(scene(kind), n_spo, oversampling=oversampling)
    assert found.tolist() == dense.tolist()
    assert len(dense) > (7 if kind == "blobs" else -1)


@pytest.mark.parametrize(
    "options",
    [
        {"epsilon": 1.19e-7},
        {"epsilon": 1e-5},
        {"kappa": 2**0.5},
        {"kappa": 2 ** (1 / 30)},
        {"camera_blur": 0.3},
        {"octave": 1, "slices": (-1, 17)},
        {"sigma_min": 1.4},
        {"delta_min": 0.06},
    ],
    ids=str,
)
@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_whatever_the_sampling(options, oversampling):
    found, dense = both(blobs((58, 63), 2), 15, oversampling=oversampling, **options)
    assert found.tolist() == dense.tolist()
    assert len(dense) > 5


@settings(max_examples=4, deadline=None)
@given(
    st.integers(0, 10**6),
    st.integers(26, 40),
    st.integers(26, 40),
    st.sampled_from(["spline", "cosine"]),
)
def test_whatever_the_picture(seed, height, width, oversampling):
    found, dense = both(blobs((height, width), seed), 14, oversampling=oversampling)
    assert found.tolist() == dense.tolist()


@pytest.mark.parametrize("factor", [1e39, 1e200])
@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_values_beyond_single_precision_have_the_same_extrema(factor, oversampling):
    image = blobs((31, 43), 1)
    found, beyond = (
        extrema.discrete_extrema(scale_space(scaled, 1.1, 12, oversampling=oversampling))
        for scaled in (image, factor * image)
    )
    np.testing.assert_array_equal(beyond, found)


@pytest.mark.parametrize(
    ("x", "errors", "kept"),
    [
        (3, (0.0, 3.5), True),  # its right neighbour lies in the worse block
        (4, (3.5, 0.0), True),
        (2, (0.0, 3.5), False),
        (5, (3.5, 0.0), False),
    ],
)
def test_candidates_are_held_to_the_errors_of_the_blocks_they_touch(x, errors, kept):
    dog = np.zeros((3, 3, 8), dtype=np.float32)
    dog[0], dog[2] = -100.0, 100.0  # grows with scale, so that nothing else is extremal
    dog[2, :, x - 1 : x + 2] = -100.0
    dog[1, 1, x] = 50.0
    dog[0, 1, x] = 51.9  # above it, as is possible where both are off by 3.5 and need differ by 5
    found = np.empty((4, 4), dtype=np.int64)
    assert scan(dog, np.array([errors] * 3), 5.0, 0, 0, found) == kept


@pytest.mark.parametrize("off", [1e-4, 1e-7])
def test_the_margin_of_a_comparison_is_on_the_safe_side(off):
    # Errors above the tolerance: a candidate may fall short of its neighbours.
    short = np.float32(2 * off - 1e-30)
    dog = np.full((3, 3, 3), short, dtype=np.float32)
    dog[1, 1, 1] = 0.0
    assert scan(dog, np.full((3, 1), off), 0.0, 0, 0, np.empty((4, 4), dtype=np.int64)) == 1


def test_a_constant_picture_has_none():
    found, dense = both(np.full((30, 30), 0.7), 15)
    assert len(found) == len(dense) == 0


@pytest.mark.parametrize("kind", ["blobs", "noise", "edge"])
@pytest.mark.parametrize("n_spo", [12, 15])
def test_the_bound_holds_and_is_no_mere_caution(kind, n_spo):
    space = scale_space(scene(kind), 1.1, n_spo)
    search = InterpolatedSearch(space, 0.0, *extrema.inner_window(space))
    blocks = [search.x_blocks(column) for column in range(search.n_columns)]
    bounds = [search.error_bounds(abreast) for abreast in blocks]
    lefts = np.concatenate([abreast.start for abreast in blocks])
    dog = space.window()
    nodes, expand = expansion(search.length)
    reached = 0.0
    for i, top in enumerate(search.y_blocks.start):
        for j, left in enumerate(lefts):
            box = dog[:, top : top + search.length, left : left + search.length]
            interpolated = expand @ box[:, nodes][:, :, nodes] @ expand.T
            off = np.abs(interpolated - box).max(axis=(1, 2))
            bound = bounds[j // search_spline._ABREAST][i, :, j % search_spline._ABREAST]
            assert (off <= bound + 1e-14).all()
            reached = max(reached, (off / bound)[:4].max())
    assert reached > 1e-3


@pytest.mark.parametrize("n_blocks", [1, 7, 12])
def test_rows_of_blocks_do_not_depend_on_the_threads_that_make_them(n_blocks):
    axis = scale_space(scene("blobs"), 1.1, 12).axes[0]
    starts = tuple(range(0, 5 * n_blocks, 5))
    for one, three in zip(
        axis_blocks(axis, starts, 26), axis_blocks(axis, starts, 26, threads=3), strict=True
    ):
        np.testing.assert_array_equal(one, three)


@pytest.mark.parametrize("kind", ["blobs", "noise", "edge"])
@pytest.mark.parametrize("n_spo", [12, 15])
def test_the_bound_of_band_limited_interpolation_holds(kind, n_spo):
    space = scale_space(scene(kind), 1.1, n_spo, oversampling="cosine")
    search = BandLimitedSearch(space, 0.0, *extrema.inner_window(space))
    dog = space.window()
    (y_nodes, along), (x_nodes, across) = (
        search_cosine.interpolation(length, space.sampling.step)
        for length in (search.length, search.abreast)
    )
    reached = 0.0
    for top in search.y_starts:
        for left in search.x_starts:
            box = dog[:, top : top + search.length, left : left + search.abreast]
            interpolated = along @ box[:, y_nodes][:, :, x_nodes] @ across.T
            off = np.abs(interpolated - box).max(axis=(1, 2))
            assert (off <= search.bounds + 1e-14).all()
            reached = max(reached, (off / search.bounds).max())
    assert reached > 1e-3


def test_blocks_with_too_many_candidates_are_evaluated(monkeypatch):
    monkeypatch.setattr(search_spline, "_KINKED", 0.0)  # slice 1 is then all candidates
    image = blobs((31, 43), 3)
    found, dense = both(image, 15)
    space = scale_space(image, 1.1, 15)
    search = InterpolatedSearch(space, 1e-14, *extrema.inner_window(space))
    assert any(search.candidates(column)[1] for column in range(search.n_columns))
    assert found.tolist() == dense.tolist()


def test_coarse_and_small_scale_spaces_are_not_interpolated():
    image = blobs((40, 40), 4)
    for oversampling, asked in (("spline", applies), ("cosine", search_cosine.applies)):
        assert asked(scale_space(image, 1.1, 15, oversampling=oversampling))
        assert not asked(scale_space(image, 1.1, 3, oversampling=oversampling))
        assert not asked(scale_space(image[:9, :9], 1.1, 15, oversampling=oversampling))


@pytest.mark.parametrize("n_spo", [5, 15])
@pytest.mark.parametrize(
    "part",
    [(0.2, 0.7, 0.1, 0.6), (-1.0, 2.0, 0.5, 3.0), (0.9, 1.0, 0.0, 1.0), (0.5, 0.5, 0.2, 0.9)],
)
def test_a_window_has_the_extrema_that_lie_in_it(n_spo, part):
    space = scale_space(blobs((34, 47), 3), 1.1, n_spo)
    rows, columns = (
        slice(int(first * size), int(last * size))
        for first, last, size in zip(part[::2], part[1::2], space.shape[1:], strict=True)
    )
    everywhere = extrema.discrete_extrema(space)
    inside = (everywhere[:, 1] >= rows.start) & (everywhere[:, 1] < rows.stop)
    inside &= (everywhere[:, 2] >= columns.start) & (everywhere[:, 2] < columns.stop)
    found = extrema.discrete_extrema(space, window=(rows, columns))
    assert found.tolist() == everywhere[inside].tolist()
    if part[1] - part[0] > 0.4:
        assert inside.any() and not inside.all()
