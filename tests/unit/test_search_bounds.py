"""Every bound of the search by itself, against all samples or all numbers that it speaks of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import blobs

from keystab.detection import extrema, search_cells, search_expansion, search_hulls
from keystab.detection.search_cosine import KNOTS, missed_by_splines
from keystab.detection.search_expansion import slack_of
from keystab.detection.search_field import field_of
from keystab.detection.search_functionals import expansion, functionals, hermite
from keystab.detection.search_hulls import CELLS, MARGIN, NODES, PAIR
from keystab.detection.search_lattice import LatticeSearch
from keystab.detection.search_norms import Mixes, spline_norms
from keystab.detection.search_records import BLOCK, LANES, SINGLE_ROUNDING, STENCIL
from keystab.scalespace.dog import scale_space
from keystab.scalespace.spline_axis import fill_rows


def rows_of(axis, blur: int, samples: np.ndarray) -> np.ndarray:
    """Rows of samples with all their columns."""
    full = np.zeros((samples.size, axis.n_columns))
    for row, sample in zip(full, samples, strict=True):
        entries = np.zeros((1, axis.n_columns))
        first, width = fill_rows(axis.rows, blur, axis.first + axis.stride * sample, 1, entries)
        row[first : first + width] = entries[0, :width]
    return full


def kinks_of(rows: np.ndarray) -> np.ndarray:
    """Weights of fourth differences, those of columns i .. i + 4 at i, that make up rows.

    From the nearer end each, so that little rounding is added up.
    """
    left, right = rows, rows[..., ::-1]
    for _ in range(4):
        left, right = np.cumsum(left, axis=-1), np.cumsum(right, axis=-1)
    right = right[..., ::-1][..., 4:]
    middle = rows.shape[-1] // 2
    return np.concatenate([left[..., :middle], right[..., middle:]], axis=-1)


def view(kind: str, shape: tuple[int, int], seed: int) -> np.ndarray:
    """Pictures of up to 16 bits, and parts in which nothing varies."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]]
    if kind == "noise":
        return rng.random(shape)
    if kind == "16 bits":
        return rng.integers(0, 2**16, shape).astype(float)
    if kind == "edge":
        return 65535.0 * (np.cos(seed) * (y - 17) + np.sin(seed) * (x - 18) > 0)
    image = blobs(shape, seed)
    if kind == "flat area":
        image[: shape[0] // 2] = 0.5
    return image


# Slopes of polynomials, and what proves that samples rise or fall.


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize(("n_spo", "p"), [(15, 4), (9, 2)])
def test_norms_are_the_sums_over_all_kinks(n_spo, p, oversampling):
    # A functional of samples that vanishes for cubic polynomials is a sum of fourth differences of
    # the source, whose weights are its own entries, added up four times.
    space = scale_space(np.zeros((120, 120)), 1.1, n_spo, oversampling=oversampling)
    field, parts = field_of(space, p), functionals(p)
    axis, mixes = field.axes[0], Mixes.of(field.blurs.size, field.lower, field.upper)
    radii = np.array([4.0, 9.0, 16.0])
    norms = spline_norms(axis, field.delta, p, mixes, radii)
    begin = space.shape[1] // (2 * p) * p
    largest = np.zeros((4, mixes.plus.size, radii.size + 1))
    for cell in range(begin, begin + 12 * p, p):
        samples = cell + parts.begin + np.arange(parts.value.shape[1])
        rows = np.stack([rows_of(axis, blur, samples) for blur in range(field.blurs.size)])
        mixed = mixes.taps(rows.reshape(len(rows), -1)).reshape(-1, *rows.shape[1:])
        knot = np.arange(axis.n_columns - 4) - axis.before
        middle = (cell + p / 2) * field.step
        each = parts.value, parts.step, parts.wide, parts.wide_step
        for kind, weights in zip(largest, each, strict=True):
            kinks = np.abs(kinks_of(weights @ mixed))
            kind[:, 0] = np.maximum(kind[:, 0], kinks.sum(axis=2).max(axis=1))
            for k, radius in enumerate(radii):
                # The weight of the difference of columns i .. i + 4 stands at i, its middle at i+2.
                outside = np.abs(knot + 2 - middle) > radius + p * field.step
                seen = kinks[:, :, outside].sum(axis=2).max(axis=1)
                kind[:, k + 1] = np.maximum(kind[:, k + 1], seen)
    for kind, found in zip(
        largest, (norms.value, norms.step, norms.wide, norms.wide_step), strict=True
    ):
        kind = kind[: len(found)]
        assert (kind <= found * (1 + 1e-6) + 1e-12).all()
        # Attained by some, so that half of them would not do.
        assert (kind[:, 0] > 0.95 * found[:, 0]).any()
        assert (kind[:, 1] > np.maximum(0.45 * found[:, 1], 1e-12)).any()


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(["noise", "16 bits", "edge", "flat area", "blobs"]),
    st.integers(0, 1000),
    st.sampled_from([(15, 4), (15, 3), (9, 2)]),
    st.sampled_from(["spline", "cosine"]),
)
def test_samples_are_as_near_to_polynomials_as_bounds_say(kind, seed, sampling, oversampling):
    n_spo, p = sampling
    image = view(kind, (34, 36), seed)
    space = scale_space(image, 1.1, n_spo, oversampling=oversampling)
    search = LatticeSearch(space, space.rounding, extrema.inner_window(space), p=p)
    field, n = search.field, space.shape[0]
    amplitude = float(np.abs(field.source).max())
    n_y, n_x = ((size - 1) // p for size in space.shape[1:])
    bounds = search.bounds.of(0, 0, -(-n_x // BLOCK), amplitude, 0.0)
    column = np.zeros((bounds.off.size, CELLS // BLOCK), dtype=np.float32)
    dog = space.window()
    narrow, wide = hermite(p), expansion(p)
    for i in range(3, min(n_y, CELLS) - 4, 3):
        for j in range(3, n_x - 4, 5):
            search_cells._bounds_of_column(bounds, j // BLOCK, column)
            bound = column[:, i // BLOCK]
            y, x = p * i, p * j
            nodes = dog[:, y - 2 * p : y + 3 * p + 1 : p, x - 2 * p : x + 3 * p + 1 : p]
            off = narrow @ nodes @ narrow.T - dog[:, y : y + p + 1, x : x + p + 1]
            assert (p * np.abs(np.diff(off, axis=1)).max(axis=(1, 2)) <= bound[:n]).all()
            assert (p * np.abs(np.diff(off, axis=2)).max(axis=(1, 2)) <= bound[n : 2 * n]).all()
            steps = np.abs(np.diff(off, axis=0)).max(axis=(1, 2))
            assert (steps <= bound[2 * n : 3 * n - 1]).all()
            nodes = dog[:, y - 3 * p : y + 4 * p + 1 : p, x - 3 * p : x + 4 * p + 1 : p]
            off = wide @ nodes @ wide.T - dog[:, y - 1 : y + p + 2, x - 1 : x + p + 2]
            assert (np.abs(np.diff(off, axis=1)).max(axis=(1, 2)) <= bound[3 * n : 4 * n]).all()
            assert (np.abs(np.diff(off, axis=2)).max(axis=(1, 2)) <= bound[4 * n : 5 * n]).all()
            steps = np.abs(np.diff(off, axis=0)).max(axis=(1, 2))
            assert (steps <= bound[5 * n : 6 * n - 1]).all()


@pytest.mark.parametrize("k", [3, 10, 19])
def test_a_spline_is_as_near_to_a_cosine_series_as_is_said(k):
    # One frequency alone: at some samples its images all add up.
    n = 20
    image = np.cos(np.pi * k / n * (np.arange(n) + 0.5)) * np.ones((n, 1))
    space = scale_space(image, 1.1, 15, oversampling="cosine")
    field = field_of(space, 4)
    said = missed_by_splines(space.source, space.blurs[0], field.axes, field.delta / KNOTS)
    series = np.cos(np.pi * k / n * (space.x + 0.5))
    off = []
    for blur, sigma in enumerate(space.blurs[0]):
        along = rows_of(field.axes[0], blur, np.array([60])) @ field.source
        seen = along @ rows_of(field.axes[1], blur, np.arange(space.shape[2])).T
        off.append(np.abs(seen - np.exp(-0.5 * (sigma * np.pi * k / n) ** 2) * series).max())
    assert (off <= said).all()
    assert (off / said).max() > 0.8  # attained, so that half of it would not do


# Hulls.


def pair_of(nodes: np.ndarray) -> np.ndarray:
    """Both columns of nodes that bound cells, from six columns, shape (NODES, 6)."""
    pair = np.zeros(PAIR + 4 * NODES, dtype=np.float32)
    columns = [np.ascontiguousarray(column, dtype=np.float32) for column in nodes.T]
    search_hulls.advance(pair[4 * NODES :], *columns[1:])
    pair[: 4 * NODES] = pair[8 * NODES :]
    search_hulls.advance(pair, *columns[1:])
    left = np.zeros_like(pair)
    search_hulls.advance(left, *columns[:-1])
    pair[: 4 * NODES] = left[4 * NODES : 8 * NODES]
    return pair[:PAIR]


def polynomials(nodes: np.ndarray, p: int) -> np.ndarray:
    """Polynomials of Hermite at all samples of the cells, shape (CELLS, p + 1, p + 1)."""
    weights = hermite(p)
    single = nodes.astype(np.float32).astype(float)
    cells = [single[MARGIN + k - 2 : MARGIN + k + 4] for k in range(CELLS)]
    return np.stack([weights @ cell @ weights.T for cell in cells])


def single(values: np.ndarray) -> float:
    """Rounding of slopes and sums in single precision."""
    return 100 * SINGLE_ROUNDING * float(np.abs(values).max())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.floats(0.0, 3.0))
def test_cells_are_excluded_where_samples_rise_or_fall_by_enough(seed, p, slope):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:NODES, :6]
    nodes = slope * (np.cos(seed) * y + np.sin(seed) * x) + rng.standard_normal((NODES, 6))
    least = np.repeat(np.abs(rng.standard_normal(2)), CELLS).astype(np.float32)
    alive = np.zeros(CELLS, dtype=np.bool_)
    search_hulls.may_turn(pair_of(nodes), least, alive)
    cells = polynomials(nodes, p)
    for k in np.flatnonzero(~alive):
        along_y, along_x = (p * np.diff(cells[k], axis=axis) for axis in (0, 1))
        rises = [
            each.min() > enough - single(nodes) or each.max() < -enough + single(nodes)
            for each, enough in ((along_y, least[0]), (along_x, least[-1]))
        ]
        assert any(rises)


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_plane_is_excluded_just_beyond_the_bound(along, sign):
    plane = sign * np.mgrid[:NODES, :6][along].astype(float)
    alive = np.zeros(CELLS, dtype=np.bool_)
    for least, stays in ((0.999, False), (1.001, True)):
        search_hulls.may_turn(pair_of(plane), np.full(2 * CELLS, least, dtype=np.float32), alive)
        assert (alive == stays).all()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6))
def test_differences_of_slices_lie_between_their_coefficients(seed, p):
    rng = np.random.default_rng(seed)
    finer, coarser = rng.standard_normal((2, NODES, 6))
    span = np.zeros(2 * CELLS, dtype=np.float32)
    search_hulls.range_of_difference(pair_of(finer), pair_of(coarser), span)
    cells = polynomials(coarser, p) - polynomials(finer, p)
    assert (cells.min(axis=(1, 2)) >= span[:CELLS] - single(cells)).all()
    assert (cells.max(axis=(1, 2)) <= span[CELLS:] + single(cells)).all()
    # Means of coefficients, so that these lie not far outside.
    size = np.ptp(cells, axis=(1, 2))
    assert np.median((span[CELLS:] - span[:CELLS]) / size) < 1.6


# Single precision.


@given(
    st.floats(0, 1e-2), st.floats(0, 1e-2), st.floats(-1, 1), st.floats(1e-6, 1e-2), st.booleans()
)
def test_slack_hides_nothing_that_errors_can_explain(tolerance, off, value, more, least):
    exact = tolerance + more * (tolerance + off + 1e-3)  # a difference that counts
    seen = exact - off if least else exact + off
    single_value, other = np.float32(value), np.float32(np.float32(value) - np.float32(seen))
    # As loops compare: a rounding of the value counts as part of `off` there.
    rounding = 2 * SINGLE_ROUNDING * (abs(value) + seen)
    assert float(other) < float(single_value) - float(slack_of(tolerance, off)) + rounding
    assert slack_of(tolerance, off) < tolerance - off


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6))
def test_expanded_samples_are_rounded_by_less_than_is_allowed_for(seed, p):
    nodes = np.sign(np.random.default_rng(seed).standard_normal((STENCIL, STENCIL, LANES)))
    weights = expansion(p)
    half = np.zeros((STENCIL, p + 3, LANES), dtype=np.float32)
    out = np.zeros((p + 3, p + 3, LANES), dtype=np.float32)
    search_expansion._expand(nodes.astype(np.float32), weights.astype(np.float32), half, out)
    exact = np.einsum("rm,cn,nmx->rcx", weights, weights, nodes)
    off = np.abs(out - exact).max()
    assert 0 < off < search_expansion._EXPANSION * SINGLE_ROUNDING


# Bounds exclude.


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_most_cells_of_a_smooth_picture_are_excluded(oversampling):
    # Where more than half of a tile is expanded it is left over: nothing is, and few samples of
    # those expanded are candidates.
    image = blobs((60, 70), 3)
    for n_spo, p in ((15, 4), (11, 3), (8, 2)):
        space = scale_space(image, 1.1, n_spo, oversampling=oversampling)
        search = LatticeSearch(space, space.rounding, extrema.inner_window(space), p=p)
        found = [search.candidates(part) for part in search.parts]
        assert not any(regions for _, regions in found)
        candidates = np.unique(np.concatenate([some for some, _ in found]), axis=0)
        assert len(candidates) < 4 * len(extrema.discrete_extrema(space)) + 20
