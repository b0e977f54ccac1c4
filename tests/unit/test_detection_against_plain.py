"""The fast detector finds what the plain one finds, extremum by extremum."""

import math

import numpy as np
import plain_detector as plain
import pytest
from scenes import blobs

from keystab.detection import extrema, refinement
from keystab.detection.detector import detect_keypoints, extrema_table
from keystab.scalespace.dog import scale_space
from keystab.scalespace.sampling import balanced_delta

KAPPA = 2 ** (1 / 3)

# n_spo, delta_min (None: balanced), camera blur, sigma_min: the paper's, SIFT's, strongly
# unbalanced ones in both directions, and a first Gaussian that is not the identity.
SAMPLINGS = [
    (3, None, 1.1, 1.1),
    (3, 0.5, 0.5, 0.8),
    (3, 0.12, 1.1, 1.1),
    (5, 0.37, 0.6, 1.1),
    (8, 0.5094, 1.1, 1.1),
    (15, 0.25, 1.1, 1.1),
    (7, None, 0.3, 1.0),
]

EPSILONS = [0.0, 1.19e-7, 1e-5]


@pytest.fixture(scope="module")
def texture():
    return blobs((44, 52), seed=2015)


@pytest.fixture(scope="module")
def plain_spaces(texture):
    spaces = {}
    for n_spo, delta_min, blur, sigma_min in SAMPLINGS:
        delta = balanced_delta(n_spo, KAPPA, sigma_min) if delta_min is None else delta_min
        spaces[n_spo, delta_min, blur, sigma_min] = plain.dct_scale_space(
            texture, blur, n_spo, delta, sigma_min, KAPPA
        )
    return spaces


@pytest.fixture(scope="module")
def plain_extrema(plain_spaces):
    return {
        (sampling, epsilon): {place for place, margin in found.items() if margin > epsilon}
        for sampling, dog in plain_spaces.items()
        for found in [plain.margins(dog)]
        for epsilon in EPSILONS
    }


@pytest.mark.parametrize("sampling", SAMPLINGS, ids=str)
def test_samples_are_those_of_the_cosine_transform(texture, plain_spaces, sampling):
    n_spo, delta_min, blur, sigma_min = sampling
    space = scale_space(texture, blur, n_spo, delta_min, sigma_min)
    dog = plain_spaces[sampling]
    assert space.shape == dog.shape
    # Rounding of two sums of products of values in [0, 1].
    np.testing.assert_allclose(space.window(), dog, rtol=0, atol=4e-15)


@pytest.mark.parametrize("epsilon", EPSILONS)
@pytest.mark.parametrize("sampling", SAMPLINGS, ids=str)
def test_the_same_discrete_extrema(texture, plain_extrema, sampling, epsilon):
    n_spo, delta_min, blur, sigma_min = sampling
    space = scale_space(texture, blur, n_spo, delta_min, sigma_min)
    found = extrema.discrete_extrema(space, epsilon)
    expected = plain_extrema[sampling, epsilon]
    assert {tuple(map(int, row)) for row in found} == expected
    assert len(found) == len(expected) > 3


