"""The detector written out as plainly as possible: slow, whole slices, loops over neighbours.

It shares no code with the library. One cosine transform of the oversampled image, one inverse
transform per Gaussian, comparison with 26 neighbours one by one, the refinement as the paper words
it.
"""

import numpy as np
from scipy.fft import dctn, idctn
from scipy.ndimage import spline_filter1d

STEPS = [
    (a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if (a, b, c) != (0, 0, 0)
]


def cubic_spline_matrix(n_pixels, n_samples, delta_min):
    """Values of the cubic B-splines of all pixels at all fine samples, half-sample mirror."""
    matrix = np.zeros((n_samples, n_pixels))
    for i in range(n_samples):
        position = i * delta_min
        for j in range(int(np.floor(position)) - 1, int(np.floor(position)) + 3):
            t = abs(position - j)
            if t < 1:
                value = 2 / 3 - t**2 + t**3 / 2
            elif t < 2:
                value = (2 - t) ** 3 / 6
            else:
                continue
            mirrored = -1 - j if j < 0 else 2 * n_pixels - 1 - j if j >= n_pixels else j
            matrix[i, mirrored] += value
    return matrix


def spline_oversampled(image, delta_min):
    """The image on the fine grid."""
    fine = image
    for axis in (0, 1):
        fine = spline_filter1d(fine, order=3, axis=axis, mode="mirror")
    height, width = (int(n / delta_min) for n in image.shape)
    rows = cubic_spline_matrix(image.shape[0], height, delta_min)
    columns = cubic_spline_matrix(image.shape[1], width, delta_min)
    return rows @ fine @ columns.T


def dct_scale_space(image, camera_blur, n_spo, delta_min, sigma_min, kappa):
    """All DoG slices by the cosine transform of the spline-oversampled image."""
    fine = spline_oversampled(image, delta_min)
    transform = dctn(fine, norm="ortho")
    omega_y = np.pi * np.arange(fine.shape[0])[:, None] / fine.shape[0]
    omega_x = np.pi * np.arange(fine.shape[1])[None, :] / fine.shape[1]

    def blurred(sigma):
        added = max(sigma**2 - camera_blur**2, 0.0) / delta_min**2
        return idctn(transform * np.exp(-added / 2 * (omega_y**2 + omega_x**2)), norm="ortho")

    scales = [sigma_min * 2 ** (s / n_spo) for s in range(n_spo + 2)]
    return np.stack([blurred(kappa * sigma) - blurred(sigma) for sigma in scales])


def margins(dog):
    """By how much each discrete extremum (s, row, column, sign) exceeds its nearest neighbour."""
    found = {}
    cells = dog.tolist()  # Python's numbers are the same, and quicker to take one by one
    for s in range(1, dog.shape[0] - 1):
        for i in range(1, dog.shape[1] - 1):
            for j in range(1, dog.shape[2] - 1):
                value = cells[s][i][j]
                if value - cells[s][i][j - 1] > 0:
                    sign = 1
                else:
                    sign = -1
                least = np.inf
                for a, b, c in STEPS:
                    difference = sign * (value - cells[s + a][i + b][j + c])
                    if not difference > 0:
                        break
                    least = min(least, difference)
                else:
                    found[s, i, j, sign] = least
    return found


def discrete_extrema(dog, epsilon):
    """Set of (s, row, column, sign)."""
    return {place for place, margin in margins(dog).items() if margin > epsilon}


def refine(dog, s, i, j, max_offset, max_iterations, scale_moves, move):
    """Refined grid position (s, i, j) as floats, or None."""
    for _ in range(max_iterations):
        w = dog[s - 1 : s + 2, i - 1 : i + 2, j - 1 : j + 2]
        g = np.array(
            [
                (w[2, 1, 1] - w[0, 1, 1]) / 2,
                (w[1, 2, 1] - w[1, 0, 1]) / 2,
                (w[1, 1, 2] - w[1, 1, 0]) / 2,
            ]
        )
        h_ss = w[2, 1, 1] + w[0, 1, 1] - 2 * w[1, 1, 1]
        h_yy = w[1, 2, 1] + w[1, 0, 1] - 2 * w[1, 1, 1]
        h_xx = w[1, 1, 2] + w[1, 1, 0] - 2 * w[1, 1, 1]
        h_sy = (w[2, 2, 1] - w[2, 0, 1] - w[0, 2, 1] + w[0, 0, 1]) / 4
        h_sx = (w[2, 1, 2] - w[2, 1, 0] - w[0, 1, 2] + w[0, 1, 0]) / 4
        h_yx = (w[1, 2, 2] - w[1, 2, 0] - w[1, 0, 2] + w[1, 0, 0]) / 4
        hessian = np.array([[h_ss, h_sy, h_sx], [h_sy, h_yy, h_yx], [h_sx, h_yx, h_xx]])
        alpha = -np.linalg.solve(hessian, g)
        if np.abs(alpha).max() < max_offset:
            return s + alpha[0], i + alpha[1], j + alpha[2], w[1, 1, 1] + g @ alpha / 2
        if move == "nearest":
            step = [round(float(a)) for a in alpha]
        else:
            step = [int(np.sign(a)) if abs(a) > max_offset else 0 for a in alpha]
        if not scale_moves:
            step[0] = 0
        s, i, j = s + step[0], i + step[1], j + step[2]
        inside = all(1 <= k <= n - 2 for k, n in zip((s, i, j), dog.shape, strict=True))
        if not inside:
            return None
    return None
