"""Each figure draws the numbers of its tables, and says which numbers it cannot draw."""

import figure_tables
import numpy as np
import pandas as pd
import pytest
from figure_tables import GRID
from figure_tables import without_layout as drawn
from matplotlib.colors import to_rgb
from numpy.testing import assert_allclose, assert_array_equal

from keystab.errors import InputError
from keystab.figures import (
    fig1,
    fig2,
    fig3,
    fig4,
    fig5,
    fig6,
    fig7,
    fig8,
    fig9,
    fig10,
    fig11,
    fig12,
    figs2,
    figs3,
    figs4,
    figs5,
    palette,
    style,
)
from keystab.figures._occurrence import occurrence
from keystab.figures.style import spread


@pytest.fixture(autouse=True)
def without_layout(monkeypatch):
    """Leave out where things go, which takes half of the time of drawing and changes no number."""
    monkeypatch.setattr(style, "settle", lambda figure, draft=False: figure)


def panel(figure, name):
    (ax,) = [ax for ax in figure.axes if ax.get_label() == name]
    return ax


def line(ax, label):
    (found,) = [line for line in ax.get_lines() if line.get_label() == label]
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def test_figure_1_draws_blurs_errors_and_residuals():
    tables, figure = drawn(1)
    for method, name in fig1.PANELS.items():
        rows = tables["fig1"].query("method == @method")
        for column in ("repeated_blur", "single_blur", "theory"):
            sigma, added = line(panel(figure, name), column)
            assert_array_equal(sigma, rows["sigma"])
            assert_allclose(added**2 + 1.1**2, np.maximum(rows[column] ** 2, 1.1**2))
        assert_array_equal(line(panel(figure, "e"), method)[1], rows["residual"])
        error = abs(rows["repeated_blur"] / rows["theory"] - 1)
        assert_array_equal(line(panel(figure, "d"), method)[1], error)
    assert_allclose(line(panel(figure, "b"), "theory")[1], np.sqrt(10) * rows["sigma"])


def test_figure_1_names_a_missing_method():
    table = figure_tables.fig1()["fig1"]
    with pytest.raises(InputError, match="no rows of the method dct"):
        fig1.draw({"fig1": table[table["method"] != "dct"]})


def test_figure_2_shows_the_pixels_and_one_detail_of_the_scene():
    tables, figure = drawn(2)
    scene = []
    for k, view in tables["fig2"].iterrows():
        whole, detail = panel(figure, "abc"[k]), panel(figure, f"detail {k}")
        pixels = tables["fig2_pixels"].query("view == @k").sort_values(["y", "x"])["value"]
        shape = (view["height"], view["width"])
        assert_array_equal(whole.images[0].get_array(), pixels.to_numpy().reshape(shape))
        assert_array_equal(detail.images[0].get_array(), whole.images[0].get_array())
        assert (whole.images[0].norm.vmin, whole.images[0].norm.vmax) == (0.0, 1.0)
        (left, right), (bottom, top) = detail.get_xlim(), detail.get_ylim()
        assert -0.5 <= left < right <= shape[1] - 0.5 and -0.5 <= top < bottom <= shape[0] - 0.5
        middle = (np.array([shape[1], shape[1], shape[0], shape[0]]) - 1) / 2
        scene.append((np.array([left, right, top, bottom]) - middle) * view["step"])
        assert f"$c$ = {view['blur']}" in whole.get_title(loc="left")
    assert_allclose(scene, [scene[0]] * 3)


def test_figure_2_refuses_missing_and_repeated_pixels():
    tables = figure_tables.fig2()
    pixels = tables["fig2_pixels"]
    repeated = pd.concat([pixels.iloc[1:], pixels.iloc[1:2]])
    for wrong in (pixels.iloc[1:], repeated, pixels.assign(y=pixels["y"] + 1)):
        with pytest.raises(InputError, match="view 0 needs 113 x 200 pixels"):
            fig2.draw(tables | {"fig2_pixels": wrong})


def test_figure_3_draws_the_grid_on_one_scale_and_the_curve():
    tables, figure = drawn(3)
    table = tables["fig3"]
    shared = table[table.groupby("delta_min")["n_spo"].transform("nunique") > 1]
    maps = {column: name for column, (name, _) in fig3.COUNTS.items()}
    scales = set()
    for column, name in (maps | {"median_condition": "d"}).items():
        (mesh,) = panel(figure, name).collections
        expected = shared.pivot(index="delta_min", columns="n_spo", values=column)
        assert_array_equal(np.asarray(mesh.get_array()), expected)
        written = [text.get_text() for text in panel(figure, name).texts]
        assert len(written) == expected.size
        scales.add((mesh.norm.vmin, mesh.norm.vmax) if name in "abc" else None)
        assert name in "abc" or type(mesh.norm).__name__ == "LogNorm"
    assert scales == {(table["n_unique"].min(), shared["n_extrema"].max()), None}
    curve = table[table["balanced"]]
    assert_array_equal(line(panel(figure, "e"), "balanced"), curve[["n_spo", "delta_min"]].T)
    conditions = line(panel(figure, "e condition"), "median_condition")
    assert_array_equal(conditions, curve[["n_spo", "median_condition"]].T)


def test_figure_3_outlines_sift_and_follows_the_balanced_cells():
    ax = panel(drawn(3)[1], "b")
    (outline,) = [patch for patch in ax.patches if patch.get_label() == "SIFT"]
    # n_spo = 3 is the first column; 1/2 is the largest step, so the top row.
    assert outline.get_xy() == pytest.approx((0.0, len(GRID) - 1))
    x, y = line(ax, "balanced")
    # The steps of the grid are the balanced ones of its n_spo: the curve is its diagonal.
    assert_allclose(x + y, len(GRID), atol=1e-9)
    assert ((abs(x % 1 - 0.5) > 0.3) | (abs(y % 1 - 0.5) > 0.2)).all()  # off the numbers


