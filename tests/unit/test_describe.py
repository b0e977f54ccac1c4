"""Stores and tables described in words."""

import numpy as np
import pandas as pd
import pytest

from keystab.camera.views import ViewSpec
from keystab.errors import InputError
from keystab.io import scale_space_store, view_store
from keystab.io.checksums import write_checksums
from keystab.io.describe import describe
from keystab.io.tables import write_table
from keystab.scalespace.dog import scale_space

IMAGE = np.random.default_rng(0).random((12, 16))


def test_scale_space(tmp_path):
    space = scale_space(IMAGE, camera_blur=0.5, n_spo=2, delta_min=0.5, sigma_min=1.0)
    scale_space_store.write_scale_space(space, tmp_path / "n2")
    text = describe(tmp_path / "n2")
    assert "difference-of-Gaussians scale-space" in text
    assert "4 slices, sigma 1 to 2.82843 pixels" in text
    assert "24 x 32 samples a slice, one every 0.5 pixels" in text
    assert "24.6 kB" in text
    assert "camera_blur: 0.5" in text and "oversampling: spline" in text
    assert text.endswith("no checksums beside it; every chunk is there")
    write_checksums(tmp_path / "n2", tmp_path / "n2.sha256")
    assert describe(tmp_path / "n2").endswith("all files agree with the checksums beside it")
    (tmp_path / "n2" / "data.zarr" / "extra").write_text("x")
    with pytest.raises(InputError, match="extra was not there"):
        describe(tmp_path / "n2")


def test_views(tmp_path):
    specs = [ViewSpec(blur, 10.0, (12, 16)) for blur in (0.5, 1.1)]
    view_store.write_views([IMAGE, IMAGE], specs, tmp_path, {"set": "examples"})
    text = describe(tmp_path)
    assert "2 simulated views of float32" in text
    assert "camera blur 0.5 to 1.1 pixels" in text and "step 10 reference pixels" in text
    assert "set: examples" in text


def test_keypoints(tmp_path):
    table = pd.DataFrame(
        {
            "y": [1.5, 2.5, 9.0],
            "x": [4.0, np.nan, 3.0],
            "sigma": [1.1, 1.2, 2.0],
            "sign": [1, -1, 1],
        }
    )
    write_table(table.assign(feature=["dog", "dog", "laplacian"]), tmp_path / "k.csv")
    text = describe(tmp_path / "k.csv")
    assert "table of 3 keypoints" in text and "2 maxima, 1 minimum\n" in text
    assert "  y: 1.5 to 9\n" in text and "  x: 3 to 4, 1 missing\n" in text
    assert text.endswith("  feature: 2 values")


def test_other_tables_and_groups(tmp_path):
    write_table(pd.DataFrame({"auc": [0.5]}), tmp_path / "t.parquet")
    assert "table of 1 row\n" in describe(tmp_path / "t.parquet")
    import zarr

    zarr.create_group(tmp_path / "other", zarr_format=3)
    with pytest.raises(InputError, match="none that keystab wrote"):
        describe(tmp_path / "other")


def test_text_in_the_columns_of_keypoints_is_no_error(tmp_path):
    names = ["y", "x", "sigma", "sign"]
    write_table(pd.DataFrame([["a", "b", "c", "plus"]] * 2, columns=names), tmp_path / "t.csv")
    text = describe(tmp_path / "t.csv")
    assert "table of 2 rows\n" in text and "  sign: 1 value" in text
    write_table(pd.DataFrame([[1.0, 2.0, 1.1, "plus"]], columns=names), tmp_path / "t.csv")
    assert describe(tmp_path / "t.csv").splitlines()[0].endswith("table of 1 keypoint")
    write_table(pd.DataFrame([], columns=names), tmp_path / "t.csv")
    assert "table of 0 keypoints\n  0 maxima, 0 minima" in describe(tmp_path / "t.csv")
    write_table(pd.DataFrame([[1.0, 2.0, 1.1, -1]], columns=names), tmp_path / "t.csv")
    assert "  0 maxima, 1 minimum\n" in describe(tmp_path / "t.csv")
