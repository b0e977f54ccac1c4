"""Pictures that tests look at."""

import numpy as np


def blob(shape, centre, size):
    """One Gaussian blob."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.exp(-((y - centre[0]) ** 2 + (x - centre[1]) ** 2) / (2 * size**2))


def blobs(shape, seed, density=0.04):
    """Blobs of the sizes that one octave finds, close enough to disturb each other, in [0, 1]."""
    rng = np.random.default_rng(seed)
    image = np.zeros(shape)
    for _ in range(int(density * image.size)):
        centre = [rng.uniform(-2, n + 2) for n in shape]
        image += rng.choice([-1, 1]) * blob(shape, centre, rng.uniform(1.2, 2.6))
    return (image - image.min()) / np.ptp(image)
