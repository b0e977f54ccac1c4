"""Plausible tables for the tests of the figures: the right columns and shapes, invented numbers."""

from __future__ import annotations

from functools import cache
from importlib import import_module

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

GRID = (3, 4, 6, 10, 19)
"""Samplings of figure 3's grid: fewer than the study's, which only take longer to draw."""

KAPPA, SIGMA_MIN = 2 ** (1 / 3), 1.1
SAMPLINGS = tuple(range(3, 20))


@cache
def tables(n: int | str) -> dict[str, pd.DataFrame]:
    """Return the tables of figure `n`; do not change them."""
    makers = {1: fig1, 2: fig2, 3: fig3, 4: fig4, 5: fig5, "S3": figS3, "S4": figS4}
    return fig6(per_group=2, half=5) if n == 6 else makers[n]()


@cache
def drawn(n: int | str) -> tuple[dict[str, pd.DataFrame], Figure]:
    """Return the tables of figure `n` and the figure, drawn once for all tests."""
    return tables(n), import_module(f"keystab.figures.fig{n}").draw(tables(n))


def balanced(n_spo: int) -> float:
    """Return the balanced sampling step of the paper (section 5.1)."""
    return float(np.sqrt(2) * KAPPA * SIGMA_MIN * (2 ** (1 / n_spo) - 1))


def fig1() -> dict[str, pd.DataFrame]:
    """Compute the true table of figure 1: it takes less than a second."""
    from keystab.semigroup import semigroup_table

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


def figS3() -> dict[str, pd.DataFrame]:  # noqa: N802
    """Compute true tables of figure S3 at a few apertures: they take less than a second."""
    from keystab.optics import optics_table, profile_table

    profiles = profile_table(2.0, 4.5, count=41)
    return {"figS3": optics_table([1.4, 2.8, 5.6, 11.0], [4.5, 6.5]), "figS3_profiles": profiles}


def figS4() -> dict[str, pd.DataFrame]:  # noqa: N802
    """Invent detections of blobs: theory with small errors, none below the first scale."""
    from keystab.blobs import dog_extremum_scale

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
