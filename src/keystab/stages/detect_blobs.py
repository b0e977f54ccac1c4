"""Detect Gaussian blobs of many sizes in all ways that figure S4 compares."""

from pathlib import Path

from keystab.parameters import Blobs
from keystab.stages._command import command


@command
def main(blobs: Blobs, *, extrema: Path, traces: Path) -> None:
    """Write the extrema of all blobs and their refinement traces."""
    from keystab.experiments.blob_scales import detect_blobs, sizes
    from keystab.io.tables import write_table

    it = blobs
    found, models = detect_blobs(
        sizes(it.size_from, it.size_to, it.size_count),
        it.kappa,
        it.kappas,
        it.n_spo,
        it.camera_blur,
        it.assumed_blurs,
        it.sigma_min,
    )
    write_table(found, extrema)
    write_table(models, traces)
    print(f"{len(found)} extrema")


if __name__ == "__main__":
    raise SystemExit(main())