def test_figure_3_needs_a_grid_and_a_curve():
    table = figure_tables.fig3()["fig3"]
    with pytest.raises(InputError, match="no row is marked balanced"):
        fig3.draw({"fig3": table.assign(balanced=False)})
    with pytest.raises(
        InputError, match="no sampling has an extremum, so there is nothing to draw"
    ):
        fig3.draw({"fig3": table.assign(n_extrema=0, median_condition=np.nan)})
    with pytest.raises(InputError, match="there is no grid"):
        fig3.draw({"fig3": table[table["balanced"]]})


def test_figure_4_draws_counts_and_rates():
    tables, figure = drawn(4)
    counts = tables["fig4_counts"]
    for column in ("n_extrema", "n_common"):
        assert_array_equal(line(panel(figure, "a"), column), counts[["n_spo", column]].T)
    for change in ("new", "lost"):
        n_spo, rate = line(panel(figure, "b"), change)
        assert_array_equal(rate, 100 * counts[f"{change}_rate"])
        assert np.isnan(rate).sum() == 1
    assert len(panel(figure, "b").collections) == 2  # the two bands


def test_figure_4_orders_and_colours_columns_by_stability():
    tables, figure = drawn(4)
    detected = tables["fig4_occurrence"].pivot(index="n_spo", columns="keypoint", values="detected")
    first = panel(figure, "c").images[0].get_array()
    assert_array_equal(np.ma.filled(first, 0.0), detected)
    second = panel(figure, "d").images[0].get_array()
    stability = second.max(axis=0)
    assert (np.diff(stability) >= 0).all()
    assert_array_equal((~np.ma.getmaskarray(second)).sum(axis=0), np.round(17 * stability))
    assert_array_equal(np.sort(tables["fig4_keypoints"]["stability"]), stability)
    ends, _ = line(panel(figure, "d"), "stable")
    assert ends[1] - ends[0] == (stability > 0.8).sum()


def test_figure_4_refuses_an_occurrence_matrix_with_holes():
    tables = figure_tables.fig4()
    with pytest.raises(InputError, match="lacks some pairs"):
        fig4.draw(tables | {"fig4_occurrence": tables["fig4_occurrence"].iloc[1:]})


def test_figure_4_says_the_shares_of_the_summary():
    tables, figure = drawn(4)
    share = tables["fig4_summary"].set_index("quantity")["value"].mul(100).round()
    low, high = (text.get_text() for text in panel(figure, "d").texts)
    assert low == f"at less than 20 % of the samplings: {share['share_unstable']:.0f} %"
    assert high.startswith(f"at more than 80 % of the samplings: {share['share_stable']:.0f} %")
    assert high.endswith(f"at all of them: {share['share_always']:.0f} %")
    with pytest.raises(InputError, match="lacks the quantity share_always"):
        fig4.draw(
            tables | {"fig4_summary": tables["fig4_summary"].query("quantity != 'share_always'")}
        )


def test_figure_5_draws_shares_and_roc():
    tables, figure = drawn(5)
    for feature, (name, _) in fig5.PANELS.items():
        rows = tables["fig5_thresholds"].query("feature == @feature")
        for group in ("stable", "unstable"):
            threshold, share = line(panel(figure, name), group)
            assert_array_equal(threshold, rows["threshold"])
            assert_array_equal(share, 100 * rows[f"{group}_below"])
        curve = np.array(line(panel(figure, "e"), feature))
        rows = tables["fig5_roc"].query("feature == @feature")
        expected = 100 * rows[["specificity", "sensitivity"]].to_numpy().T
        order = np.lexsort((-expected[1], expected[0]))
        assert_array_equal(curve, expected[:, order])
    assert_array_equal(line(panel(figure, "e"), "chance"), [[0, 100], [100, 0]])


def test_figure_5_lists_the_areas_best_first():
    tables, figure = drawn(5)
    texts = panel(figure, "areas").texts[1:]
    areas = [float(text.get_text()[:4]) for text in texts]
    assert areas == sorted(areas, reverse=True)
    assert_allclose(areas, np.sort(tables["fig5_auc"]["auc"])[::-1], atol=0.005)
    assert {text.get_color() for text in texts} == set(palette.FEATURE_COLOURS.values())


def test_figure_5_names_a_missing_feature():
    tables = figure_tables.fig5()
    roc = tables["fig5_roc"].query("feature != 'laplacian'")
    with pytest.raises(InputError, match=r"^fig5_roc.csv: has no rows of the feature laplacian"):
        fig5.draw(tables | {"fig5_roc": roc})


