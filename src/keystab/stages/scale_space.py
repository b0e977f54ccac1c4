"""Store one balanced scale-space of a view."""

from keystab.parameters import DifferenceOfGaussians
from keystab.utils.stage_command import Store, command


@command
def main(views: Store, n_spo: int, dog: DifferenceOfGaussians, *, store: Store) -> None:
    """Read the view, evaluate its scale-space into a store, list its checksums."""
    from keystab.io.checksums import write_checksums
    from keystab.io.scale_space_store import write_scale_space
    from keystab.io.view_store import read_view
    from keystab.stages._scale_spaces import sampled_space

    space = sampled_space(read_view(*views), n_spo, dog)
    write_scale_space(space, store.path)
    write_checksums(*store)
    print("x".join(map(str, space.shape)), "samples")
