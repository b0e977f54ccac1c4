"""Plausible tables for the tests of the figures: the right columns and shapes, invented numbers."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from keystab.figures import style

GRID = (3, 4, 6, 10, 19)
"""Samplings of figure 3's grid: fewer than the study's, which only take longer to draw."""

KAPPA, SIGMA_MIN = 2 ** (1 / 3), 1.1
SAMPLINGS = tuple(range(3, 20))


@cache
def tables(n: int | str) -> dict[str, pd.DataFrame]:
    """Return the tables of figure `n`; do not change them."""
    makers = {1: fig1, 2: fig2, 3: fig3, 4: fig4, 5: fig5, 7: fig7, 8: fig8, 9: fig9}
    makers |= {10: fig10, 11: fig11, 12: fig12, "S1": figs1, "S2": figs2}
    makers |= {"S3": figs3, "S4": figs4, "S5": figs5}
    return fig6(per_group=2, half=5) if n == 6 else makers[n]()


@cache
def drawn(n: int | str) -> tuple[dict[str, pd.DataFrame], Figure]:
    """Return the tables of figure `n` and the figure, drawn once for all tests."""
    return tables(n), module(n).draw(tables(n))


@cache
def without_layout(n: int | str) -> tuple[dict[str, pd.DataFrame], Figure]:
    """Return the same without having computed where things go, half of the time of drawing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "settle", lambda figure, draft=False: figure)
        return tables(n), module(n).draw(tables(n))


def module(n: int | str) -> ModuleType:
    """Return the module of figure `n`; names of modules are lower case."""
    return import_module(f"keystab.figures.fig{n}".lower())


def balanced(n_spo: int) -> float:
    """Return the balanced sampling step of the paper (section 5.1)."""
    return float(np.sqrt(2) * KAPPA * SIGMA_MIN * (2 ** (1 / n_spo) - 1))


def fig1() -> dict[str, pd.DataFrame]:
    """Compute the true table of figure 1: it takes less than a second."""
    from keystab.experiments.semigroup_table import semigroup_table

    return {"fig1": semigroup_table()}


def fig2() -> dict[str, pd.DataFrame]:
    """Render waves and a disc as three cameras would see them."""
    views, pixels = [], []
    for k, (blur, step, shape) in enumerate(
        [(0.5, 10.0, (113, 200)), (1.0, 14.0, (80, 142)), (0.6, 20.0, (56, 100))]
    ):
        y, x = (np.indices(shape) - (np.array(shape)[:, None, None] - 1) / 2) * step
        disc = 1 / (1 + np.exp((np.hypot(y - 150, x + 300) - 180) / (blur * step)))
        value = 0.3 + 0.3 * disc + 0.15 * np.sin(x / 90) * np.cos(y / 60) + 0.1 * np.sin(y / 400)
        views.append(
            {
                "view": k,
                "label": f"c = {blur}",
                "blur": blur,
                "step": step,
                "height": shape[0],
                "width": shape[1],
                "mean": value.mean(),
                "standard_deviation": value.std(),
            }
        )
        rows, columns = np.indices(shape)
        pixels.append(
            pd.DataFrame(
                {"view": k, "y": rows.ravel(), "x": columns.ravel(), "value": value.ravel()}
            )
        )
    return {"fig2": pd.DataFrame(views), "fig2_pixels": pd.concat(pixels, ignore_index=True)}


def fig3(samplings: tuple[int, ...] = GRID) -> dict[str, pd.DataFrame]:
    """Invent a grid whose unbalanced corners hold more extrema and worse Hessians."""
    draw = np.random.default_rng(3)
    steps = [balanced(n) for n in samplings[1:]] + [0.5]
    rows = []
    for n_spo in samplings:
        for delta_min in sorted({*steps, balanced(n_spo)}):
            unbalance = np.log(delta_min / balanced(n_spo))
            n_common = int(500 * (1 + 0.06 * unbalance**2) + draw.integers(-9, 9))
            n_extrema = n_common + int(150 + 130 * unbalance**2 + 40 / n_spo)
            condition = 4.0 * np.exp(1.2 * unbalance**2)
            rows.append(
                {
                    "n_spo": n_spo,
                    "delta_min": delta_min,
                    "balanced": delta_min == balanced(n_spo),
                    "n_samples": int(400 * 225 / delta_min**2 * (n_spo + 2)),
                    "n_extrema": n_extrema,
                    "n_common": n_common,
                    "n_unique": n_common - int(5 + 4 * unbalance**2),
                    "gap": 0,
                    "median_condition": condition,
                    "q25_condition": 0.6 * condition,
                    "q75_condition": 2.1 * condition,
                }
            )
    return {"fig3": pd.DataFrame(rows)}


