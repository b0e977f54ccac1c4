"""The search that looks where an extremum can be finds what the plain search of all samples finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import blobs

from keystab.detection import extrema, search_lattice
from keystab.detection.search_lattice import LatticeSearch, node_distance
from keystab.scalespace.dog import ScaleSpace, scale_space


def of_all(space: ScaleSpace, tolerance: float) -> np.ndarray:
    """Extrema among all samples."""
    likely = extrema.extrema_of_array(space.window(), tolerance - space.rounding_bounds.between)
    return extrema.decided(space, likely, tolerance)[0]


def of_few(space: ScaleSpace, tolerance: float, p: int | None = None) -> np.ndarray:
    """Extrema that the search finds with nodes p samples apart."""
    asked = extrema.inner_window(space)
    search = LatticeSearch(space, tolerance, asked, p=p)
    parts = [np.empty((0, 4), dtype=np.int64)]
    parts += [extrema._found_by(search, part) for part in search.parts]
    found = extrema.decided(space, np.concatenate(parts), tolerance)[0]
    return found[extrema.within(found, asked)]


def picture(kind: str, shape: tuple[int, int], seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]]
    if kind == "blobs":
        return blobs(shape, seed)
    if kind == "faint":
        return 0.5 + 1e-9 * blobs(shape, seed)
    if kind == "noise":
        return rng.random(shape)
    if kind == "edge":
        return (np.cos(seed) * (y - 11) + np.sin(seed) * (x - 12) > 0).astype(float)
    if kind == "text":
        letters = rng.random((-(-shape[0] // 4), -(-shape[1] // 3))) > 0.6
        return 65535.0 * np.kron(letters, np.ones((4, 3)))[: shape[0], : shape[1]]
    image = np.zeros(shape)
    if kind == "impulse":
        image[tuple(rng.integers(0, shape))] = 65535
    if kind == "rectangles":
        for value in rng.random(4):
            (top, bottom), (left, right) = (np.sort(rng.integers(0, n, 2)) for n in shape)
            image[top:bottom, left:right] = value
    if kind == "strong beside faint":
        image = 1e-4 * blobs(shape, seed)
        image[: shape[0] // 3] += blobs(shape, seed + 1)[: shape[0] // 3]
    return image


KINDS = [
    "blobs",
    "faint",
    "noise",
    "edge",
    "text",
    "impulse",
    "rectangles",
    "strong beside faint",
    "flat",
]


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(KINDS),
    st.integers(0, 10**6),
    st.integers(20, 36),
    st.integers(20, 36),
    st.integers(3, 19),
    st.sampled_from([0.0, 1.19e-7, 1e-5, 1e-3]),
    st.integers(1, 6),
    st.integers(0, 1),
    st.sampled_from(["spline", "cosine"]),
)
def test_whatever_the_picture(  # noqa: PLR0913
    kind, seed, height, width, n_spo, epsilon, p, octave, oversampling
):
    image = picture(kind, (height, width), seed)
    space = scale_space(image, 1.1, n_spo, octave=octave, oversampling=oversampling)
    tolerance = max(epsilon * np.ptp(image), space.rounding)
    p = max(1, min(p, min(space.shape[1:]) // 10))
    assert of_few(space, tolerance, p).tolist() == of_all(space, tolerance).tolist()


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("n_spo", range(3, 20))
def test_all_samplings(n_spo, oversampling):
    space = scale_space(blobs((26, 30), n_spo), 1.1, n_spo, oversampling=oversampling)
    plain = of_all(space, space.rounding)
    assert len(plain) > 3
    for p in {1, 1 + n_spo // 4}:
        assert of_few(space, space.rounding, p).tolist() == plain.tolist()


@pytest.mark.parametrize(
    "options",
    [
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
    options = {"camera_blur": 1.1, "n_spo": 15, "oversampling": oversampling} | options
    space = scale_space(blobs((33, 38), 2), **options)
    plain = of_all(space, space.rounding)
    assert of_few(space, space.rounding, 3).tolist() == plain.tolist()
    assert len(plain) > 0


def test_extrema_on_the_lines_between_cells_are_found():
    # Nodes at every p-th sample: extrema lie on rows and on columns of nodes, and on nodes.
    space = scale_space(blobs((60, 66), 7, density=0.06), 1.1, 9)
    plain = of_all(space, space.rounding)
    for p in (2, 3, 4):
        on_line = plain[:, 1:3] % p == 0
        assert on_line.any(axis=0).all() and on_line.all(axis=1).any()
        assert of_few(space, space.rounding, p).tolist() == plain.tolist()


@pytest.mark.parametrize("n_spo", [5, 15])
@pytest.mark.parametrize(
    "part",
    [(0.2, 0.7, 0.1, 0.6), (-1.0, 2.0, 0.5, 3.0), (0.9, 1.0, 0.0, 1.0), (0.5, 0.5, 0.2, 0.9)],
)
def test_a_window_has_the_extrema_that_lie_in_it(n_spo, part, monkeypatch):
    monkeypatch.setattr(search_lattice, "_FEW", 0.0)
    space = scale_space(blobs((34, 47), 3), 1.1, n_spo)
    rows, columns = (
        slice(int(first * size), int(last * size))
        for first, last, size in zip(part[::2], part[1::2], space.shape[1:], strict=True)
    )
    everywhere = extrema.discrete_extrema(space)
    inside = (everywhere[:, 1] >= rows.start) & (everywhere[:, 1] < rows.stop)
    inside &= (everywhere[:, 2] >= columns.start) & (everywhere[:, 2] < columns.stop)
    found = extrema.discrete_extrema(space, window=(rows, columns), threads=2)
    assert found.tolist() == everywhere[inside].tolist()
    if part[1] - part[0] > 0.4:
        assert inside.any() and not inside.all()


def test_many_candidates_are_left_to_an_evaluation_of_all():
    # So far from an impulse, samples differ by less than single precision of it.
    space = scale_space(picture("impulse", (24, 62), 0), 0.8, 9, sigma_min=1.6)
    search = LatticeSearch(space, space.rounding, extrema.inner_window(space))
    assert any(search.candidates(part)[1] for part in search.parts)
    assert of_few(space, space.rounding).tolist() == of_all(space, space.rounding).tolist()


def test_a_search_changes_nothing_that_samples_are_made_of():
    for n_spo in (3, 9):
        space = scale_space(blobs((24, 30), 1), 1.1, n_spo)
        before = space.window()
        LatticeSearch(space, 0.0, extrema.inner_window(space))
        np.testing.assert_array_equal(space.window(), before)


@pytest.mark.parametrize("factor", [1e29, 1e39, 1e200])
def test_values_beyond_single_precision_have_the_same_extrema(factor):
    image = blobs((31, 43), 1)
    found, beyond = (
        extrema.discrete_extrema(scale_space(scaled, 1.1, 9)) for scaled in (image, factor * image)
    )
    np.testing.assert_array_equal(beyond, found)
    assert len(found) > 5


def test_nodes_lie_further_apart_where_samples_are_finer():
    image = np.zeros((225, 400))
    distance = [node_distance(scale_space(image, 1.1, n)) for n in (3, 5, 9, 15, 19)]
    assert distance == sorted(distance) and distance[0] == 1 and distance[-1] > 3
    assert node_distance(scale_space(image[:9, :9], 1.1, 15)) == 1


def test_under_noise_nodes_move_together_where_little_else_is_left_over(monkeypatch):
    # In coarser octaves blur averages noise, which the bounds do not know.
    monkeypatch.setattr(search_lattice, "_FEW", 0.0)
    noise = 0.5 + 0.15 * np.random.default_rng(4).standard_normal((96, 120))
    for image, closer in ((blobs((96, 120), 5), False), (noise, True)):
        space = scale_space(image, 0.8, 11, sigma_min=2.2)
        search = LatticeSearch(space, space.rounding, extrema.inner_window(space))
        assert (search.p < node_distance(space)) is closer
        assert extrema.discrete_extrema(space).tolist() == of_all(space, space.rounding).tolist()


def test_what_is_left_over_is_searched_by_all_its_samples(monkeypatch):
    # Noise in a corner alone: the part in the middle does not know of it.
    monkeypatch.setattr(search_lattice, "_FEW", 0.0)
    image = blobs((150, 170), 5)
    image[:40, :60] += 0.15 * np.random.default_rng(4).standard_normal((40, 60))
    space = scale_space(image, 0.8, 11, sigma_min=2.2)
    search = LatticeSearch(space, space.rounding, extrema.inner_window(space))
    assert search.p == node_distance(space) > 1
    regions = [region for part in search.parts for region in search.candidates(part)[1]]
    assert regions
    again = search.closer(*regions[0])
    assert again is not None and again.p == 1 and again.closer(*regions[0]) is None
    assert of_few(space, space.rounding).tolist() == of_all(space, space.rounding).tolist()
