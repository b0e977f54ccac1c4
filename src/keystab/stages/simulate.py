"""Simulate a set of views of the reference picture and store it."""

from pathlib import Path
from typing import Literal

from keystab.parameters import Camera, Reference
from keystab.utils.stage_command import Store, command


@command
def main(
    reference: Path,
    name: str,
    picture: Reference,
    camera: Camera,
    dtype: Literal["float32", "float64"],
    *,
    views: Store,
) -> None:
    """Read the picture, take the views, write the store and list its checksums."""
    from keystab.camera.simulation import Scene, simulate
    from keystab.camera.view_sets import view_specs
    from keystab.errors import InputError
    from keystab.io.checksums import write_checksums
    from keystab.io.pictures import read_with_digest
    from keystab.io.view_store import write_views

    pixels, digest = read_with_digest(reference)
    if picture.reference_sha256 not in (None, digest):
        raise InputError(
            f"{reference} is not the picture that the config means: its pixels have the "
            f"SHA-256 {digest}; for this picture write reference_sha256: {digest} or null"
        )
    scene = Scene(pixels)
    specs = view_specs(name, vars(camera), scene.shape)
    attributes = {
        "set": name,
        "reference_sha256": digest,
        "reference_blur": picture.reference_blur,
        "reference_shape": list(scene.shape),
    }
    images = (simulate(scene, spec) for spec in specs)
    write_views(images, specs, views.path, attributes, dtype)
    write_checksums(*views)
    print(f"{len(specs)} view(s), the first of {specs[0].shape[0]} x {specs[0].shape[1]} px")