def _occurrence(n_keypoints: int = 640) -> tuple[np.ndarray, np.ndarray]:
    """Invent who is seen where: a U-shaped stability and fewer losses for fine samplings."""
    draw = np.random.default_rng(4)
    chance = np.clip(draw.beta(0.35, 0.12, n_keypoints), 0.01, 1.0)
    luck = draw.random((n_keypoints, len(SAMPLINGS)))
    steady = draw.random(n_keypoints)[:, None]
    seen = np.where(luck < 0.75, steady, luck) < chance[:, None]
    seen[np.arange(n_keypoints), draw.integers(0, 4, n_keypoints)] |= ~seen.any(axis=1)
    return chance, seen


def fig4() -> dict[str, pd.DataFrame]:
    """Invent detections at 17 samplings."""
    draw = np.random.default_rng(5)
    _, seen = _occurrence()
    n = len(seen)
    keypoints = pd.DataFrame(
        {
            "keypoint": np.arange(n),
            "y": draw.uniform(3, 221, n),
            "x": draw.uniform(3, 396, n),
            "sigma": 1.1 * 2 ** draw.uniform(0.33, 1, n),
            "sign": draw.choice([-1, 1], n),
            "n_samplings": seen.sum(axis=1),
            "stability": seen.mean(axis=1),
        }
    )
    occurrence = pd.DataFrame(
        {
            "keypoint": np.repeat(np.arange(n), len(SAMPLINGS)),
            "n_spo": np.tile(SAMPLINGS, n),
            "detected": seen.astype(int).ravel(),
        }
    )
    counts = []
    for i, n_spo in enumerate(SAMPLINGS):
        total = 505 + int(draw.integers(-12, 12))
        rate = 0.02 + 0.16 * np.exp(-(n_spo - 3) / 3)
        row = {"n_spo": n_spo, "delta_min": balanced(n_spo), "n_extrema": total + 230 + 60 // n_spo}
        row["n_common"] = total
        for change, first in (("new", 0), ("lost", len(SAMPLINGS) - 1)):
            number = np.nan if i == first else round(total * rate * draw.uniform(0.9, 1.1))
            share, spread = number / total, 1.96 * np.sqrt(rate * (1 - rate) / total)
            row |= {f"n_{change}": number, f"{change}_rate": share}
            row |= {f"{change}_low": share - spread, f"{change}_high": share + spread}
        counts.append(row)
    summary = pd.DataFrame(
        [
            ("n_unique", float(n), "unique keypoints"),
            ("gap", 0.0, "proven distance from the minimum"),
            ("share_always", float(seen.all(axis=1).mean()), "detected at every sampling"),
            (
                "share_stable",
                float((seen.mean(axis=1) > 0.8).mean()),
                "detected at more than 80 % of the samplings",
            ),
            (
                "share_unstable",
                float((seen.mean(axis=1) < 0.2).mean()),
                "detected at less than 20 % of the samplings",
            ),
        ],
        columns=["quantity", "value", "note"],
    )
    return {
        "fig4_counts": pd.DataFrame(counts),
        "fig4_keypoints": keypoints,
        "fig4_occurrence": occurrence,
        "fig4_summary": summary,
    }


FEATURES = {  # centre and spread of log10 for stable keypoints, shift for unstable ones
    "dog": (-2.3, 0.6, -0.25),
    "difference": (-4.5, 0.9, -1.4),
    "laplacian": (-1.5, 0.6, -0.5),
    "condition": (0.7, 0.4, 0.5),
}


def fig5() -> dict[str, pd.DataFrame]:
    """Invent features of stable and unstable keypoints, with thresholds and ROC to match."""
    draw = np.random.default_rng(6)
    _, seen = _occurrence()
    stability = seen.mean(axis=1)
    label = np.where(stability > 0.8, "stable", np.where(stability < 0.2, "unstable", "between"))
    features = pd.DataFrame({"keypoint": np.arange(len(seen)), "stability": stability})
    features["label"] = label
    thresholds, roc, auc = [], [], []
    for name, (centre, spread, shift) in FEATURES.items():
        log = draw.normal(centre, spread, len(seen)) + shift * (label == "unstable")
        features[name] = 10**log
        cuts = np.quantile(features[name], np.linspace(0, 1, 200))
        good, bad = (
            features.loc[label == kind, name].to_numpy() for kind in ("stable", "unstable")
        )
        good_below, bad_below = ((kind[:, None] < cuts).mean(axis=0) for kind in (good, bad))
        thresholds.append(
            pd.DataFrame(
                {
                    "feature": name,
                    "threshold": cuts,
                    "stable_below": good_below,
                    "unstable_below": bad_below,
                }
            )
        )
        keep_large = shift < 0
        removed = bad_below if keep_large else 1 - bad_below
        kept = 1 - good_below if keep_large else good_below
        roc.append(pd.DataFrame({"feature": name, "specificity": removed, "sensitivity": kept}))
        wins = good[:, None] > bad if keep_large else good[:, None] < bad
        auc.append(
            {
                "feature": name,
                "auc": wins.mean(),
                "low": wins.mean() - 0.04,
                "high": wins.mean() + 0.04,
                "n_stable": len(good),
                "n_unstable": len(bad),
                "direction": "above" if keep_large else "below",
            }
        )
    return {
        "fig5_features": features,
        "fig5_thresholds": pd.concat(thresholds, ignore_index=True),
        "fig5_roc": pd.concat(roc, ignore_index=True),
        "fig5_auc": pd.DataFrame(auc),
    }


def fig6(per_group: int = 10, half: int = 12) -> dict[str, pd.DataFrame]:
    """Invent smooth cubes: an ellipsoidal bump at the centre of a field of weaker ones."""
    draw = np.random.default_rng(7)
    k = np.arange(-half, half + 1)
    grid = np.stack(np.meshgrid(k, k, k, indexing="ij"), axis=-1)
    panels, cubes = [], []
    for panel in range(2 * per_group):
        sign = int(draw.choice([-1, 1]))
        value = np.zeros(grid.shape[:3])
        for bump in range(6):
            rotation, _ = np.linalg.qr(draw.normal(size=(3, 3)))
            widths = half * draw.uniform(0.25, 0.9, 3)
            centre = np.zeros(3) if bump == 0 else half * draw.uniform(-1, 1, 3)
            offset = (grid - centre) @ rotation / widths
            height = 1.0 if bump == 0 else draw.uniform(-0.9, 0.9)
            value += height * np.exp(-0.5 * (offset**2).sum(axis=-1))
        value *= 0.01 * sign
        panels.append(
            {
                "panel": panel,
                "group": "stable" if panel < per_group else "unstable",
                "keypoint": 7 * panel,
                "y": draw.uniform(3, 221),
                "x": draw.uniform(3, 396),
                "sigma": 1.1 * 2 ** draw.uniform(0.33, 1),
                "sign": sign,
                "stability": 1 - draw.integers(0, 3) / 17
                if panel < per_group
                else draw.integers(1, 4) / 17,
                "extremum": panel < per_group or panel % 2 == 0,
                "level": 0.7 * value[half, half, half],
                "condition": 10 ** draw.uniform(0.3, 2.5),
            }
        )
        cubes.append(
            pd.DataFrame(
                {
                    "panel": panel,
                    "k_s": grid[..., 0].ravel(),
                    "k_y": grid[..., 1].ravel(),
                    "k_x": grid[..., 2].ravel(),
                    "value": value.ravel(),
                }
            )
        )
    return {"fig6": pd.DataFrame(panels), "fig6_cubes": pd.concat(cubes, ignore_index=True)}


VIEWS = 32
OFFSETS, MODELS = (0.5, 0.6, 1.0, np.inf), (1.0, 2.0, np.inf)


def _seen_curve(draw: np.random.Generator, n: int, always: float) -> tuple[pd.DataFrame, dict]:
    """Invent in how many views each of `n` keypoints is seen; return the curve and its counts."""
    often = draw.beta(0.3 + always, 0.4, n)
    times = np.where(draw.random(n) < always, VIEWS, 1 + draw.binomial(VIEWS - 2, often))
    number = (times >= np.arange(1, VIEWS + 1)[:, None]).sum(axis=1)
    share = number / n
    spread = 196 * np.sqrt(share * (1 - share) * 2 / n)
    curve = pd.DataFrame(
        {
            "percentage_of_images": 100 * np.arange(1, VIEWS + 1) / VIEWS,
            "n_unique": number,
            "percentage_of_unique": 100 * share,
            "low": np.maximum(100 * share - spread, 0),
            "high": np.minimum(100 * share + 1.3 * spread, 100),
        }
    )
    counts = {"n_views": VIEWS, "mean_detections": times.sum() / VIEWS, "n_unique": n}
    counts |= {"gap": 0, "n_always": number[-1], "share_always": share[-1]}
    return curve, counts


def _views(figure: str, samplings: tuple[int, ...], seed: int, further: bool = False) -> dict:
    """Invent curves, precision and counts of a set of views."""
    draw = np.random.default_rng(seed)
    curves, precision, counts = [], [], []
    for n_spo in samplings:
        fine = 1 - np.exp(-(n_spo - 2) / 4)
        usual, others = (0.6, 2.0), [(m, n) for n in MODELS for m in OFFSETS]
        choices = [usual, *others] if further and n_spo in (3, 15) else [usual]
        for m, n_models in [(np.nan, np.nan), *dict.fromkeys(choices)]:
            kind = "discrete" if np.isnan(m) else "refined"
            tight = 0.0 if kind == "discrete" else (0.5 / m) ** 4 / n_models
            labels = {"n_spo": n_spo, "detections": kind}
            labels |= {"max_offset": m, "max_iterations": n_models}
            always = (0.42 + 0.5 * fine) * (1 - 0.8 * tight) * (1.1 if kind == "discrete" else 1)
            curve, numbers = _seen_curve(draw, int(560 - 90 * fine - 60 * tight), min(always, 0.95))
            counts.append(labels | numbers)
            if n_spo in (3, 15):
                curves.append(curve.assign(**labels))
            if kind == "discrete" or (m, n_models) == usual:
                mean = 0.6 / n_spo if kind == "discrete" else 0.3 / n_spo**1.7
                mean *= draw.uniform(0.9, 1.1)
                for quantity, unit in (("location", 1.0), ("log2_sigma", 0.3)):
                    flat = kind == "discrete" and quantity == "log2_sigma"
                    row = {"quantity": quantity, "n_keypoints": numbers["n_unique"] - 60}
                    row |= {"mean": unit * mean, "median": 1e-16 if flat else 0.4 * unit * mean}
                    row |= {"low": 0.85 * unit * mean, "high": 1.2 * unit * mean}
                    precision.append(labels | row)
    return {
        f"{figure}_curves": pd.concat(curves, ignore_index=True),
        f"{figure}_precision": pd.DataFrame(precision),
        f"{figure}_counts": pd.DataFrame(counts),
    }


def fig7() -> dict[str, pd.DataFrame]:
    """Invent translations, with a curve for every M_offset and N_interp, and SIFT as shipped."""
    draw = np.random.default_rng(8)
    parts = {"unfiltered": _seen_curve(draw, 1150, 0.4), "filtered": _seen_curve(draw, 420, 0.55)}
    return _views("fig7", SAMPLINGS, 9, further=True) | {
        "fig7_shipped": pd.concat(
            [curve.assign(shipped=name) for name, (curve, _) in parts.items()], ignore_index=True
        )
    }


def fig8() -> dict[str, pd.DataFrame]:
    """Invent zoom-outs."""
    return _views("fig8", SAMPLINGS, 10)


def figs1() -> dict[str, pd.DataFrame]:
    """Invent rotations."""
    return _views("figS1", SAMPLINGS[::2], 11)


def fig9() -> dict[str, pd.DataFrame]:
    """Invent keypoints that small or large ratios miss, and some that come and go."""
    draw = np.random.default_rng(12)
    kappas = 2 ** (1 / np.arange(30, 1, -1))
    n = 520
    place = draw.uniform(size=(n, 1))
    at = np.linspace(0, 1, len(kappas))
    seen = np.where(place < 0.5, True, np.where(place < 0.75, at > 4 * place - 2.2, at < place))
    seen &= draw.random((n, len(kappas))) > 0.1 * (place > 0.6)
    seen[np.arange(n), draw.integers(0, len(kappas), n)] = True
    keypoints = pd.DataFrame({"keypoint": np.arange(n), "stability": seen.mean(axis=1)})
    keypoints["n_kappas"] = seen.sum(axis=1)
    common = seen.sum(axis=0)
    counts = pd.DataFrame({"kappa": kappas, "n_octave": common + 150, "n_common": common})
    occurrence = pd.DataFrame(
        {
            "keypoint": np.repeat(np.arange(n), len(kappas)),
            "kappa": np.tile(kappas, n),
            "detected": seen.astype(int).ravel(),
        }
    )
    return {"fig9_counts": counts, "fig9_keypoints": keypoints, "fig9_occurrence": occurrence}


N_VIEWS = 32
STARTS = (1.1, 1.24, 1.39, 1.56, 1.75, 1.96, 2.2)
BLURS = (0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.95, 1.1)
BLUR_SPREADS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)
NOISES = (0.005, 0.01, 0.015, 0.03, 0.035, 0.07, 0.075, 0.15)


