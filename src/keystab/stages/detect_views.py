"""Detect the discrete extrema of all views of a set at one sampling, and trace their refinement."""

from pathlib import Path

from keystab.parameters import DetectionInViews, RefinementPath
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    n_spo: int,
    detection: DetectionInViews,
    path: RefinementPath,
    store: Store | None = None,
    *,
    extrema: Path,
    traces: Path,
) -> None:
    """Read the views and, where they are kept, their scale-spaces; write two tables."""
    from keystab.camera.common_field import searched_windows
    from keystab.detection.view_detector import detect_in_view, joined
    from keystab.io.checksums import verify
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.stages._view_search import search_of_stores, view_detector
    from keystab.utils.progress import progress

    seen = read_views(*views)
    if store is not None:
        verify(*store)
    windows = searched_windows(seen.specs, seen.reference_shape, detection.guard)
    found = []
    for number, view in enumerate(progress(seen, len(seen), f"views, n_spo {n_spo}")):
        detector = view_detector(view, n_spo, detection, epsilon=detection.epsilon, **vars(path))
        search = search_of_stores(store.path, number, detection.epsilon) if store else None
        found.append(detect_in_view(view.image, detector, search, windows[number]))
    table, models = joined("view", range(len(seen)), found)
    write_table(table, extrema)
    write_table(models, traces)
    print(f"{len(table)} extrema in {len(seen)} views")
