"""Make a scene and write it as a picture."""

from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(kind: str, seed: int, exponent: float, angle: float, *, picture: Path) -> None:
    """Make the scene at the size of the corpus."""
    from keystab.camera.made_scenes import make_scene
    from keystab.io.pictures import write_picture

    write_picture(make_scene(kind, seed=seed, exponent=exponent, angle=angle), picture)