def _sweep_curves(column: str, harm: dict[float, float]) -> pd.DataFrame:
    """Invent stability curves of 32 views; `harm` is 0 (all keypoints stay) or more per value."""
    from keystab.evaluation.stability import stability_curve

    draw = np.random.default_rng(10)
    parts = []
    for value, badness in harm.items():
        chance = draw.beta(1.2 / (badness + 0.02), 0.35, int(450 * (1 + badness)))
        seen = draw.random((len(chance), N_VIEWS)) < chance[:, None]
        curve = stability_curve(seen[seen.any(axis=1)], n_resamples=40, purpose=(column,))
        parts.append(curve.assign(**{column: value}))
    return pd.concat(parts, ignore_index=True)


def _sweep_counts(column: str, harm: dict[float, float], drop: float) -> pd.DataFrame:
    """Invent numbers of keypoints per view."""
    mean = np.array([480 * np.exp(-drop * badness) for badness in harm.values()])
    mean += np.random.default_rng(11).normal(0, 2, len(mean))
    error = np.linspace(5, 1.5, len(mean))
    ends = {"low_detections": mean - error, "high_detections": mean + error}
    return pd.DataFrame({column: list(harm), "mean_detections": mean, **ends})


def _sweep_scales(column: str, harm: dict[float, float], drop: float) -> pd.DataFrame:
    """Invent what happens octave by octave: harm falls with the square of the scale."""
    rows = []
    for value, badness in harm.items():
        for start in STARTS:
            here = badness * (STARTS[0] / start) ** 2
            n_unique = int(700 * (STARTS[0] / start) ** 2 * (1 + here))
            share = 0.97 * np.exp(-1.1 * here)
            spread = 1.96 * np.sqrt(share * (1 - share) / n_unique)
            above = 750 * (STARTS[0] / start) ** 2 * np.exp(-drop * here)
            rows.append(
                {
                    column: value,
                    "sigma_from": start,
                    "n_unique": n_unique,
                    "seen_by": 0.7,
                    "n_seen": int(share * n_unique),
                    "percentage_seen": 100 * share,
                    "low": 100 * max(0.0, share - spread),
                    "high": 100 * min(1.0, share + spread),
                    "mean_above": above,
                    "low_above": above - 0.3 * np.sqrt(above),
                    "high_above": above + 0.3 * np.sqrt(above),
                }
            )
    return pd.DataFrame(rows)


