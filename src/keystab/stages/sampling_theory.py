"""What samplings of a scale-space mean for its Gaussians, without a picture (section 5.1)."""

from pathlib import Path

from keystab.parameters import Scales, Semigroup
from keystab.utils.stage_command import command


@command
def main(
    n_spo: list[int],
    scales: Scales,
    semigroup: Semigroup,
    sift_sigma_min: float,
    sift_delta_min: float,
    *,
    table: Path,
) -> None:
    """Write a table of the blurs that samplings add, and of how much their steps change."""
    from keystab.experiments.sampling_theory import sampling_theory
    from keystab.io.tables import write_table

    sift = (sift_sigma_min, sift_delta_min)
    write_table(sampling_theory(n_spo, scales, sift, semigroup), table)
