"""The scale-space in extended precision, written out plainly; it shares no code with the library.

Positions of samples, blurs and pixels are the doubles that the library has; all else is computed
with 64 binary digits instead of 53.
"""

import numpy as np

LONG = np.longdouble
EXTENDED = np.finfo(LONG).nmant >= 63
PI = LONG("3.14159265358979323846264338327950288")


def spline_coefficients(values):
    """Coefficients of the cubic splines through values along axis 0, mirrored at the end pixels."""
    n = len(values)
    sixth, middle = LONG(1) / 6, LONG(4) / 6
    upper = np.full(n, sixth)
    upper[0] = 2 * sixth
    lower = np.full(n, sixth)
    lower[-1] = 2 * sixth
    out, ratio = np.empty_like(values), np.empty(n, dtype=LONG)
    pivot = middle
    out[0] = values[0] / pivot
    for i in range(1, n):
        ratio[i - 1] = upper[i - 1] / pivot
        pivot = middle - lower[i] * ratio[i - 1]
        out[i] = (values[i] - lower[i] * out[i - 1]) / pivot
    for i in range(n - 2, -1, -1):
        out[i] -= ratio[i] * out[i + 1]
    return out


def spline_rows(n_pixels, n_samples, delta, stride, blur):
    """Rows of oversampling and blur along one axis, shape (n_rows, n_pixels)."""
    position = np.arange(n_samples) * delta
    knot = np.minimum(np.floor(position), n_pixels - 1).astype(int)
    t = position.astype(LONG) - knot
    weights = [(1 - t) ** 3, 4 - 6 * t**2 + 3 * t**3, 1 + 3 * t + 3 * t**2 - 3 * t**3, t**3]
    spline = np.zeros((n_samples, n_pixels), dtype=LONG)
    for k, weight in enumerate(weights):
        column = knot - 1 + k
        column = np.where(column < 0, -1 - column, column)
        column = np.where(column >= n_pixels, 2 * n_pixels - 1 - column, column)
        np.add.at(spline, (np.arange(n_samples), column), weight / 6)
    if blur == 0:
        return spline[::stride]
    width = blur / delta
    frequency = PI * np.arange(n_samples) / n_samples
    place = np.arange(n_samples) + LONG(1) / 2
    waves = np.cos(np.multiply.outer(place, frequency))
    gains = np.exp(-((width * frequency) ** 2) / 2) * 2 / n_samples
    gains[0] /= 2
    return (waves[::stride] * gains) @ (waves.T @ spline)


def cosine_rows(n_pixels, n_samples, delta, stride, blur):
    """Cosines of all frequencies at all samples, damped."""
    place = np.arange(0, n_samples, stride) * delta
    frequency = PI * np.arange(n_pixels) / n_pixels
    waves = np.cos(np.multiply.outer(place.astype(LONG) + LONG(1) / 2, frequency))
    return waves * np.exp(-((blur * frequency) ** 2) / 2)


def cosine_coefficients(values):
    """Coefficients of the cosine series of values along axis 0."""
    n = len(values)
    waves = np.cos(np.multiply.outer(PI * np.arange(n) / n, np.arange(n) + LONG(1) / 2))
    waves[1:] *= 2
    return waves @ values / n


def long_scale_space(space):
    """All values of a scale-space of the library, shape (n_slices, n_rows, n_columns)."""
    sampling = space.sampling
    image = space.image.astype(LONG)
    # The level does not matter; without it less is rounded here too.
    image = image - image.mean()
    make, rows = (
        (spline_coefficients, spline_rows)
        if space.oversampling == "spline"
        else (cosine_coefficients, cosine_rows)
    )
    source = make(make(image).T).T
    blurs, lower, upper = space.blurs
    gaussians = []
    for blur in blurs:
        along, across = (
            rows(n, m, sampling.delta_min, sampling.stride, blur)
            for n, m in zip(image.shape, sampling.base_grid_shape, strict=True)
        )
        gaussians.append(along @ source @ across.T)
    return np.stack([gaussians[i] - gaussians[j] for i, j in zip(upper, lower, strict=True)])