def fig10() -> dict[str, pd.DataFrame]:
    """Invent keypoints that get unstable below a blur of 0.6 and not fewer."""
    harm = {blur: 3 * max(0.0, 0.6 - blur) ** 1.2 + 0.01 for blur in BLURS}
    return {
        "fig10_counts": _sweep_counts("blur", harm, 0.02),
        "fig10_curves": _sweep_curves("blur", harm),
    }


def fig11() -> dict[str, pd.DataFrame]:
    """Invent keypoints that get unstable with the uncertainty of the blur."""
    harm = {spread: 2 * spread for spread in BLUR_SPREADS}
    return {
        "fig11_curves": _sweep_curves("blur_spread", harm),
        "fig11_scales": _sweep_scales("blur_spread", harm, 0.0),
    }


def fig12() -> dict[str, pd.DataFrame]:
    """Invent keypoints that noise makes unstable and rare, and compute its closed form."""
    from keystab.scalespace.white_noise import dog_noise

    harm = {noise: 30 * noise for noise in NOISES}
    y, x = (grid.ravel() for grid in np.indices((64, 64)))
    clean = 0.4 + 0.2 * np.sin(x / 7) * np.cos(y / 5) + 0.2 * (np.hypot(y - 20, x - 40) < 12)
    draw = np.random.default_rng(12)
    pixels = [
        pd.DataFrame(
            {"noise": n, "y": y + 80, "x": x + 168, "grey": clean + draw.normal(0, n, 4096)}
        )
        for n in NOISES
    ]
    sigma = 1.1 * 2 ** np.linspace(0, 2, 41)
    ratio = dog_noise(sigma, 0.8, KAPPA) / dog_noise(2 * sigma, 0.8, KAPPA)
    return {
        "fig12_curves": _sweep_curves("noise", harm),
        "fig12_pixels": pd.concat(pixels, ignore_index=True),
        "fig12_scales": _sweep_scales("noise", harm, 0.9),
        "fig12_theory": pd.DataFrame({"sigma": sigma, "octave_ratio": ratio}),
    }


