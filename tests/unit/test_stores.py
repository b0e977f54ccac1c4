"""Stores: what goes in comes out, or raises."""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from keystab.camera.views import ViewSpec
from keystab.errors import InputError
from keystab.io import scale_space_store, view_store, zarr_groups
from keystab.io.checksums import checksums
from keystab.utils import memory


class Space:
    """A scale-space whose values say where they are: 1e6 s + 1e3 row + column."""

    shape = (3, 70, 50)
    sigma = np.array([1.1, 1.3, 1.5])
    y = np.arange(70) * 0.5
    x = np.arange(50) * 0.5

    def window(self, slices, rows, columns):
        s, i, j = (
            np.arange(*part.indices(n), dtype=float)
            for part, n in zip((slices, rows, columns), self.shape, strict=True)
        )
        return 1e6 * s[:, None, None] + 1e3 * i[:, None] + j

    def attributes(self):
        return {"n_spo": 1, "delta_min": 0.5, "shape": (35, 25), "slices": None}


WHOLE = Space().window(slice(None), slice(None), slice(None))


@pytest.fixture
def store(tmp_path):
    scale_space_store.write_scale_space(Space(), tmp_path / "n1", {"image_sha256": "abc"}, tile=32)
    return tmp_path / "n1"


def test_scale_space_round_trip(store):
    space = scale_space_store.open_scale_space(store)
    assert space["dog"].dims == ("scale", "y", "x")
    np.testing.assert_array_equal(space["dog"].to_numpy(), WHOLE)
    assert space["dog"].dtype == np.float64
    for name in ("sigma", "y", "x"):
        np.testing.assert_array_equal(space[name].to_numpy(), getattr(Space, name))
    assert set(space.coords) == {"sigma", "y", "x"}
    assert space["dog"].sel(y=10.0, x=3.5, method="nearest")[1] == 1e6 + 20e3 + 7
    assert space.attrs["delta_min"] == 0.5 and space.attrs["image_sha256"] == "abc"
    assert space.attrs["shape"] == [35, 25] and "keystab_version" in space.attrs


@pytest.mark.parametrize("tile", [7, 32, 50, 128])
def test_tiling_does_not_show(tmp_path, tile):
    scale_space_store.write_scale_space(Space(), tmp_path, tile=tile)
    np.testing.assert_array_equal(
        scale_space_store.open_scale_space(tmp_path)["dog"].to_numpy(), WHOLE
    )


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("tile", "side"), [(32, 32), (60, 60), (128, 70)])
def test_tiles_are_no_larger_than_the_longer_side(tmp_path, tile, side, turned):
    class Oblong(Space):
        shape = (3, 50, 70) if turned else Space.shape
        y, x = (Space.x, Space.y) if turned else (Space.y, Space.x)

    scale_space_store.write_scale_space(Oblong(), tmp_path, tile=tile)
    chunks = scale_space_store.open_scale_space(tmp_path)["dog"].encoding["chunks"]
    assert tuple(chunks) == (3, side, side)


def test_windows_are_read_lazily_and_exactly(store):
    space = scale_space_store.StoredScaleSpace(store)
    box = (slice(1, 3), slice(30, 66), slice(40, 50))
    np.testing.assert_array_equal(space.window(*box), WHOLE[box])
    np.testing.assert_array_equal(space.window(), WHOLE)
    assert space.shape == Space.shape and space.attributes()["n_spo"] == 1


def test_few_files_and_no_temporary_ones(store):
    files = sorted(p.relative_to(store).as_posix() for p in store.rglob("*") if p.is_file())
    assert [f for f in files if f.startswith("data.zarr/dog/c/")] == [
        f"data.zarr/dog/c/0/{row}/0" for row in range(3)
    ]
    assert len(files) == 3 + 3 + 5  # rows of tiles, coordinates, descriptions
    assert os.listdir(store) == ["data.zarr"]


def test_one_row_of_tiles_at_a_time(tmp_path):
    asked = []

    class Watched(Space):
        def window(self, slices, rows, columns):
            asked.append((rows.start, rows.stop))
            return super().window(slices, rows, columns)

    scale_space_store.write_scale_space(Watched(), tmp_path, tile=32)
    assert asked == [(0, 32), (32, 64), (64, 70)]


def test_same_scale_space_same_bytes(store, tmp_path):
    scale_space_store.write_scale_space(
        Space(), tmp_path / "again", {"image_sha256": "abc"}, tile=32
    )
    assert checksums(tmp_path / "again") == checksums(store)


def test_an_older_store_is_replaced(store):
    class Other(Space):
        sigma = Space.sigma * 2

    scale_space_store.write_scale_space(Other(), store, tile=50)
    np.testing.assert_array_equal(scale_space_store.open_scale_space(store)["sigma"], Other.sigma)
    assert os.listdir(store) == ["data.zarr"]