def volume(surface):
    """Return six times the signed volume: positive when the faces look outwards."""
    corner = surface.corners[surface.faces]
    return float(np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_surface_of_an_ellipsoid_encloses_its_volume(sign):
    s, y, x = np.meshgrid(*[np.arange(-12.0, 13.0)] * 3, indexing="ij")
    cube = sign * np.exp(-0.5 * ((s / 4) ** 2 + (y / 6) ** 2 + (x / 8) ** 2))
    own, others = fig6.iso_surfaces(cube, sign * np.exp(-0.5))  # semi-axes 4, 6 and 8
    assert others is None
    # The chords of a unit grid cut 2 % off a body of this size.
    assert volume(own) == pytest.approx(4 / 3 * np.pi * 4 * 6 * 8, rel=0.03)
    assert_allclose(np.abs(own.corners).max(axis=0), [8, 6, 4], atol=0.05)


def test_a_surface_that_leaves_the_cube_is_closed_by_its_sides():
    s, y, x = np.meshgrid(*[np.arange(-5.0, 6.0)] * 3, indexing="ij")
    own, _ = fig6.iso_surfaces(np.exp(-0.5 * (s**2 + y**2) / 4) + 0 * x, np.exp(-0.5))
    sides = np.sort(own.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(sides, axis=0, return_counts=True)
    assert (uses == 2).all()  # every edge has a triangle on both sides
    assert volume(own) == pytest.approx(np.pi * 4 * 10, rel=0.06)  # radius 2, length 10


def test_parts_that_do_not_hold_the_keypoint_are_kept_apart():
    s, y, x = np.meshgrid(*[np.arange(-12.0, 13.0)] * 3, indexing="ij")

    def bump(x0, width):
        return np.exp(-0.5 * (s**2 + y**2 + (x - x0) ** 2) / width**2)

    own, others = fig6.iso_surfaces(bump(0, 2) + bump(8, 1.5), 0.5)
    assert own.corners[:, 0].max() < 4 < others.corners[:, 0].min()
    assert volume(others) > 0


def test_figure_6_draws_a_coloured_surface_per_keypoint_from_one_view():
    tables, figure = drawn(6)
    assert len(figure.axes) == 4
    assert {(ax.elev, ax.azim) for ax in figure.axes} == {tuple(fig6.VIEW.values())}
    assert [line.get_label() for line in figure.axes[0].get_lines()][-3:] == [
        "$x$",
        "$y$",
        r"$\sigma$",
    ]
    for row in tables["fig6"].to_dict("records"):
        ax = panel(figure, f"panel {row['panel']}")
        (surface,) = ax.collections
        hue = np.array(to_rgb(palette.SURFACE_COLOURS[row["group"]]))
        shades = surface.get_facecolor()[:, :3] / hue
        own = np.ptp(shades, axis=1) < 1e-9  # the group's colour, darkened
        cube = tables["fig6_cubes"].query("panel == @row['panel']")["value"].to_numpy()
        expected, _ = fig6.iso_surfaces(cube.reshape(11, 11, 11), row["level"])
        assert own.sum() == len(expected.faces)
        assert surface.get_rasterized()
        assert ax.get_title().startswith(f"{100 * row['stability']:.0f} %")


def test_figure_6_names_what_is_wrong_with_a_cube():
    tables = figure_tables.fig6(per_group=1, half=3)
    cubes, panels = tables["fig6_cubes"], tables["fig6"]
    with pytest.raises(InputError, match="panel 0 needs 7\\^3 finite values"):
        fig6.draw(tables | {"fig6_cubes": cubes.drop(index=5)})
    with pytest.raises(InputError, match="no cube for panel 1"):
        fig6.draw(tables | {"fig6_cubes": cubes.query("panel == 0")})
    with pytest.raises(InputError, match="the group unstable is empty"):
        fig6.draw(tables | {"fig6": panels.query("group == 'stable'")})
    centre = cubes.query("panel == 0 and k_s == 0 and k_y == 0 and k_x == 0")["value"].item()
    with pytest.raises(InputError, match="is the value of the keypoint"):
        fig6.draw(tables | {"fig6": panels.assign(level=centre)})


def end_texts(ax):
    """Return the texts to the right of a panel, as drawn, with their heights in points."""
    labels = [text for text in ax.texts if getattr(text, "xyann", (0,))[0] >= 10]
    return [(text.get_text(), text) for text in labels]


def test_figure_7_draws_a_curve_for_every_choice():
    tables, figure = drawn(7)
    curves = tables["fig7_curves"]
    for n_spo, name in ((3, "a"), (15, "b")):
        for n_models, row in ((1.0, name), (2.0, f"{name} 2"), (np.inf, f"{name} ∞")):
            ax = panel(figure, row)
            here = curves[curves["n_spo"] == n_spo]
            expected = {"discrete": here[here["detections"] == "discrete"]}
            for max_offset in figure_tables.OFFSETS:
                mine = (here["max_offset"] == max_offset) & (here["max_iterations"] == n_models)
                expected[style.limit(max_offset)] = here[mine]
            columns = ["percentage_of_images", "percentage_of_unique"]
            for label, rows in expected.items():
                assert len(rows) == figure_tables.VIEWS
                assert_array_equal(line(ax, label), rows[columns].T)
            assert len(ax.get_lines()) == len(ax.collections) == 5  # a band each
            written = [text for text, _ in end_texts(ax)]
            for rows in expected.values():
                assert f"{rows['n_unique'].iloc[-1]} of {rows['n_unique'].iloc[0]}" in written


def test_figure_7_counts_what_is_seen_in_all_views():
    tables, figure = drawn(7)
    ax = panel(figure, "e")
    counts = tables["fig7_counts"].query("n_spo in (3, 15)")
    refined = counts[counts["detections"] == "refined"]
    assert len(refined) == 24
    places = set()
    for row in refined.to_dict("records"):
        limits = [style.limit(row[name]) for name in ("max_offset", "max_iterations")]
        (x,), (number,) = line(ax, " ".join([str(row["n_spo"]), *limits]))
        places.add(x)
        assert number == row["n_always"]
        (dot,) = [
            one
            for one in ax.get_lines()
            if one.get_label() == " ".join([str(row["n_spo"]), *limits])
        ]
        assert dot.get_color() == palette.offset_colour(row["max_offset"])
    assert len(places) == 24
    for n_spo, always in counts.query("detections == 'discrete'")[["n_spo", "n_always"]].to_numpy():
        assert_array_equal(line(ax, f"{n_spo} discrete")[1], [always, always])
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["1", "2", "∞"] * 2


def test_figure_7_shows_sift_as_shipped_beside_the_usual_refinement():
    tables, figure = drawn(7)
    ax = panel(figure, "f")
    for name in ("unfiltered", "filtered"):
        rows = tables["fig7_shipped"].query("shipped == @name")
        assert_array_equal(line(ax, name)[1], rows["percentage_of_unique"])
    usual = tables["fig7_curves"].query("n_spo == 3 and max_offset == 0.6 and max_iterations == 2")
    assert_array_equal(line(ax, "as in (a)")[1], usual["percentage_of_unique"])


def test_figure_7_takes_the_usual_refinement_from_its_tables():
    tables = figure_tables.tables(7)
    precision = tables["fig7_precision"].copy()
    refined = precision["detections"] == "refined"
    precision.loc[refined, ["max_offset", "max_iterations"]] = (np.inf, 1.0)
    figure = fig7.draw(tables | {"fig7_precision": precision})
    usual = tables["fig7_curves"].query("n_spo == 3 and max_offset == inf and max_iterations == 1")
    assert_array_equal(line(panel(figure, "f"), "as in (a)")[1], usual["percentage_of_unique"])
    precision.loc[refined, "max_offset"] = 0.7  # of no curve
    with pytest.raises(InputError, match="not of one refinement"):
        fig7.draw(tables | {"fig7_precision": precision})


def test_figure_7_draws_a_picture_of_which_sift_keeps_nothing():
    tables = figure_tables.tables(7)
    shipped = tables["fig7_shipped"].copy()
    nothing = shipped["shipped"] == "filtered"
    shipped.loc[nothing, ["percentage_of_unique", "low", "high"]] = np.nan
    shipped.loc[nothing, "n_unique"] = 0
    figure = fig7.draw(tables | {"fig7_shipped": shipped})
    written = [text.get_text() for text in panel(figure, "f").texts]
    assert "filtered" in written
    assert "0 of 0" in written


def test_figure_7_names_curves_that_are_missing():
    tables = figure_tables.tables(7)
    curves, shipped = tables["fig7_curves"], tables["fig7_shipped"]
    for wrong, message in (
        ({"fig7_curves": curves.query("n_spo == 3")}, "refined extrema of 1 samplings"),
        (
            {"fig7_curves": curves.query("n_spo == 3 or detections != 'discrete'")},
            "no discrete extrema of 15 scales",
        ),
        ({"fig7_shipped": shipped.query("shipped == 'filtered'")}, "no rows of unfiltered"),
    ):
        with pytest.raises(InputError, match=message):
            fig7.draw(tables | wrong)


@pytest.mark.parametrize(
    ("n", "stem", "panels"), [(7, "fig7", "cd"), (8, "fig8", "bc"), ("S1", "figS1", "bc")]
)
def test_precision_is_drawn_on_logarithmic_axes(n, stem, panels):
    tables, figure = drawn(n)
    for name, quantity in zip(panels, ("location", "log2_sigma"), strict=True):
        ax = panel(figure, name)
        assert ax.get_yscale() == "log"
        table = tables[f"{stem}_precision"].query("quantity == @quantity")
        for detections in ("discrete", "refined"):
            rows = table.query("detections == @detections")
            assert_array_equal(line(ax, detections), rows[["n_spo", "mean"]].T)
            if quantity == "location":
                assert_array_equal(line(ax, f"{detections}, median")[1], rows["median"])
        low, high = ax.get_ylim()
        assert low < table["low"].min() and table["high"].max() < high
        assert low > 0.1 * table["low"].min()  # not down to the medians of grid scales, which are 0


@pytest.mark.parametrize(("n", "stem"), [(8, "fig8"), ("S1", "figS1")])
def test_figures_8_and_s1_draw_four_curves_and_their_counts(n, stem):
    tables, figure = drawn(n)
    ax = panel(figure, "a")
    curves = tables[f"{stem}_curves"]
    written = [text for text, _ in end_texts(ax)]
    styles = {}
    for n_spo in (3, 15):
        for detections in ("discrete", "refined"):
            rows = curves.query("n_spo == @n_spo and detections == @detections")
            name = f"{n_spo}, {detections}"
            assert_array_equal(line(ax, name)[1], rows["percentage_of_unique"])
            assert f"{rows['n_unique'].iloc[-1]} of {rows['n_unique'].iloc[0]}" in written
            (drawn_line,) = [one for one in ax.get_lines() if one.get_label() == name]
            assert drawn_line.get_color() == palette.DETECTION_COLOURS[detections]
            styles.setdefault(n_spo, set()).add(drawn_line.get_linestyle())
    assert styles == {3: {"--"}, 15: {"-"}}


def test_precision_of_nothing_is_refused():
    tables = figure_tables.tables(8)
    none = tables["fig8_precision"].assign(mean=np.nan, median=np.nan, low=np.nan, high=np.nan)
    with pytest.raises(InputError, match="there is no location above 0 to draw"):
        fig8.draw(tables | {"fig8_precision": none})


@pytest.mark.parametrize(
    ("n", "names"), [(7, ["a", "a 2", "a ∞", "b", "b 2", "b ∞", "f"]), (8, ["a"])]
)
def test_names_at_the_ends_of_curves_do_not_overlap(n, names):
    _, figure = drawn(n)
    figure.draw_without_rendering()
    for name in names:
        boxes = [
            type(text).__mro__[1].get_window_extent(text)  # of the text, without its leader
            for label, text in end_texts(panel(figure, name))
            if label
        ]
        assert len(boxes) >= 6
        for i, one in enumerate(boxes):
            assert not any(
                one.shrunk(1.0, 0.7).overlaps(other.shrunk(1.0, 0.7)) for other in boxes[:i]
            )
            assert one.x1 <= figure.bbox.x1


def test_heights_are_spread_no_farther_than_needed():
    draw = np.random.default_rng(1)
    for _ in range(50):
        heights = np.sort(draw.uniform(0, 30, 6))
        apart = np.array(spread(heights, 4.0))
        assert (np.diff(apart) > 4 - 1e-9).all()
        assert apart.mean() == pytest.approx(heights.mean())
        assert np.array(spread(heights, 4.0, high=25.0)).max() <= 25
    assert spread([0.0, 10.0, 20.0], 4.0).tolist() == [0.0, 10.0, 20.0]


def test_figure_9_draws_counts_and_the_matrix_in_order_of_stability():
    tables, figure = drawn(9)
    counts = tables["fig9_counts"]
    for column in ("n_octave", "n_common"):
        octaves, number = line(panel(figure, "a"), column)
        assert_allclose(octaves, np.log2(counts["kappa"]))
        assert_array_equal(number, counts[column])
    ticks = [tick.get_text() for tick in panel(figure, "a").get_xticklabels()]
    assert ticks[0] == "$2^{1/30}$\n1.02" and ticks[-1] == "$2^{1/2}$\n1.41"
    shown = panel(figure, "b").images[0].get_array()
    stability = shown.max(axis=0)
    assert (np.diff(stability) >= 0).all()
    assert_array_equal(np.sort(tables["fig9_keypoints"]["stability"]), stability)
    detected = tables["fig9_occurrence"].pivot(index="kappa", columns="keypoint", values="detected")
    assert_array_equal((~np.ma.getmaskarray(shown)).sum(axis=1), detected.sum(axis=1))


def test_figure_9_says_which_shares_are_found_with_most_and_with_all_ratios():
    tables, figure = drawn(9)
    stability = tables["fig9_keypoints"]["stability"]
    (text,) = (text.get_text() for text in panel(figure, "b").texts)
    most, always = 100 * (stability > 0.8).mean(), 100 * (stability == 1).mean()
    assert text == f"with more than 80 % of the ratios: {most:.0f} %, with all: {always:.0f} %"
    ends, _ = line(panel(figure, "b"), "stable")
    assert ends[1] - ends[0] == (stability > 0.8).sum()


def test_figure_9_refuses_an_occurrence_matrix_with_holes():
    tables = figure_tables.tables(9)
    with pytest.raises(
        InputError, match="fig9_occurrence.csv: lacks some pairs .* a value of kappa"
    ):
        fig9.draw(tables | {"fig9_occurrence": tables["fig9_occurrence"].iloc[1:]})


@pytest.mark.parametrize(
    ("n", "module", "name", "column"),
    [
        (10, fig10, "b", "blur"),
        (11, fig11, "a", "blur_spread"),
        (12, fig12, "a", "noise"),
    ],
)
def test_sweeps_draw_a_curve_per_value_and_name_it_in_its_colour(n, module, name, column):
    tables, figure = drawn(n)
    ax, curves = panel(figure, name), tables[f"fig{n}_curves"]
    values = [0.01, 0.03, 0.07, 0.15] if n == 12 else sorted(set(curves[column]))
    assert [drawn.get_label() for drawn in ax.get_lines()] == [f"{value:g}" for value in values]
    texts = {text.get_text(): text for text in ax.texts}
    for value in values:
        rows = curves[curves[column] == value]
        expected = rows[["percentage_of_images", "percentage_of_unique"]].T
        assert_array_equal(line(ax, f"{value:g}"), expected)
        (curve,) = [drawn for drawn in ax.get_lines() if drawn.get_label() == f"{value:g}"]
        assert texts[f"{value:g}"].get_color() == curve.get_color()
        assert texts[f"{value:g}"].xy[1] == pytest.approx(expected.iloc[1, -1] / 102)
    colours = {to_rgb(drawn.get_color()) for drawn in ax.get_lines()}
    assert len(colours) == len(values)
    with pytest.raises(InputError, match=rf"has no rows of {column} = {values[0]:g}"):
        other = "fig10_curves" if n == 10 else f"fig{n}_scales"
        module.draw(tables | {other: tables[other][tables[other][column] != values[0]]})


def test_bands_hold_what_the_tables_say():
    tables, figure = drawn(10)
    curves = tables["fig10_curves"]
    bands = panel(figure, "b").collections
    assert len(bands) == 3
    for blur, band in zip((0.25, 0.6, 1.1), bands, strict=True):
        rows = curves[curves["blur"] == blur]
        corners = band.get_paths()[0].vertices
        assert (corners[:, 1].min(), corners[:, 1].max()) == (
            rows["low"].min(),
            rows["high"].max(),
        )


def test_figure_10_counts_from_zero_with_intervals():
    tables, figure = drawn(10)
    ax, counts = panel(figure, "a"), tables["fig10_counts"]
    assert_array_equal(line(ax, "mean_detections"), counts[["blur", "mean_detections"]].T)
    assert ax.get_ylim()[0] == 0 and ax.get_ylim()[1] > counts["high_detections"].max()
    segments = np.array(ax.collections[0].get_segments())
    assert_array_equal(segments[:, 0], counts[["blur", "low_detections"]])
    assert_array_equal(segments[:, 1], counts[["blur", "high_detections"]])
    colours = np.array([to_rgb(drawn.get_color()) for drawn in panel(figure, "b").get_lines()])
    assert_array_equal(ax.collections[1].get_facecolor()[:, :3], colours)


def test_figure_11_draws_percentages_and_counts_against_scale():
    tables, figure = drawn(11)
    scales = tables["fig11_scales"]
    for name, column in (("b", "percentage_seen"), ("b counts", "n_unique")):
        for spread_of_blur in figure_tables.BLUR_SPREADS:
            rows = scales[scales["blur_spread"] == spread_of_blur]
            expected = rows[["sigma_from", column]].T
            assert_array_equal(line(panel(figure, name), f"{spread_of_blur:g}"), expected)
    assert "70 % of views" in panel(figure, "b").get_ylabel()
    assert len(panel(figure, "b").collections) == len(figure_tables.BLUR_SPREADS)


def test_figure_12_draws_counts_crops_and_theory():
    tables, figure = drawn(12)
    scales = tables["fig12_scales"]
    for noise in (0.01, 0.03, 0.07, 0.15):
        rows = scales[scales["noise"] == noise]
        for name, column in (("c", "mean_above"), ("d", "percentage_seen")):
            expected = rows[["sigma_from", column]].T
            assert_array_equal(line(panel(figure, name), f"{noise:g}"), expected)
        pixels = tables["fig12_pixels"].query("noise == @noise").sort_values(["y", "x"])["grey"]
        (crop,) = [c for c in panel(figure, "b").images if c.get_label() == f"{noise:g}"]
        assert_array_equal(crop.get_array(), pixels.to_numpy().reshape(64, 64))
        assert (crop.norm.vmin, crop.norm.vmax) == (0.0, 1.0)
    assert panel(figure, "c").get_yscale() == "log"
    ratio = tables["fig12_theory"][["sigma", "octave_ratio"]].T
    assert_array_equal(line(panel(figure, "f"), "octave_ratio"), ratio)
    texts = [text.get_text() for text in panel(figure, "f").texts]
    assert "in the paper: 2" in texts


def test_figure_12_compares_octaves_at_half_the_noise():
    tables, figure = drawn(12)
    scales = tables["fig12_scales"].set_index(["noise", "sigma_from"])
    compared = fig12.compare_octaves(tables["fig12_scales"])
    assert [one.noise for one in compared] == [0.01, 0.03, 0.07, 0.15]
    for noise, half, whole in compared:
        columns = ["percentage_seen", "low", "high"]
        assert_array_equal(half, scales.loc[(noise / 2, 1.1), columns])
        assert_array_equal(whole, scales.loc[(noise, 2.2), columns])
        assert_array_equal(line(panel(figure, "e"), f"{noise:g}"), [[half[0]], [whole[0]]])
    assert_array_equal(line(panel(figure, "e"), "equal"), [[0, 100], [0, 100]])


def test_figure_12_says_where_octaves_cannot_be_compared():
    tables = figure_tables.tables(12)
    scales = tables["fig12_scales"]
    for rows in (scales[scales["sigma_from"] < 2.2], scales.assign(noise=scales["noise"] ** 2)):
        assert fig12.compare_octaves(rows) == []
    figure = fig12.draw(tables | {"fig12_scales": scales[scales["sigma_from"] < 2.2]})
    texts = [text.get_text() for text in panel(figure, "e").texts]
    assert "nothing to compare" in texts


def test_figure_12_leaves_out_what_a_logarithm_cannot_show():
    tables = figure_tables.tables(12)
    scales = tables["fig12_scales"].copy()
    scales.loc[scales["noise"] == 0.15, ["mean_above", "low_above", "high_above"]] = 0.0
    figure = fig12.draw(tables | {"fig12_scales": scales})
    ax = panel(figure, "c")
    assert np.isnan(line(ax, "0.15")[1]).all()
    assert {text.get_text() for text in ax.texts} == {"noise", "0.01", "0.03", "0.07"}
    figure = fig12.draw(
        tables | {"fig12_scales": scales.assign(mean_above=0.0, low_above=0.0, high_above=0.0)}
    )
    assert len(panel(figure, "c").texts) == 0


def test_figure_12_refuses_a_crop_with_holes():
    tables = figure_tables.tables(12)
    pixels = tables["fig12_pixels"]
    first = pixels.index[pixels["noise"] == 0.01]
    for wrong in (pixels.drop(first[5]), pd.concat([pixels, pixels.loc[first[:1]]])):
        with pytest.raises(InputError, match=r"the pixels of noise 0\.01 fill no rectangle"):
            fig12.draw(tables | {"fig12_pixels": wrong})


def test_figure_s2_draws_shares_and_shifts_in_the_order_of_the_error():
    tables, figure = drawn("S2")
    assert tables["figS2"]["error"].iloc[0] == 0  # the right view comes first
    table = tables["figS2"]
    for name, suffix in (("first octave", ""), ("second octave", " second octave")):
        rows = table[table["scales"] == name].sort_values("error")
        shares, shifts = panel(figure, f"a{suffix}"), panel(figure, f"b{suffix}")
        for kind in figs2.SHARES:
            error, share = line(shares, kind)
            assert_array_equal(error, rows["error"])
            assert_array_equal(share, 100 * rows[f"share_{kind}"])
        for kind in figs2.SHIFTS:
            assert_array_equal(line(shifts, kind), rows[["error", f"{kind}_shift"]].T)
        assert len(shares.collections) == 2 and len(shifts.collections) == 1
    names = {text.get_text(): text.get_color() for text in panel(figure, "b").texts}
    assert names == {text: look["color"] for text, look in figs2.SHIFTS.values()}


def test_figure_s2_draws_wrong_blurs_against_the_zoom():
    tables, figure = drawn("S2")
    table = tables["blur_zooms_pairs"].sort_values("zoom")  # the table is in another order
    for assumed in (0.4, 0.8, 1.1):
        rows = table[table["assumed_blur"] == assumed]
        zoom, share = line(panel(figure, "c"), f"{assumed:g}")
        assert_array_equal(zoom, rows["zoom"])
        assert_array_equal(share, 100 * rows["share_found"])
        shift = line(panel(figure, "d"), f"{assumed:g}")
        assert_array_equal(shift, rows[["zoom", "scale_shift"]].T)
    (right,) = [text for text in panel(figure, "c").texts if "right" in text.get_text()]
    assert right.get_text().startswith("assumed 0.8 px")
    assert right.get_color() == palette.ASSUMED_COLOURS["right"]
    assert len(panel(figure, "c").collections) == len(panel(figure, "d").collections) == 3


def test_figure_s5_draws_every_tilt_at_both_samplings():
    tables, figure = drawn("S5")
    for n_spo in (3, 15):
        for detections in ("discrete", "refined"):
            name = f"{n_spo}, {detections}"
            asked = "n_spo == @n_spo and detections == @detections"
            rows = tables["figS5_counts"].query(asked)
            tilt, share = line(panel(figure, "a"), name)
            assert_array_equal(tilt, [5, 20, 40])
            assert_array_equal(share, 100 * rows["share_always"])
            for letter, kind in (("b", "location"), ("c", "log2_sigma")):
                rows = tables["figS5_precision"].query(asked)
                rows = rows[rows["quantity"] == kind]
                assert_array_equal(line(panel(figure, letter), name)[1], rows["mean"])
    with pytest.raises(InputError, match="no location above 0"):
        figs5.draw(
            tables | {"figS5_precision": tables["figS5_precision"].assign(mean=0, low=0, high=0)}
        )


@pytest.mark.parametrize("seed", range(5))
def test_labels_keep_their_distance_order_and_bounds(seed):
    draw = np.random.default_rng(seed)
    wanted = draw.random(9)
    places = spread(wanted, 0.1, 0.0, 1.0)
    assert np.diff(np.sort(places)).min() > 0.1 - 1e-12
    assert_array_equal(np.argsort(places), np.argsort(wanted))
    assert places.min() >= 0 and places.max() <= 1 + 1e-12
    apart = np.linspace(0.05, 0.95, 9)
    assert_allclose(spread(apart, 0.1, 0.0, 1.0), apart)  # nothing to do


def test_figure_s3_draws_blurs_and_profiles():
    tables, figure = drawn("S3")
    for model, (above, below, _) in figs3.MODELS.items():
        rows = tables["figS3"].query("model == @model")
        for pitch in (4.5, 6.5):
            own = rows[rows["pitch"] == pitch]
            assert_array_equal(line(panel(figure, above), f"{pitch:g}"), own[["f_number", "c"]].T)
            # Thick where c rises as the aperture opens, up to the minimum.
            f_number, c = line(panel(figure, above), f"rising {pitch:g}")
            assert c[-1] == own["c"].min()
            assert (np.diff(c) < 0).all() and f_number[0] == own["f_number"].min()
            assert (len(c) == 1) == (model == "diffraction")
        (band,) = [patch for patch in panel(figure, above).patches if patch.get_label() == "paper"]
        assert_allclose(
            band.get_extents().transformed(panel(figure, above).transData.inverted()).intervaly,
            figs3.PAPER,
        )
        profile = tables["figS3_profiles"].query("model == @model")
        for column in ("psf", "gaussian"):
            assert_array_equal(line(panel(figure, below), column), profile[["radius", column]].T)
        (said,) = [
            text.get_text() for text in panel(figure, below).texts if "residual" in text.get_text()
        ]
        assert (
            said
            == f"$c$ = {profile['c'].iloc[0]:.2f} px\nresidual {100 * profile['residual'].iloc[0]:.0f} %"
        )


def test_figure_s3_names_a_missing_lens():
    tables = figure_tables.figs3()
    for name in tables:
        wrong = tables | {name: tables[name].query("model != 'spherical'")}
        with pytest.raises(InputError, match=f"{name}.csv: has no rows of the model spherical"):
            figs3.draw(wrong)


def test_figure_s4_draws_scales_errors_and_theory():
    tables, figure = drawn("S4")
    table = tables["figS4"]
    for kappa in (1.0, 1.1, figure_tables.KAPPA):
        own = table.query("experiment == 'operator' and kappa == @kappa")
        assert_array_equal(
            line(panel(figure, "a"), f"{kappa:.6g}")[1], own["detected"] / own["blob"]
        )
        assert set(line(panel(figure, "a"), f"theory {kappa:.6g}")[1]) == {kappa**-0.5}
    for detection in ("discrete", "refined"):
        for n_spo in (3, 15):
            own = table.query(
                "experiment == 'sampling' and detection == @detection and n_spo == @n_spo"
            )
            (found,) = [
                x for x in panel(figure, "b").get_lines() if x.get_gid() == f"{detection} {n_spo}"
            ]
            assert_array_equal(found.get_ydata(), own["error"].abs())
    (exact,) = [x for x in panel(figure, "b").get_lines() if x.get_gid() == "laplacian"]
    assert_array_equal(exact.get_ydata(), figs4.EXACT)
    for assumed in (0.5, 0.8, 1.1):
        own = table.query("experiment == 'assumed_blur' and assumed_blur == @assumed")
        ratio = own["detected"] * np.sqrt(figure_tables.KAPPA) / own["blob"]
        assert_array_equal(line(panel(figure, "c"), f"{assumed:g}")[1], ratio)
        blob, theory = line(panel(figure, "c"), f"theory {assumed:g}")
        assert_allclose(theory, np.sqrt(1 + (0.64 - assumed**2) / blob**2))
        # Drawn in full only where the scale-space holds it.
        assert (theory * blob / np.sqrt(figure_tables.KAPPA) >= 1.1).all()


def test_figure_s4_names_what_it_cannot_draw():
    table = figure_tables.figs4()["figS4"]
    with pytest.raises(InputError, match="no rows of the experiment sampling"):
        figs4.draw({"figS4": table.query("experiment != 'sampling'")})
    with pytest.raises(InputError, match="no blob of the experiment operator was detected"):
        figs4.draw(
            {
                "figS4": table.assign(
                    detected=table["detected"].where(table["experiment"] != "operator")
                )
            }
        )


# Ties and oblong pictures


def seen(pixels, step):
    return fig2.View("one", 1.0, step, np.asarray(pixels, dtype=float))


@pytest.mark.parametrize("spot", [(12, 40), (5, 20), (14, 52)])
def test_the_detail_of_figure_2_is_where_the_coarsest_view_varies_most(spot):
    coarse, fine = np.zeros((20, 60)), np.zeros((80, 240))
    coarse[spot] = 1.0  # the finer view has its detail elsewhere, which does not matter
    fine[40, 60] = 5.0
    views = [seen(fine, 2.5), seen(coarse, 10.0)]
    centre, half = fig2._busiest_detail(views)
    assert_allclose(half, 0.5 * fig2.DETAIL * np.array([200.0, 600.0]))
    # The window holds the spot, in both axes.
    assert (np.abs(centre / 10.0 + (np.array(coarse.shape) - 1) / 2 - spot) <= half / 10 + 1).all()
    transposed = [seen(view.pixels.T, view.step) for view in views]
    other, its_half = fig2._busiest_detail(transposed)
    assert_allclose(its_half, half[::-1])
    y, x = fig2._window(views[1], (centre, half))
    assert_allclose(fig2._window(transposed[1], (centre[::-1], half[::-1])), (x, y))
    for (low, high), middle, size, side in zip((y, x), centre, half, coarse.shape, strict=True):
        assert (low + high) / 2 == pytest.approx((side - 1) / 2 + middle / 10.0)
        assert high - low == pytest.approx(2 * size / 10.0)


def test_the_detail_of_figure_2_lies_in_what_all_views_show():
    # The coarse view sees more: what varies at its border is seen by no other.
    coarse = np.zeros((20, 60))
    coarse[1, 2], coarse[11, 33] = 9.0, 1.0
    centre, half = fig2._busiest_detail([seen(np.zeros((100, 300)), 1.0), seen(coarse, 10.0)])
    assert_allclose(half, 0.5 * fig2.DETAIL * np.array([100.0, 300.0]))
    assert (np.abs(centre) + half <= 0.5 * np.array([100.0, 300.0])).all()
    assert (np.abs(centre / 10.0 + [9.5, 29.5] - [11, 33]) <= half / 10 + 1).all()


def test_the_grid_of_figure_3_has_each_node_once_where_two_samplings_share_a_step():
    nodes = [(3, 0.5), (5, 0.5), (3, 0.25), (5, 0.25), (5, 0.25), (7, 0.1), (7, 0.5 + 1e-12)]
    table = pd.DataFrame(nodes, columns=["n_spo", "delta_min"])
    found = fig3._grid(table)[["n_spo", "delta_min"]].to_numpy().tolist()
    assert found == [[3, 0.5], [5, 0.5], [3, 0.25], [5, 0.25], [7, 0.5]]


def test_keypoints_of_the_same_stability_are_in_the_order_of_the_sets_that_see_them():
    detected = {0: [0, 1, 1], 1: [1, 1, 0], 2: [1, 1, 1], 3: [1, 0, 1], 4: [0, 0, 0]}
    rows = [(k, n, d) for k, by in detected.items() for n, d in zip((3, 5, 9), by, strict=True)]
    detections = pd.DataFrame(rows, columns=["keypoint", "n_spo", "detected"])
    stability = [2 / 3, 2 / 3, 1.0, 2 / 3, 0.0]
    keypoints = pd.DataFrame({"keypoint": range(5), "stability": stability})
    found = occurrence(detections.sample(frac=1, random_state=1), keypoints, "n_spo", "fig4")
    assert found.sets.tolist() == [3, 5, 9]
    assert found.detected.T.astype(int).tolist() == list(detected.values())
    # Means of the sets: 7, 4, -, 6; none at all comes first by its stability.
    assert found.order.tolist() == [4, 1, 3, 0, 2]


def test_curves_of_figure_5_fall_whatever_the_order_of_their_rows():
    tables = dict(figure_tables.tables(5))
    roc = tables["fig5_roc"]
    tables["fig5_roc"] = roc.sample(frac=1, random_state=2)
    axes = {ax.get_label(): ax for ax in fig5.draw(tables).axes}
    lines = [it for ax in axes.values() for it in ax.get_lines() if it.get_label() in fig5.PANELS]
    curves = [it for it in lines if len(it.get_xdata()) == (roc["feature"] == it.get_label()).sum()]
    assert len(curves) == len(fig5.PANELS)
    for curve in curves:
        x, y = (np.asarray(it, float) for it in (curve.get_xdata(), curve.get_ydata()))
        assert (np.diff(x) >= 0).all() and (np.diff(y) <= 0).all()