def figs2() -> dict[str, pd.DataFrame]:
    """Invent what 17 wrong blurs do in two octaves; the assumed one stands first, as in a set."""
    from keystab.evaluation.intervals import wilson_interval

    blurs = (0.7, *(round(0.3 + 0.05 * k, 2) for k in range(17) if k != 8))
    rows = []
    for blur in blurs:
        for name, n, sigma in (("first octave", 420, 1.75), ("second octave", 110, 3.4)):
            error, change = blur - 0.7, blur**2 - 0.7**2
            row = {"blur": blur, "error": error, "scales": name}
            size = (1.75 / sigma) ** 2
            for kind, loss in (("found", 0.8), ("right", 0.3)):
                slope = loss if error < 0 else 1.1 - loss
                share = 1 - slope * abs(error) * size
                low, high = wilson_interval(round(share * n), n)
                row |= {f"share_{kind}": share, f"low_{kind}": low, f"high_{kind}": high}
            shift = 0.5 * np.log2(1 + 0.35 * change / sigma**2)
            wide = 0.3 * abs(error) * size
            row |= {"scale_shift": shift, "q25_shift": shift - wide, "q75_shift": shift + wide}
            row["blob_shift"] = 0.5 * np.log2(1 + change / KAPPA / sigma**2)
            row["dilation_shift"] = 0.5 * np.log2(1 - change / sigma**2)
            rows.append(row)
    return {"figS2": pd.DataFrame(rows), "blur_zooms_pairs": _zoomed_pairs()}


