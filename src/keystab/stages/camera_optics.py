"""Fit Gaussians to the point spread functions of model cameras (figure S3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Compute and write the tables of figure S3."""
    parser = _run.parser(__doc__)
    _run.required(parser, "f-numbers", "f-numbers", type=float, nargs="+")
    _run.required(parser, "pixel-pitches", "pixel pitches, micrometres", type=float, nargs="+")
    _run.required(parser, "wavelength", "wavelength, micrometres", type=float)
    _run.required(parser, "fill-factor", "share of a pixel that collects light", type=float)
    _run.required(parser, "defocus", "sensor's distance from the focus, micrometres", type=float)
    _run.required(parser, "spherical", "spherical aberration at f/2, wavelengths", type=float)
    _run.required(parser, "profile-f-number", "f-number of the profiles", type=float)
    _run.required(parser, "profile-pitch", "pixel pitch of the profiles, micrometres", type=float)
    _run.required(parser, "table", "table of camera blurs to write", type=Path)
    _run.required(parser, "profiles", "table of profiles to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.camera_blur import optics_table, profile_table
    from keystab.io.tables import write_table

    lens = (args.wavelength, args.fill_factor, args.defocus, args.spherical)
    write_table(optics_table(args.f_numbers, args.pixel_pitches, *lens), args.table)
    profiles = profile_table(args.profile_f_number, args.profile_pitch, *lens)
    write_table(profiles, args.profiles)


if __name__ == "__main__":
    raise SystemExit(main())
