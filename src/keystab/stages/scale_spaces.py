"""Store the scale-spaces of all views of a set at one sampling."""

from keystab.parameters import ScaleSpaceOfViews
from keystab.utils.stage_command import Store, command


@command
def main(views: Store, n_spo: int, dog: ScaleSpaceOfViews, *, store: Store) -> None:
    """Read the views, write one store per view and octave, list their checksums together."""
    from keystab.io.checksums import write_checksums
    from keystab.io.scale_space_store import write_scale_space
    from keystab.io.view_store import read_views
    from keystab.stages._view_search import store_of, view_detector

    seen = read_views(*views)
    for number, view in enumerate(seen):
        for octave, space in enumerate(view_detector(view, n_spo, dog).octaves(view.image)):
            write_scale_space(space, store_of(store.path, number, octave))
    write_checksums(*store)
    print(f"the scale-spaces of {len(seen)} views")
