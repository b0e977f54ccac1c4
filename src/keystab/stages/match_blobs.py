"""Compare the scales at which blobs are detected with theory (figure S4)."""

from pathlib import Path

from keystab.parameters import Acceptance, Blobs
from keystab.stages._command import command


@command
def main(blobs: Blobs, extrema: Path, traces: Path, accepted: Acceptance, *, table: Path) -> None:
    """Read extrema and traces of blobs; write the table of figure S4."""
    from keystab.experiments.blob_scales import blob_table, sizes
    from keystab.io.tables import read_table, write_table

    it = blobs
    result = blob_table(
        sizes(it.size_from, it.size_to, it.size_count),
        it.kappa,
        it.kappas,
        it.n_spo,
        it.camera_blur,
        it.assumed_blurs,
        it.sigma_min,
        accepted.max_offset,
        accepted.max_iterations,
        (read_table(extrema), read_table(traces)),
    )
    write_table(result, table)


if __name__ == "__main__":
    raise SystemExit(main())
