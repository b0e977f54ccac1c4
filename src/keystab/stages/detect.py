"""Detect the discrete extrema of one balanced sampling and trace their refinement."""

from pathlib import Path

from keystab.parameters import Detection, RefinementPath
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    n_spo: int,
    detection: Detection,
    path: RefinementPath,
    store: Store | None = None,
    *,
    extrema: Path,
    traces: Path,
) -> None:
    """Read the view and, where there is one, its stored scale-space; write two tables."""
    from keystab.detection.detector import extrema_table
    from keystab.detection.extrema import discrete_extrema
    from keystab.detection.refinement import trace
    from keystab.detection.stored_extrema import stored_extrema
    from keystab.io.checksums import verify
    from keystab.io.scale_space_store import StoredScaleSpace
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.stages._scale_spaces import sampled_space

    space = sampled_space(read_view(*views), n_spo, detection)
    if store is None:
        found = discrete_extrema(space, detection.epsilon, show_progress=True)
    else:
        verify(*store)
        found = stored_extrema(StoredScaleSpace(store.path), space, detection.epsilon)
    table = extrema_table(space, found)
    table.insert(0, "n_spo", n_spo)
    table.insert(1, "delta_min", space.sampling.delta_min)
    models = trace(space, table, **vars(path))
    write_table(table, extrema)
    write_table(models, traces)
    print(f"{len(table)} extrema among {space.sampling.n_samples:,} samples")
