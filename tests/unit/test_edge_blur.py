"""The blur that edges tell is the blur that they have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr

from keystab.camera.edge_blur import edge_blur
from keystab.camera.simulation import simulate_view
from keystab.errors import InputError
from keystab.io.pictures import read_picture

IMAGES = Path(__file__).parents[2] / "config/images"


def edge(blur, angle, shape=(70, 90), offset=0.3):
    """A straight step edge that a camera has seen: the normal distribution, in closed form."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    along = (x - shape[1] / 2) * np.cos(angle) + (y - shape[0] / 2) * np.sin(angle) - offset
    return ndtr(along / blur)


@pytest.mark.parametrize("blur", [0.6, 0.8, 1.1, 1.6])
@pytest.mark.parametrize("angle", [0.0, 0.3, 0.8, np.pi / 2, 2.0])
@pytest.mark.parametrize("height", [1.0, -200.0, 1e300])
def test_a_step_edge_has_its_blur_at_any_angle_and_height(blur, angle, height):
    found = edge_blur(50 + height * edge(blur, angle))
    assert found.blur == pytest.approx(blur, abs=0.03)
    assert found.low < blur < found.high
    assert found.n_edges >= 20


def test_an_oblong_picture_and_its_transpose_are_alike():
    picture = edge(0.9, 0.4) + edge(0.9, 1.9, offset=-20)
    assert edge_blur(picture.T).blur == pytest.approx(edge_blur(picture).blur, abs=1e-9)


def test_thin_lines_and_neighbouring_edges_do_not_count():
    blur, angle = 0.8, 0.5
    line = edge(blur, angle, offset=-10) - edge(blur, angle, offset=-8.5)
    found = edge_blur(edge(blur, angle, offset=15) + line)
    assert found.blur == pytest.approx(blur, abs=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("blur", [0.65, 0.8, 1.0])
def test_views_of_a_photograph_lie_in_the_interval(blur, noise):
    scene = read_picture(IMAGES / "lanterns.png")
    view = simulate_view(scene, blur, 6, noise=noise, seed=1 if noise else None)
    found = edge_blur(view)
    assert found.low < blur < found.high
    assert found.high - found.low < 0.4


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (np.zeros((40, 40)), "0 pixels on straight, isolated edges"),
        (np.random.default_rng(0).random((40, 40)), "pixels on straight, isolated edges"),
        (np.zeros((40, 40, 3)), "give a grey one"),
        (np.zeros((12, 40)), "more than 12 x 12"),
        (np.full((40, 40), np.nan), "NaN"),
    ],
)
def test_what_has_no_edges_is_refused_in_one_line(picture, words):
    with pytest.raises(InputError, match=words) as caught:
        edge_blur(picture)
    assert "\n" not in str(caught.value)
