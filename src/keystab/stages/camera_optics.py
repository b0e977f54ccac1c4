"""Fit Gaussians to the point spread functions of model cameras (figure S3)."""

from pathlib import Path

from keystab.parameters import Optics
from keystab.utils.stage_command import command


@command
def main(optics: Optics, *, table: Path, profiles: Path, ranges: Path) -> None:
    """Compute and write the tables of figure S3."""
    from keystab.experiments.camera_blur import optics_table, profile_table, range_table
    from keystab.io.tables import write_table

    lens = (optics.wavelength, optics.fill_factor, optics.defocus, optics.spherical)
    write_table(optics_table(optics.f_numbers, optics.pixel_pitches, *lens), table)
    write_table(profile_table(optics.profile_f_number, optics.profile_pitch, *lens), profiles)
    cameras = (optics.f_numbers, optics.pixel_pitches, optics.confusions)
    write_table(range_table(*cameras, *lens[:2]), ranges)
