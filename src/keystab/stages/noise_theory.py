"""Noise of the difference of Gaussians against scale, in closed form (figure 12)."""

from pathlib import Path

from keystab.parameters import Scales
from keystab.stages._command import command


@command
def main(camera_blur: float, scales: Scales, n_oct: int, *, table: Path) -> None:
    """Write a table of the noise at many scales, and of its ratio from octave to octave."""
    import numpy as np
    import pandas as pd

    from keystab.io.tables import write_table
    from keystab.scalespace.white_noise import dog_noise

    sigma = scales.sigma_min * 2.0 ** np.linspace(0, n_oct, 20 * n_oct + 1)
    here, above = (dog_noise(scale, camera_blur, scales.kappa) for scale in (sigma, 2 * sigma))
    write_table(
        pd.DataFrame({"sigma": sigma, "dog_noise": here, "octave_ratio": here / above}), table
    )
