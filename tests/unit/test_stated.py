"""What the text states of the camera and of single views, against closed forms."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.special import erf

from keystab.camera.aliasing import aliased_energy
from keystab.camera.simulation import Scene, simulate
from keystab.camera.views import ViewSpec
from keystab.errors import InputError
from keystab.experiments.camera_blur import range_table
from keystab.experiments.camera_statements import aliasing_table, wrong_blur_table
from keystab.experiments.dead_range import dead_range_row
from keystab.experiments.first_view import against_first
from keystab.experiments.interpolation_stability import interpolation_table, rank_interval
from keystab.experiments.reference_noise import noise_seen, reference_noise_table
from keystab.experiments.view_stability import scale_table
from keystab.experiments.zoom_invariance import zoom_table, zoomed_views
from keystab.io.checksums import write_checksums
from keystab.io.pictures import write_picture
from keystab.io.view_store import write_views
from keystab.matching.common_range import CommonRange
from keystab.stages import view_statements
from keystab.truth.true_extrema import true_extrema


@pytest.mark.parametrize("blur", [0.3, 0.5, 0.7])
def test_of_a_flat_spectrum_the_blur_leaves_its_error_function(blur):
    # Equal energy per frequency: of the Gaussian's, erf(2 pi c f)^2 lies below a frequency of f.
    n, step = 800, 10.0
    coefs = np.ones((n, n))
    coefs[0, :] /= 2  # the trapezoidal rule
    coefs[:, 0] /= 2
    end = 0.5 + step / (4 * n)  # between the last frequency within and the first beyond
    energy = aliased_energy(coefs, blur, step)
    expected = 1 - erf(2 * math.pi * blur * end) ** 2
    assert energy.aliased / energy.view == pytest.approx(expected, rel=2e-3)


def test_a_folded_wave_has_the_difference_of_gaussians_of_where_it_is_folded_to():
    coefs = np.zeros((1, 100))
    coefs[0, 14] = 1.0  # 0.7 cycles per pixel of the view, seen as 0.3
    energy = aliased_energy(coefs, 0.4, 10.0, sigma=1.1, kappa=1.25)
    gain = math.exp(-0.5 * (0.4 * 2 * math.pi * 0.7) ** 2)
    wide, narrow = (
        math.exp(-(s**2 - 0.16) / 2 * (2 * math.pi * 0.3) ** 2) for s in (1.25 * 1.1, 1.1)
    )
    assert energy.view == energy.aliased == pytest.approx(0.5 * gain**2)
    assert energy.dog == energy.aliased_dog == pytest.approx(0.5 * (gain * (wide - narrow)) ** 2)


def test_the_energy_of_a_view_is_that_of_its_pixels():
    # A scene without what could be aliased, seen whole: Parseval.
    coefs = np.zeros((60, 80))
    coefs[:6, :8] = np.random.default_rng(0).standard_normal((6, 8))
    scene = Scene(np.eye(60, 80))
    scene.coefficients = coefs
    view = simulate(scene, ViewSpec(0.5, 10.0, (6, 8)))
    table = aliasing_table(scene, [0.5], 10.0, 1.1, 1.25)
    assert table["contrast"].item() == pytest.approx(view.std(), rel=1e-12)
    assert table["aliased"].item() == 0


def test_more_blur_leaves_less_aliasing():
    scene = Scene(np.random.default_rng(3).random((50, 70)))
    table = aliasing_table(scene, [0.2, 0.4, 0.6, 0.8, 1.0], 4.0, 1.1, 1.26)
    assert (np.diff(table["aliased_share"]) < 0).all()
    # What is folded back lies near half a cycle, where there is little of a difference of Gaussians.
    assert (table["aliased_share_dog"] < 1).all()


def smooth_scene(shape=(400, 480), seed=5):
    """A scene of frequencies that no view of step 5 aliases."""
    coefs = np.zeros(shape)
    coefs[:60, :70] = np.random.default_rng(seed).standard_normal((60, 70)) / 200
    scene = Scene(np.zeros((2, 2)))
    scene.coefficients = coefs
    return scene


def test_without_aliasing_a_wrong_blur_dilates_the_scale_space_exactly():
    table = wrong_blur_table(smooth_scene(), ViewSpec(0.8, 5.0, (80, 96)), [0.4, 1.1], [1.1, 2.2])
    assert (table["difference"] < 1e-9).all() and (table["undilated"] > 1e-3).all()
    np.testing.assert_allclose(
        table["dilated"] ** 2 - 0.64, table["sigma"] ** 2 - table["assumed"] ** 2, atol=1e-12
    )
    with pytest.raises(InputError, match="no pixel"):
        wrong_blur_table(smooth_scene(), ViewSpec(0.8, 5.0, (20, 20)), [0.4], [2.2])


def test_without_aliasing_true_extrema_are_invariant_to_zoom():
    spec = ViewSpec(1.1, 6.25, (40, 48))
    scene = smooth_scene((250, 300))
    everywhere, ends = zoomed_views(spec, [1.25], scene.shape, 1.1, 1.26)
    true = [
        true_extrema(simulate(scene, view), 1.1, *own, 1.26, n_spo=[5])
        for view, own in zip(everywhere.specs, ends, strict=True)
    ]
    row = zoom_table(true, everywhere, {"kappa": 1.26}).iloc[0]
    assert row["n_first"] > 5 and row["share_found"] == 1
    assert max(row["q95_scale"], row["q95_location"]) < 1e-4


def test_noise_of_the_reference_arrives_in_the_view_as_theory_says():
    assert noise_seen(0.01, 0.5, 10.0) == pytest.approx(
        0.01 * math.sqrt(1 / (4 * math.pi * 5.0**2))
    )
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:300, :360]
    scene = 0.5 + 0.2 * np.sin(x / 9) * np.cos(y / 8) + 0.02 * rng.standard_normal(y.shape)
    table = reference_noise_table(
        scene, ViewSpec(1.1, 4.0, (75, 90)), [0.5, 1.0], {"n_spo": 3, "sigma_min": 1.1},
        {"border": 3.0, "first_scale": 1.26, "last_scale": None}, {},
    )  # fmt: skip
    assert table["noise_reference"].to_numpy() == pytest.approx(0.02, rel=0.05)
    np.testing.assert_allclose(table["noise_view"], table["noise_theory"], rtol=0.1)
    assert (table["n_first"] > 5).all() and table["share_found"].between(0.3, 1).all()


def test_the_dead_range_ends_half_a_step_above_the_first_scale():
    row = dead_range_row([1.3, 1.59], [1.1, 1.13, 2.0], n_spo=3, sigma_min=1.0)
    assert row["end"] == pytest.approx(2 ** (1 / 6))
    assert (row["below_discrete"], row["below_refined"], row["n_refined"]) == (0, 1, 3)
    assert row["low_below"] < 1 / 3 < row["high_below"]
    assert np.isnan(dead_range_row([], [], 3, 1.0)["share_below"])


def test_cameras_in_focus_have_blurs_from_that_of_a_pixel():
    table = range_table([1.4, 4.0, 16.0], [4.0, 20.0], [20.0], shares=[0.0, 0.5, 1.0])
    assert (table["smallest"] <= table["largest"]).all()
    assert table["defocus"].tolist() == [0.0, 14.0, 28.0] * 2
    for _, rows in table.groupby("pitch"):
        assert rows["largest"].is_monotonic_increasing
    large = table[table["pitch"] == 20].iloc[0]  # of large pixels the lens does not matter
    assert large["smallest"] == pytest.approx(0.358, abs=0.002) and large["f_smallest"] == 1.4
    with pytest.raises(InputError, match="shares"):
        range_table([1.4], [4.0], [20.0], shares=[-1.0])


@pytest.mark.parametrize(("n", "share"), [(6, 0.5), (100, 0.5), (333, 0.5), (250, 0.95)])
def test_the_interval_of_a_quantile_holds_it_as_often_as_it_says(n, share):
    draws = np.random.default_rng(n).random((1000, n))
    ends = [rank_interval(draw, share) for draw in draws]
    assert 0.935 <= np.mean([low <= share <= high for _, low, high in ends]) < 1


def views(n, shape=(60, 60)):
    return CommonRange([ViewSpec(1.1, 1.0, shape)] * n, shape, 3.0, 1.0, 4.0)


def test_counterparts_may_lie_beyond_the_range_that_is_asked_for():
    points = {
        "view": [0, 0, 1, 1],
        "y": [20.0, 40, 20, 40],
        "x": [20.0, 40, 20, 40],
        "sigma": [3.9, 2.0, 4.2, 2.2],
    }
    table = against_first(pd.DataFrame(points), views(3), {}, {"name": "a"})
    assert table["name"].tolist() == ["a"] * 3
    assert table["share_found"].tolist() == [1, 1, 0]
    # Of the second view one keypoint alone lies in the range.
    assert table["n_view"].tolist() == [2, 1, 0] and table["share_right"].iloc[1] == 1
    shifts = np.log2([4.2 / 3.9, 2.2 / 2.0])
    assert table["scale_shift"].iloc[1] == pytest.approx(shifts.mean())
    assert table["distance"].iloc[2] is not None and np.isnan(table["distance"].iloc[2])


def test_accepted_extrema_and_the_spread_of_their_positions_are_counted():
    shape = {"h_ss": 1.0, "h_yy": 2.0, "h_xx": 4.0, "h_sy": 0.0, "h_sx": 0.0, "h_yx": 0.0}
    extrema = pd.DataFrame(
        {
            "view": [0, 1, 0, 1],
            "y": [20.0, 20, 40, 40],
            "x": 20.0,
            "sigma": 2.0,
            "step_sigma": 2.0,
            "value": 1.0,
            **shape,
        }
    )
    traces = pd.DataFrame(
        {
            "keypoint": [0, 1, 2, 3],
            "model": 1,
            "alpha_s": [0.1, 0.1, 0.9, 0.1],
            "alpha_y": 0.0,
            "alpha_x": 0.0,
            "y": [20.0, 20.2, 40, 40],
            "x": 20.0,
            "sigma": 2.0,
            "value": 1.0,
        }
    )
    limits = {"max_offset": 0.6, "max_iterations": 2}
    row = interpolation_table(extrema, traces, views(2), limits, {}, {"n_spo": 3}).iloc[0]
    assert (row["n_spo"], row["n_extrema"], row["n_accepted"], row["n_keypoints"]) == (3, 4, 3, 1)
    assert row["condition"] == pytest.approx(4.0) and row["share_accepted"] == 0.75
    assert row["spread"] == pytest.approx(0.2 / math.sqrt(2))


def test_octaves_are_compared_in_pixels_of_the_view_and_in_their_own():
    # Two views in which a keypoint of the second octave lies 1.5 pixels apart.
    table = pd.DataFrame({"view": [0, 1], "y": [30.0, 31.5], "x": [30.0, 30], "sigma": [5.0, 5]})
    rows = scale_table(table, views(2), [2.0, 4.0], {}, 0.7, {}, 100, unit=2.0)
    assert rows["pixels_of"].tolist() == ["view", "view", "octave", "octave"]
    assert rows["space_tolerance"].tolist() == [1.0, 1.0, 1.0, 2.0]
    assert rows["n_unique"].tolist() == [0, 2, 0, 1] and rows["n_seen"].tolist() == [0, 0, 0, 1]
    plain = scale_table(table, views(2), [2.0, 4.0], {}, 0.7, {}, 100)
    assert "pixels_of" not in plain and plain.equals(rows.iloc[:2][plain.columns])


@pytest.mark.slow
def test_the_stage_writes_a_table_for_each_question(tmp_path):
    scene = np.random.default_rng(1).random((300, 360))
    write_picture(scene / scene.max(), tmp_path / "scene.tif")
    spec = ViewSpec(1.1, 3.0, (100, 120))
    store = {"set": "still", "reference_blur": 0.0, "reference_shape": list(scene.shape)}
    write_views([simulate(scene, spec)], [spec], tmp_path / "views", store)
    write_checksums(tmp_path / "views", tmp_path / "views.sha256")
    tables = {
        name: tmp_path / f"{name}.csv" for name in ("aliasing", "wrong_blur", "zoomed", "noisy")
    }
    arguments = [
        *("--reference", str(tmp_path / "scene.tif"), "--views", str(tmp_path / "views")),
        *("--views-digest", str(tmp_path / "views.sha256"), "--n-spo", "3"),
        *("--sigma-min", "1.1", "--kappa", "1.26", "--oversampling", "spline", "--epsilon", "0.0"),
        *("--max-offset", "0.6", "--max-iterations", "2", "--scale-moves", "True"),
        *("--move", "nearest", "--border", "3.0", "--first-scale", "1.26", "--last-scale", "None"),
        *("--space-tolerance", "1.0", "--scale-ratio", "1.4", "--match-sign", "False"),
        *("--camera-blurs", "0.5", "1.1", "--assumed-blurs", "0.7", "--zooms", "1.25"),
        *("--kappas", "1.26", "--noise-factors", "1.0"),
        *(text for name, path in tables.items() for text in (f"--{name.replace('_', '-')}", str(path))),
    ]  # fmt: skip
    assert view_statements.main(arguments) == 0
    found = {name: pd.read_csv(path) for name, path in tables.items()}
    assert found["aliasing"]["blur"].tolist() == [0.5, 1.1]
    assert found["wrong_blur"]["sigma"].tolist() == [1.1, 2.2]
    assert found["zoomed"]["zoom"].tolist() == [1.25] and found["noisy"]["factor"].tolist() == [1.0]