def _zoomed_pairs() -> pd.DataFrame:
    """Invent what right and wrong blurs do to keypoints at other zooms."""
    from keystab.evaluation.intervals import wilson_interval

    rows = []
    for assumed in (0.4, 0.8, 1.1):
        for zoom in (1.0, 1.5, 2.0, 3.0):
            error = assumed - 0.8
            share = 1 - 0.2 * abs(error) * (zoom - 1) - 0.01 * (zoom > 1)
            low, high = wilson_interval(round(share * 250), 250)
            shift = -0.02 * error * (zoom**2 - 1)
            rows.append(
                {
                    "assumed_blur": assumed,
                    "blur": 0.8,
                    "zoom": zoom,
                    "share_found": share,
                    "low_found": low,
                    "high_found": high,
                    "scale_shift": shift,
                    "q25_shift": shift - 0.01,
                    "q75_shift": shift + 0.01,
                }
            )
    return pd.DataFrame(rows).sort_values("zoom", ascending=False)


def figs5() -> dict[str, pd.DataFrame]:  # noqa: N802
    """Invent keypoints that a tilt makes less stable, at two samplings."""
    from keystab.evaluation.intervals import wilson_interval

    counts, precision = [], []
    for tilt in (5.0, 20.0, 40.0):
        for n_spo in (3, 15):
            for detections in ("discrete", "refined"):
                share = 1 - tilt / 80 - 0.5 / n_spo
                low, high = wilson_interval(round(share * 300), 300)
                about = {"tilt": tilt, "n_spo": n_spo, "detections": detections}
                row = {"n_unique": 300, "n_always": round(share * 300), "share_always": share}
                counts.append(about | row | {"low_always": low, "high_always": high})
                for quantity, unit in (("location", 1.0), ("log2_sigma", 0.2)):
                    mean = unit * (0.3 if detections == "discrete" else 0.1) / n_spo + tilt / 900
                    row = {"quantity": quantity, "mean": mean, "low": 0.8 * mean}
                    precision.append(about | row | {"high": 1.2 * mean})
    return {"figS5_counts": pd.DataFrame(counts), "figS5_precision": pd.DataFrame(precision)}