def test_failing_writer_leaves_no_store(tmp_path):
    class Failing(Space):
        def window(self, slices, rows, columns):
            if rows.start:
                raise RuntimeError("halfway")
            return super().window(slices, rows, columns)

    with pytest.raises(RuntimeError, match="halfway"):
        scale_space_store.write_scale_space(Failing(), tmp_path / "n1", tile=32)
    assert os.listdir(tmp_path / "n1") == []


def test_killed_writer_leaves_no_store(tmp_path):
    script = """
        import os, signal, sys
        from pathlib import Path
        sys.path.insert(0, sys.argv[2])
        from test_stores import Space
        from keystab.io import scale_space_store

        class Killed(Space):
            def window(self, slices, rows, columns):
                if rows.start == 64:
                    os.kill(os.getpid(), signal.SIGKILL)
                return super().window(slices, rows, columns)

        scale_space_store.write_scale_space(Killed(), sys.argv[1], tile=32)
    """
    here = os.path.dirname(__file__)
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script), tmp_path, here], check=False
    )
    assert run.returncode == -signal.SIGKILL
    parts = list(tmp_path.iterdir())
    assert [p.name[:6] for p in parts] == [".part-"]
    assert list(parts[0].rglob("dog/c/0/*/0"))  # it had been writing
    with pytest.raises(InputError, match="no store of keystab here"):
        scale_space_store.open_scale_space(tmp_path)


def flip(path, position):
    data = bytearray(path.read_bytes())
    data[position] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("position", [0, 12345, -1, -30])  # values, values, shard index twice
def test_flipped_bit_raises(store, position):
    flip(store / "data.zarr" / "dog" / "c" / "0" / "1" / "0", position)
    space = scale_space_store.open_scale_space(store)
    with pytest.raises(ValueError, match=r".+"):
        space["dog"][:, 32:64].to_numpy()
    with pytest.raises(InputError, match=r"damaged data in the rows of tiles 1 to 1") as raised:
        scale_space_store.StoredScaleSpace(store).window(rows=slice(32, 64))
    assert "\n" not in str(raised.value)
    np.testing.assert_array_equal(space["dog"][:, 64:].to_numpy(), WHOLE[:, 64:])


def test_a_chunk_that_goes_while_the_store_is_open_raises(store):
    opened = scale_space_store.StoredScaleSpace(store)
    (store / "data.zarr" / "dog" / "c" / "0" / "1" / "0").unlink()
    with pytest.raises(InputError, match=r"tiles 1 to 1 \(parts of it are gone\); delete"):
        opened.window(rows=slice(32, 64))
    np.testing.assert_array_equal(opened.window(rows=slice(64, 96)), WHOLE[:, 64:96])


def test_flipped_bit_in_a_coordinate_raises(store):
    flip(store / "data.zarr" / "sigma" / "c" / "0", 3)
    with pytest.raises(ValueError, match="checksum"):
        scale_space_store.open_scale_space(store)["sigma"].to_numpy()


def test_missing_chunk_is_found_on_opening(store):
    (store / "data.zarr" / "dog" / "c" / "0" / "2" / "0").unlink()
    for opening in (
        scale_space_store.open_scale_space,
        scale_space_store.StoredScaleSpace,
        zarr_groups.attributes_of,
    ):
        with pytest.raises(InputError, match=r"dog/c/0/2/0 is missing; delete the store"):
            opening(store)


@pytest.mark.parametrize("name", ["dog", "sigma"])
def test_missing_array_is_found_on_opening(store, name):
    shutil.rmtree(store / "data.zarr" / name)
    with pytest.raises(InputError, match=rf"{name} is missing; delete the store"):
        scale_space_store.open_scale_space(store)


def test_cut_chunk_is_found_on_opening(store):
    chunk = store / "data.zarr" / "dog" / "c" / "0" / "0" / "0"
    os.truncate(chunk, chunk.stat().st_size - 1)
    with pytest.raises(InputError, match=r"dog/c/0/0/0 has \d+ bytes, not \d+"):
        scale_space_store.open_scale_space(store)


def test_writer_checks_that_every_chunk_is_there(tmp_path, monkeypatch):
    # A Zarr that skips chunks of zeros: the store must not appear.
    class Zeros(Space):
        def window(self, slices, rows, columns):
            return np.full_like(super().window(slices, rows, columns), np.nan)

    import zarr

    create = zarr.Group.create_array

    def skipping(self, *args, config, **options):
        return create(self, *args, config={"write_empty_chunks": False}, **options)

    monkeypatch.setattr(zarr.Group, "create_array", skipping)
    with pytest.raises(InputError, match="is missing"):
        scale_space_store.write_scale_space(Zeros(), tmp_path, tile=32)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("values", [0.0, math.nan])
