"""Rounding is bounded, and what it decides is no extremum: against extended precision."""

from __future__ import annotations

import numpy as np
import pytest
from long_scale_space import EXTENDED, long_scale_space
from scenes import blobs

from keystab.detection import extrema
from keystab.scalespace.dog import scale_space

pytestmark = pytest.mark.skipif(not EXTENDED, reason="long doubles have 53 digits here")

# How much larger than what is seen bounds may be. Sums in a fixed order are bounded by their number
# of terms, and are off by its root; cosine series cancel, and bounds take their terms in size.
LOOSER = {"spline": 2000, "cosine": 3000}


def step(angle: float, shape: tuple[int, int] = (18, 23)) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    across = (x - shape[1] / 2) * np.cos(angle) + (y - shape[0] / 2) * np.sin(angle)
    return (across > 0.3).astype(float)


def picture(kind: str) -> np.ndarray:
    rng = np.random.default_rng(3)
    if kind == "noise":
        return rng.random((18, 23))
    if kind == "text":
        return np.kron(rng.random((5, 8)) > 0.6, np.ones((4, 3))).astype(float)
    if kind == "16 bits":
        return 65535.0 - rng.integers(0, 2, (17, 22)) * 65535
    if kind == "rectangle":
        image = np.zeros((26, 32))
        image[9:17, 10:24] = 1
        return image
    return step(float(kind))


KINDS = ["noise", "text", "16 bits", "rectangle", "0", "0.3", "0.785398", "1.2", "1.570796"]


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("kind", KINDS)
def test_extrema_are_those_of_exact_arithmetic(kind, oversampling):
    for octave in (0, 1) if kind in ("noise", "text") else (0,):
        space = scale_space(picture(kind), 1.1, 3, oversampling=oversampling, octave=octave)
        exact = long_scale_space(space)
        off = np.abs(space.window() - exact).max()
        bounds = space.rounding_bounds
        assert off <= bounds.value
        found, cubes = extrema.extrema_and_cubes(space)
        for (s, y, x, sign), cube in zip(found, cubes, strict=True):
            around = exact[s - 1 : s + 2, y - 1 : y + 2, x - 1 : x + 2]
            off = max(off, np.abs(cube - around).max())
            rest = np.delete((sign * (around[1, 1, 1] - around)).ravel(), 13)
            assert rest.min() > 0
        assert off <= bounds.value
        assert bounds.value < LOOSER[oversampling] * off


@pytest.mark.parametrize("n_spo", [4])
def test_rows_that_are_cut_are_off_by_what_they_lack(n_spo):
    rng = np.random.default_rng(1)
    space = scale_space(65535 * rng.integers(0, 2, (8, 100)), 1.1, n_spo)
    assert (space.axes[1].rows.table >= 0).any()
    off = np.abs(space.window() - long_scale_space(space)).max()
    assert off < space.rounding_bounds.value < 2000 * off


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("n_spo", [3, 4, 7])
def test_nothing_is_extremal_where_the_picture_has_one_dimension(n_spo, oversampling):
    rng = np.random.default_rng(n_spo)
    profile = np.cumsum(rng.standard_normal(50))
    for image in (
        np.full((30, 50), 0.7),
        np.tile(profile, (30, 1)),
        65535 * np.tile(np.sign(profile), (30, 1)).T,
    ):
        found = extrema.discrete_extrema(scale_space(image, 0.9, n_spo, oversampling=oversampling))
        assert len(found) == 0


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_the_bound_scales_with_the_picture_and_not_with_its_level(oversampling):
    image = picture("noise")
    one, other, lifted = (
        scale_space(each, 1.1, 5, oversampling=oversampling).rounding
        for each in (image, 1024 * image, image + 4)
    )
    assert other == pytest.approx(1024 * one, rel=1e-12)
    assert lifted == pytest.approx(one, rel=1e-9)


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_sums_in_any_order_stay_within_the_bound(oversampling):
    space = scale_space(65535 * blobs((40, 44), 2), 1.1, 5, oversampling=oversampling)
    found, cubes = extrema.extrema_and_cubes(space)
    dog = space.window()
    for (s, y, x, _), cube in zip(found, cubes, strict=True):
        box = dog[s - 1 : s + 2, y - 1 : y + 2, x - 1 : x + 2]
        change = np.abs((cube - cube[1, 1, 1]) - (box - box[1, 1, 1])).max()
        assert change <= space.rounding_bounds.between
    assert len(found) > 5