def figs3() -> dict[str, pd.DataFrame]:  # noqa: N802
    """Compute true tables of figure S3 at a few apertures: they take less than a second."""
    from keystab.experiments.camera_blur import optics_table, profile_table

    profiles = profile_table(2.0, 4.5, count=41)
    return {"figS3": optics_table([1.4, 2.8, 5.6, 11.0], [4.5, 6.5]), "figS3_profiles": profiles}


def figs4() -> dict[str, pd.DataFrame]:  # noqa: N802
    """Invent detections of blobs: theory with small errors, none below the first scale."""
    from keystab.scalespace.gaussian_blobs import dog_extremum_scale

    draw = np.random.default_rng(8)
    ways = [("operator", "dog", kappa, 15, "refined", 0.8, 1e-3) for kappa in (1.1, KAPPA)]
    ways += [("operator", "laplacian", 1.0, 0, "series", 0.8, 1e-9)]
    for n_spo in (3, 15):
        ways += [("sampling", "dog", KAPPA, n_spo, "discrete", 0.8, 0.1)]
        ways += [("sampling", "dog", KAPPA, n_spo, "refined", 0.8, 1e-3)]
    ways += [("assumed_blur", "dog", KAPPA, 15, "refined", c, 1e-3) for c in (0.5, 0.8, 1.1)]
    rows = []
    for blob in np.geomspace(1.2, 3.6, 9):
        for experiment, operator, kappa, n_spo, detection, assumed, size in ways:
            theory = float(dog_extremum_scale(blob, max(kappa, 1 + 1e-12), 0.8, assumed))
            detected = theory * (1 + size * draw.uniform(-1, 1))
            if operator == "dog" and not theory > SIGMA_MIN:
                detected = np.nan
            rows.append(
                {
                    "experiment": experiment,
                    "operator": operator,
                    "kappa": kappa,
                    "n_spo": n_spo,
                    "detection": detection,
                    "blob": blob,
                    "camera_blur": 0.8,
                    "assumed_blur": assumed,
                    "sigma_min": SIGMA_MIN,
                    "theory": theory,
                    "detected": detected,
                    "error": detected / theory - 1,
                }
            )
    return {"figS4": pd.DataFrame(rows)}
