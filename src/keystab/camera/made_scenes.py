r"""Scenes that are made: any number of them, of families whose properties are known.

``dead-leaves``
    Discs that hide one another [1]_: the density of radii falls with :math:`r^{-3}` from 5 to 2000
    pixels, so that the scene looks alike from near and far. Occlusion, corners, all contrasts.
``fractal``
    A Gaussian field whose power spectrum falls with :math:`k^{-e}`: natural amplitudes without
    edges.
``edges``
    Rectangles that hide one another, all turned by one angle.
``line-art``
    Dark strokes on light ground, all along one angle or across it.
``text``
    Lines of made-up words in letters of many sizes.

Grey values are whole multiples of 1 / 65535, as a picture of 16 bits holds them, so that last
digits of processors do not reach the pixels.

References
----------
.. [1] A. B. Lee, D. Mumford and J. Huang, "Occlusion models for natural images: a statistical
   study of a scale-invariant dead leaves model", Int. J. Computer Vision 41, 2001.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.utils import validation
from keystab.utils.random import random_generator

__all__ = ["KINDS", "SHAPE", "dead_leaves", "fractal_field", "leaf_radii", "make_scene"]

KINDS = ("dead-leaves", "fractal", "edges", "line-art", "text")
"""Kinds of scenes."""

SHAPE = (1600, 2400)
"""Height and width, if nothing else is said."""

RADII = (5.0, 2000.0)
"""Radii of dead leaves, pixels."""

_GREY = np.array([0, 0.11, 0.15, 0.19, 0.23, 0.26, 0.3, 0.33, 0.37, 0.41, 0.45, 0.49, 0.53, 0.59,
                  0.66, 0.75, 1.0])  # fmt: skip
"""Quantiles of the grey values of a photograph (a stream between rocks), a sixteenth apart."""

_SMALLEST, _LARGEST = 16, 20_000
_MOST_PIXELS = 100_000_000
_SEEN_THROUGH = 2.0**-17
_WORD = "aaabcdeeeefghiiiklmnnooopqrrsstttuuvwxyz"

Array = NDArray[np.float64]


def make_scene(
    kind: str,
    shape: tuple[int, int] = SHAPE,
    seed: int = 0,
    *,
    exponent: float = 2.4,
    angle: float = 0.0,
) -> Array:
    """Make a scene.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    shape : (int, int)
        Height and width in pixels, 16 to 20000 each, at most 100 megapixels.
    seed : int
        Which one: at least 0. Another seed is another scene of the kind.
    exponent : float
        Of ``fractal``: how fast the power spectrum falls, 0 (white noise) to 4. Photographs have
        about 2.
    angle : float
        Of ``edges`` and ``line-art``: degrees from the rows to the sides, 0 to 90.

    Returns
    -------
    ndarray of float64, shape `shape`
        Grey values in [0, 1], multiples of 1 / 65535.

    Raises
    ------
    InputError
        If there is no such kind, or a number is out of its range.

    Examples
    --------
    >>> make_scene("dead-leaves", (40, 60), seed=3).shape
    (40, 60)
    >>> bool((make_scene("edges", (40, 60)) == make_scene("edges", (40, 60), 1)).all())
    False
    """
    if kind not in KINDS:
        raise InputError(f"kind of scene {kind!r}: allowed is one of {', '.join(KINDS)}")
    size = _checked_shape(shape)
    seed = validation.integer("seed", seed, 0)
    exponent, angle = (
        validation.number("exponent", exponent, 0),
        validation.number("angle", angle, 0),
    )
    if exponent > 4 or angle > 90:
        raise InputError(
            f"exponent {exponent:g} and angle {angle:g}: allowed are 0 to 4 and 0 to 90 degrees"
        )
    draw = random_generator("made scene", kind, seed)
    if kind == "dead-leaves":
        image = dead_leaves(size, draw)
    elif kind == "fractal":
        image = np.clip(0.5 + fractal_field(size, draw, exponent) / 8, 0, 1)
    elif kind == "text":
        image = _text(size, draw)
    else:
        image = _rectangles(size, draw, math.radians(angle), strokes=kind == "line-art")
    return np.rint(65535 * image) / 65535


def _checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    try:
        height, width = shape
    except (TypeError, ValueError):
        raise InputError(f"shape {shape!r}: give height and width") from None
    sides = [
        validation.integer(name, n, _SMALLEST, _LARGEST)
        for name, n in (("height", height), ("width", width))
    ]
    if sides[0] * sides[1] > _MOST_PIXELS:
        raise InputError(f"shape {shape!r}: allowed are at most {_MOST_PIXELS:,} pixels")
    return sides[0], sides[1]


def _greys(draw: np.random.Generator, n: int) -> Array:
    """Grey values with the histogram of a photograph."""
    steps = np.linspace(0, 1, len(_GREY))
    return np.asarray(np.interp(draw.random(n), steps, _GREY), dtype=np.float64)


# ---------------------------------------------------------------------------------------------
# Dead leaves


def leaf_radii(
    draw: np.random.Generator, n: int, shape: tuple[int, int], radii: tuple[float, float] = RADII
) -> Array:
    r"""Radii of discs that touch a frame, of discs everywhere with a density of :math:`r^{-3}`.

    Parameters
    ----------
    draw : Generator
    n : int
        How many.
    shape : (int, int)
        Height h and width w of the frame.
    radii : (float, float)
        Smallest and largest, a and b.

    Returns
    -------
    ndarray of float64, shape (n,)

    Notes
    -----
    A disc is near the frame if its centre lies in the frame grown by r, which makes the density
    :math:`r^{-3} (h + 2r)(w + 2r)`: a mixture of three powers, each drawn by the inverse of its
    distribution.

    Examples
    --------
    >>> few = leaf_radii(np.random.default_rng(0), 5, (100, 100), (5.0, 50.0))
    >>> bool(((few >= 5) & (few <= 50)).all())
    True
    """
    (height, width), (a, b) = shape, radii
    weights = np.array(
        [
            height * width * (a**-2 - b**-2) / 2,
            2 * (height + width) * (1 / a - 1 / b),
            4 * math.log(b / a),
        ]
    )
    power = draw.choice(3, n, p=weights / weights.sum())
    u = draw.random(n)
    by_power = [
        a / np.sqrt(1 - u * (1 - (a / b) ** 2)),
        a / (1 - u * (1 - a / b)),
        a * (b / a) ** u,
    ]
    return np.asarray(np.choose(power, by_power), dtype=np.float64)


def dead_leaves(
    shape: tuple[int, int], draw: np.random.Generator, radii: tuple[float, float] = RADII
) -> Array:
    """Discs that hide one another, laid from the front to the back until nothing is seen between.

    Parameters
    ----------
    shape : (int, int)
        Height and width, pixels.
    draw : Generator
    radii : (float, float)
        Smallest and largest radius, pixels.

    Returns
    -------
    ndarray of float64, shape `shape`
        Grey values in [0, 1]. Rims are a pixel wide, as a share of each pixel that is covered.
    """
    height, width = shape
    image, left = np.zeros(shape), np.ones(shape)
    while left.max() > _SEEN_THROUGH:
        n = 4096
        radius = leaf_radii(draw, n, shape, radii)
        y = draw.random(n) * (height - 1 + 2 * radius) - radius
        x = draw.random(n) * (width - 1 + 2 * radius) - radius
        for at_y, at_x, r, grey in zip(y, x, radius, _greys(draw, n), strict=True):
            rows = slice(max(0, math.floor(at_y - r)), math.ceil(at_y + r) + 1)
            columns = slice(max(0, math.floor(at_x - r)), math.ceil(at_x + r) + 1)
            behind = left[rows, columns]
            if not behind.any():
                continue
            down = np.arange(rows.start, rows.start + behind.shape[0])[:, None] - at_y
            across = np.arange(columns.start, columns.start + behind.shape[1]) - at_x
            covered = np.clip(r + 0.5 - np.sqrt(down**2 + across**2), 0, 1) * behind
            image[rows, columns] += grey * covered
            behind -= covered
            behind[behind < _SEEN_THROUGH / 2] = 0
    return image


# ---------------------------------------------------------------------------------------------
# Fields, edges, text


def fractal_field(shape: tuple[int, int], draw: np.random.Generator, exponent: float) -> Array:
    r"""Gaussian field with a power spectrum of :math:`k^{-e}`.

    Parameters
    ----------
    shape : (int, int)
        Height and width, pixels.
    draw : Generator
    exponent : float
        e; 0 is white noise.

    Returns
    -------
    ndarray of float64, shape `shape`
        Mean 0 and standard deviation 1, both of the field itself. Its ends meet: it is periodic.
    """
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :])
    frequency[0, 0] = np.inf  # no mean
    spectrum = np.fft.rfft2(draw.standard_normal(shape)) * frequency ** (-exponent / 2)
    field = np.fft.irfft2(spectrum, shape)
    return np.asarray((field - field.mean()) / field.std(), dtype=np.float64)


def _rectangles(
    shape: tuple[int, int], draw: np.random.Generator, angle: float, strokes: bool
) -> Array:
    """Rectangles of one direction, the last in front; strokes are thin and dark."""
    height, width = shape
    n = max(4, height * width // (9000 if strokes else 4500))
    y, x = draw.random(n) * (height - 1), draw.random(n) * (width - 1)
    along = np.exp(draw.uniform(math.log(20.0), math.log(600.0), n)) / 2
    if strokes:
        across = np.exp(draw.uniform(math.log(2.0), math.log(24.0), n)) / 2
        greys = draw.uniform(0.05, 0.3, n)
        turned = draw.random(n) < 0.5
        along, across = np.where(turned, across, along), np.where(turned, along, across)
    else:
        across = along * np.exp(draw.uniform(math.log(0.3), math.log(3.0), n))
        greys = _greys(draw, n)
        order = np.argsort(-along * across, kind="stable")  # small ones in front
        y, x, along, across, greys = (each[order] for each in (y, x, along, across, greys))
    image = np.full(shape, 0.9 if strokes else 0.5)
    cos, sin = math.cos(angle), math.sin(angle)
    for at_y, at_x, a, b, grey in zip(y, x, along, across, greys, strict=True):
        reach = (abs(a * sin) + abs(b * cos) + 1, abs(a * cos) + abs(b * sin) + 1)
        rows = slice(max(0, math.floor(at_y - reach[0])), math.ceil(at_y + reach[0]) + 1)
        columns = slice(max(0, math.floor(at_x - reach[1])), math.ceil(at_x + reach[1]) + 1)
        part = image[rows, columns]
        down = np.arange(rows.start, rows.start + part.shape[0])[:, None] - at_y
        right = np.arange(columns.start, columns.start + part.shape[1]) - at_x
        covered = np.clip(a + 0.5 - np.abs(right * cos + down * sin), 0, 1)
        covered = covered * np.clip(b + 0.5 - np.abs(down * cos - right * sin), 0, 1)
        part += covered * (grey - part)
    return image


def _text(shape: tuple[int, int], draw: np.random.Generator) -> Array:
    """Page of made-up words."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = shape
    page = Image.new("L", (width, height), 235)
    pen = ImageDraw.Draw(page)
    top = 0.0
    while top < height:
        size = int(np.exp(draw.uniform(math.log(12.0), math.log(120.0))))
        font = ImageFont.load_default(size)
        line, right = "", int(draw.integers(0, size))
        for word in _words(draw):
            line += f"{word} "
            if pen.textlength(line, font) > width:
                break
        pen.text((right, top), line, fill=int(draw.integers(10, 90)), font=font)
        top += 1.3 * size
    return np.asarray(page, dtype=np.float64) / 255


def _words(draw: np.random.Generator) -> Iterator[str]:
    letters = np.array(list(_WORD))
    while True:
        word = "".join(draw.choice(letters, int(draw.integers(2, 10))))
        yield word.capitalize() if draw.random() < 0.2 else word