@pytest.mark.parametrize("move", refinement.MOVES)
@pytest.mark.parametrize("scale_moves", [True, False])
@pytest.mark.parametrize(("max_offset", "max_iterations"), [(0.6, 2), (0.5, 5), (1.0, 1)])
@pytest.mark.parametrize("sampling", SAMPLINGS[:5], ids=str)
def test_the_same_refined_keypoints(
    texture, plain_spaces, plain_extrema, sampling, max_offset, max_iterations, scale_moves, move
):
    n_spo, delta_min, blur, sigma_min = sampling
    dog = plain_spaces[sampling]
    delta = balanced_delta(n_spo, KAPPA, sigma_min) if delta_min is None else delta_min
    expected = []
    for s, i, j, sign in sorted(plain_extrema[sampling, 0.0]):
        point = plain.refine(dog, s, i, j, max_offset, max_iterations, scale_moves, move)
        if point is not None:
            sigma = sigma_min * 2 ** (point[0] / n_spo)
            expected.append((point[1] * delta, point[2] * delta, sigma, point[3], sign))
    found = detect_keypoints(
        texture,
        blur,
        n_spo,
        delta_min,
        sigma_min,
        max_offset=max_offset,
        max_iterations=max_iterations,
        scale_moves=scale_moves,
        move=move,
    )
    assert len(found) == len(expected) > 5
    # Offsets divide rounding errors of 1e-15 by second differences of 1e-5 and more.
    np.testing.assert_allclose(
        found[["y", "x", "sigma", "value", "sign"]], np.array(expected), rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_neighbourhoods_are_windows(texture, oversampling):
    space = scale_space(texture, 0.6, 5, 0.37, oversampling=oversampling)
    window = space.window()
    rng = np.random.default_rng(4)
    s, i, j = (rng.integers(1, n - 1, 40) for n in space.shape)
    cubes = space.neighbourhoods(s, i, j)
    for k in range(40):
        box = tuple(slice(c - 1, c + 2) for c in (s[k], i[k], j[k]))
        np.testing.assert_allclose(cubes[k], window[box], rtol=0, atol=4e-15)


def test_each_neighbourhood_is_evaluated_by_itself(texture):
    space = scale_space(texture, 1.1, 8)
    table = extrema_table(space, extrema.discrete_extrema(space))
    alone = extrema_table(space, extrema.discrete_extrema(space)[4:5])
    assert alone.equals(table.iloc[4:5].reset_index(drop=True))


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_blocks_bands_and_threads_do_not_matter(texture, oversampling, monkeypatch):
    whole = detect_keypoints(texture, 1.1, 8, oversampling=oversampling)
    monkeypatch.setattr(extrema, "BLOCK_ROWS", 7)
    monkeypatch.setattr(extrema, "BLOCK_COLUMNS", 19)
    monkeypatch.setattr(extrema, "BAND_ROWS", 23)
    cut = detect_keypoints(texture, 1.1, 8, oversampling=oversampling, threads=3)
    assert cut.equals(whole)
    assert len(whole) > 5


def test_unlimited_refinement_accepts_every_regular_model(texture):
    first = detect_keypoints(texture, 1.1, 5, max_offset=math.inf, max_iterations=math.inf)
    discrete = detect_keypoints(texture, 1.1, 5, refine=False)
    assert len(first) == len(discrete)
    assert (first["models"] == 1).all()


def test_candidates_are_decided_one_by_one(texture):
    space = scale_space(texture, 1.1, 8)
    found = extrema.discrete_extrema(space)
    beside = found + [0, 0, 1, 0]
    candidates = np.concatenate([beside, found * [1, 1, 1, 0]])
    decided, _ = extrema.decided(space, candidates, space.rounding)
    np.testing.assert_array_equal(decided, found)


@pytest.mark.parametrize("n_spo", [4, 15])  # evaluated everywhere, and interpolated
@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_cubes_threads_and_bands_change_no_digit(oversampling, n_spo, monkeypatch):
    image = np.random.default_rng(8).standard_normal((90, 120))
    space = scale_space(image, 0.3, n_spo, oversampling=oversampling)
    rows, columns = space.shape[1:]
    window = (slice(rows // 9, rows - 5), slice(7, columns // 2))
    found, cubes = extrema.extrema_and_cubes(space, threads=2, window=window)
    np.testing.assert_array_equal(found, extrema.discrete_extrema(space, window=window))
    assert len(found) > 5
    np.testing.assert_array_equal(cubes, space.neighbourhoods(*found[:, :3].T))
    assert extrema_table(space, found, cubes).equals(extrema_table(space, found))
    monkeypatch.setattr(extrema, "BAND_ROWS", 100)
    np.testing.assert_array_equal(found, extrema.discrete_extrema(space, window=window))


NEIGHBOURS = [it for it in np.ndindex(3, 3, 3) if it != (1, 1, 1)]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("epsilon", [0.0, 1.0])
def test_an_extremum_differs_by_more_than_epsilon_from_each_neighbour(sign, epsilon):
    for place in NEIGHBOURS:
        for gap in (epsilon, 1.005 * epsilon + 0.005):
            samples = np.zeros((3, 3, 3))
            samples[1, 1, 1] = 2.0 * sign
            samples[place] = (2.0 - gap) * sign
            found = extrema.extrema_of_array(samples, epsilon, (10, 20)).tolist()
            assert found == ([[1, 11, 21, sign]] if gap > epsilon else []), place


def test_extrema_keep_their_places_where_axes_swap_or_turn_around():
    # An array of three sizes: no axis can be taken for another.
    samples = np.random.default_rng(5).integers(0, 40, (6, 9, 14)).astype(float)  # with ties
    plain = {tuple(it) for it in extrema.extrema_of_array(samples, 0.0)}
    turned = extrema.extrema_of_array(np.ascontiguousarray(samples.transpose(0, 2, 1)), 0.0)
    assert len(plain) > 15 and {(s, x, y, sign) for s, y, x, sign in turned.tolist()} == plain
    for axis in range(3):
        mirrored = extrema.extrema_of_array(np.ascontiguousarray(np.flip(samples, axis)), 0.0)
        mirrored[:, axis] = samples.shape[axis] - 1 - mirrored[:, axis]
        assert {tuple(it) for it in mirrored} == plain
    negated = extrema.extrema_of_array(-samples, 0.0) * [1, 1, 1, -1]
    assert {tuple(it) for it in negated} == plain


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_a_window_holds_the_extrema_of_its_samples_from_its_first_to_before_its_last(oversampling):
    space = scale_space(blobs((30, 44), 3), 1.1, 8, oversampling=oversampling)
    whole = extrema.discrete_extrema(space)
    for s, y, x, sign in whole[:: max(1, len(whole) // 6)].tolist():
        found = [
            [s, y, x, sign] in extrema.discrete_extrema(space, window=window).tolist()
            for window in (
                (slice(y, y + 1), slice(x, x + 1)),
                (slice(y + 1, y + 9), slice(x, x + 9)),
                (slice(y, y + 9), slice(x + 1, x + 9)),
                (slice(max(y - 9, 0), y), slice(x, x + 1)),
                (slice(y, y + 1), slice(max(x - 9, 0), x)),
            )
        ]
        assert found == [True, False, False, False, False]
    empty = (slice(20, 20), slice(0, 40))
    assert extrema.discrete_extrema(space, window=empty).shape == (0, 4)
