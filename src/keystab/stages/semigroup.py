"""Blur a Gaussian blob many times by little and once by much (figure 1)."""

from pathlib import Path

from keystab.parameters import Semigroup
from keystab.utils.stage_command import command


@command
def main(semigroup: Semigroup, *, table: Path) -> None:
    """Compute and write the table of figure 1."""
    import numpy as np

    from keystab.experiments.semigroup_table import semigroup_table
    from keystab.io.tables import write_table

    it = semigroup
    # Rounded, so that 0.7 is 0.7 and not 0.7000000000000001.
    sigmas = np.linspace(it.sigma_from, it.sigma_to, it.sigma_count).round(12)
    write_table(semigroup_table(it.blob, it.n_passes, sigmas, truncation=it.truncation), table)