def test_constant_scale_space_is_written_in_full(tmp_path, values):
    class Constant(Space):
        def window(self, slices, rows, columns):
            return np.full_like(super().window(slices, rows, columns), values)

    scale_space_store.write_scale_space(Constant(), tmp_path, tile=32)
    dog = scale_space_store.open_scale_space(tmp_path)["dog"].to_numpy()
    np.testing.assert_array_equal(dog, np.full(Space.shape, values))


def test_what_is_no_store_gets_one_line(store, tmp_path):
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "gone", tmp_path / "file", tmp_path):
        with pytest.raises(InputError, match="no store of keystab here"):
            scale_space_store.open_scale_space(path)
    with pytest.raises(InputError, match="a store of scale-space, not of views"):
        view_store.open_views(store)
    description = store / "data.zarr" / "zarr.json"
    for text in ("{", json.dumps({"zarr_format": 3}), "[]"):
        description.write_text(text)
        with pytest.raises(InputError, match="not a readable store|something else") as raised:
            scale_space_store.open_scale_space(store)
        assert "\n" not in str(raised.value)


def test_too_little_memory_is_said_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1000)
    with pytest.raises(InputError, match="of memory"):
        scale_space_store.write_scale_space(Space(), tmp_path)
    assert os.listdir(tmp_path) == []


SPECS = [
    ViewSpec(1.1, 10.0, (5, 8)),
    ViewSpec(0.5, 12.5, (4, 6), (0.25, -1.5), 0.1, 0.03, seed="noisy"),
]
IMAGES = [np.random.default_rng(k).random(spec.shape) for k, spec in enumerate(SPECS)]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_views_round_trip(tmp_path, dtype):
    view_store.write_views(iter(IMAGES), SPECS, tmp_path, {"set": "examples"}, dtype=dtype)
    views = view_store.open_views(tmp_path)
    assert views["image"].dims == ("view", "y", "x") and views["image"].dtype == dtype
    assert views["image"].shape == (2, 5, 8) and views.attrs["set"] == "examples"
    for k, image in enumerate(IMAGES):
        read = view_store.view(views, k)
        assert read.dtype == np.float64
        np.testing.assert_array_equal(read, image.astype(dtype))
    assert np.isnan(views["image"][1, 4:]).all() and np.isnan(views["image"][1, :, 6:]).all()
    assert {name: views[name].to_numpy().tolist() for name in views.coords} == {
        "blur": [1.1, 0.5],
        "step": [10.0, 12.5],
        "shift_y": [0.0, 0.25],
        "shift_x": [0.0, -1.5],
        "rotation": [0.0, 0.1],
        "noise": [0.0, 0.03],
        "height": [5, 4],
        "width": [8, 6],
    }


def test_views_are_checked(tmp_path):
    with pytest.raises(InputError, match="empty"):
        view_store.write_views([], [], tmp_path)
    with pytest.raises(InputError, match="float16"):
        view_store.write_views(IMAGES, SPECS, tmp_path, dtype="float16")
    with pytest.raises(InputError, match=r"view 0 has the shape \(4, 6\), not \(5, 8\)"):
        view_store.write_views(IMAGES[::-1], SPECS, tmp_path)
    with pytest.raises(ValueError, match="argument"):
        view_store.write_views(IMAGES[:1], SPECS, tmp_path)
    assert os.listdir(tmp_path) == []


def test_damaged_and_missing_views_are_found(tmp_path):
    view_store.write_views(IMAGES, SPECS, tmp_path)
    views = view_store.open_views(tmp_path)
    chunk = tmp_path / "data.zarr" / "image" / "c" / "1" / "0" / "0"
    flip(chunk, 7)
    with pytest.raises(InputError, match="view 1 is damaged"):
        view_store.view(views, 1)
    with pytest.raises(InputError, match="there is no view 2; the set has views 0 to 1"):
        view_store.view(views, 2)
    chunk.unlink()
    with pytest.raises(InputError, match="image/c/1/0/0 is missing"):
        view_store.open_views(tmp_path)


def test_a_store_that_lacks_a_part_is_named_by_that_part_alone(store):
    shutil.rmtree(store / "data.zarr/sigma")
    with pytest.raises(InputError) as raised:
        scale_space_store.open_scale_space(store)
    said = f"{store / 'data.zarr/sigma'} is missing; delete the store and make it again"
    assert str(raised.value) == said


def test_views_are_stored_in_the_types_that_are_named(tmp_path):
    spec = ViewSpec(1.1, 2.0, (4, 6))
    for dtype in ("float16", "int32", "f4"):
        with pytest.raises(InputError, match=f"not as {dtype}"):
            view_store.write_views([np.zeros((4, 6))], [spec], tmp_path / "a", {}, dtype)
    about = {"set": "a", "reference_blur": 0.0, "reference_shape": [40, 60]}
    for dtype in ("float32", "float64"):
        view_store.write_views([np.zeros((4, 6))], [spec], tmp_path / dtype, about, dtype)
        assert view_store.Views(tmp_path / dtype).reference_shape == (40, 60)
