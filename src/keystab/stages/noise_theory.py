"""Noise of the difference of Gaussians against scale, in closed form (figure 12)."""

from pathlib import Path

from keystab.parameters import Scales
from keystab.utils.stage_command import command


@command
def main(camera_blur: float, scales: Scales, n_oct: int, *, table: Path) -> None:
    """Write a table of the noise at many scales, and of its ratio from octave to octave."""
    from keystab.experiments.noise_against_scale import noise_against_scale
    from keystab.io.tables import write_table

    write_table(noise_against_scale(scales, camera_blur, n_oct), table)
