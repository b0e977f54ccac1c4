"""What the detections in many views of the scene have in common (sections 5.5 to 6.3).

Comes in: tables of extrema and refinement traces of sets of views. Goes out: tidy tables,
tables/fig7*.csv to fig12*.csv, figS1*.csv, figS2.csv, figS5*.csv and those of sweeps that no figure
is about. Steps: accept refined keypoints; bring them to the frame of the first view; keep the common
field of view and range of scales; find the minimum set of unique keypoints; look each up in every
view; curves, precisions and counts with their intervals.
"""

# What says which keypoints of several views are compared, and which of them are the same.
IN_VIEWS = (
    parameters.ComparedInViews,
    parameters.Same,
    "comparison.soft_ends",
    parameters.Acceptance,
)


rule match_views:
    """Figures 7, 8, S1, S5: stability and precision across views of the scene."""
    input:
        **detections(plan.searches_of_figure, "{figure}"),
        views=ancient(files("views/{}", plan.sets_of_figure, "{figure}")),
        views_digest=files("views/{}.sha256", plan.sets_of_figure, "{figure}"),
    output:
        curves=f"{HERE}tables/{{figure}}_curves.csv",
        precision=f"{HERE}tables/{{figure}}_precision.csv",
        counts=f"{HERE}tables/{{figure}}_counts.csv",
        differences=f"{HERE}tables/{{figure}}_differences.csv",
    log:
        f"{LOG}match_views/{{figure}}.log",
    benchmark:
        f"{BENCHMARK}match_views/{{figure}}.tsv"
    wildcard_constraints:
        figure=plan.figures_of_views(swept=False),
    params:
        **stage(
            "match_views",
            "sets.{set}.n_spo",
            "stability.curve_n_spo",
            *IN_VIEWS,
            "stability.minimum_share",
            "stability.n_resamples",
            max_offsets=of(plan.further_limits, "{figure}", "max_offsets"),
            iterations=of(plan.further_limits, "{figure}", "max_iterations"),
            curve_n_spo=of(plan.curve_n_spo, "{figure}"),
            last_scale=of(plan.last_scale_of_figure, "{figure}"),
            tilts=of(plan.tilts, "{figure}"),
        ),
    message:
        "Matching the keypoints of {wildcards.figure} at n_spo = {params.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_translations:
    """Beside figure 8: stability under translations, in the range of scales that all zooms cover."""
    input:
        **detections(plan.searches, "translations_wide"),
        views=ancient(files("views/{set}", plan.searches, "translations_wide")),
        views_digest=files("views/{set}.sha256", plan.searches, "translations_wide"),
    output:
        curves=f"{HERE}tables/fig8_translations.csv",
        counts=f"{HERE}tables/fig8_translations_counts.csv",
    log:
        f"{LOG}match_translations.log",
    benchmark:
        f"{BENCHMARK}match_translations.tsv"
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            "stability.n_resamples",
            of_set="translations_wide",
            name="n_spo",
            values=column("n_spo", plan.searches, "translations_wide"),
            first_scale=of(plan.scales_of_zooms, 0),
            last_scale=of(plan.scales_of_zooms, 1),
        ),
    message:
        "Matching the keypoints of translated views at the scales of zooms{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_sift:
    """Figure 7: stability of SIFT with its own refinement, with and without its filters."""
    input:
        **views("shipped"),
        **detections(plan.searches, "shipped"),
    output:
        curves=f"{HERE}tables/fig7_shipped.csv",
        counts=f"{HERE}tables/fig7_shipped_counts.csv",
        edges=f"{HERE}tables/fig7_edges.csv",
    log:
        f"{LOG}match_sift.log",
    benchmark:
        f"{BENCHMARK}match_sift.tsv"
    params:
        **stage(
            "match_sift",
            parameters.ComparedInViews,
            parameters.Same,
            "comparison.soft_ends",
            parameters.SiftFilters,
            "stability.minimum_share",
            "stability.n_resamples",
            of_set="shipped",
        ),
    message:
        "Matching the keypoints of SIFT as shipped{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_kappas:
    """Figure 9: which keypoint is detected with which ratio of the difference of Gaussians."""
    input:
        **views("still"),
        extrema=f"{HERE}keypoints/kappas_extrema.parquet",
        traces=f"{HERE}keypoints/kappas_traces.parquet",
    output:
        counts=f"{HERE}tables/fig9_counts.csv",
        keypoints=f"{HERE}tables/fig9_keypoints.csv",
        occurrence=f"{HERE}tables/fig9_occurrence.csv",
    log:
        f"{LOG}match_kappas.log",
    benchmark:
        f"{BENCHMARK}match_kappas.tsv"
    params:
        **stage(
            "match_kappas",
            "kappas.n_spo",
            "detector.sigma_min",
            "comparison.border",
            parameters.Same,
            "comparison.soft_ends",
            parameters.Acceptance,
            kappas=of(plan.kappas),
        ),
    message:
        "Matching the keypoints of all ratios of the difference of Gaussians{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_aliasing:
    """Figure 10: stability across views against the blur of the camera."""
    input:
        **detections(plan.searches_of_figure, "{figure}"),
        views=ancient(files("views/{}", plan.sets_of_figure, "{figure}")),
        views_digest=files("views/{}.sha256", plan.sets_of_figure, "{figure}"),
    output:
        curves=f"{HERE}tables/{{figure}}_curves.csv",
        counts=f"{HERE}tables/{{figure}}_counts.csv",
    log:
        f"{LOG}match_sweep/{{figure}}.log",
    benchmark:
        f"{BENCHMARK}match_sweep/{{figure}}.tsv"
    wildcard_constraints:
        figure=plan.figures_of_views(swept=True),
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            "stability.n_resamples",
            name=of(plan.swept, "{figure}"),
            values=column("value", plan.searches_of_figure, "{figure}"),
        ),
    message:
        "Matching the keypoints of {wildcards.figure} for {params.name} = {params.values}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


use rule match_aliasing as match_sweep with:
    # Figures 11 and 12: stability against unknown blur and noise, and against scale.
    output:
        curves=f"{HERE}tables/{{figure}}_curves.csv",
        counts=f"{HERE}tables/{{figure}}_counts.csv",
        scales=f"{HERE}tables/{{figure}}_scales.csv",
    wildcard_constraints:
        figure=plan.figures_of_views(swept=True, against_scale=True),
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            parameters.Octaves,
            "stability.n_resamples",
            name=of(plan.swept, "{figure}"),
            values=column("value", plan.searches_of_figure, "{figure}"),
            starts=of(plan.starts_within, "{figure}"),
        ),


rule match_blur_zooms:
    """Figure S2: keypoints of the first view in those at other zooms, under right and wrong blurs."""
    input:
        **detections(plan.searches_of_sweep, "{sweep}"),
        views=ancient(files("views/{set}", plan.searches_of_sweep, "{sweep}")),
        views_digest=files("views/{set}.sha256", plan.searches_of_sweep, "{sweep}"),
    output:
        curves=f"{HERE}tables/{{sweep}}_curves.csv",
        counts=f"{HERE}tables/{{sweep}}_counts.csv",
        pairs=f"{HERE}tables/{{sweep}}_pairs.csv",
    log:
        f"{LOG}match_stated/{{sweep}}.log",
    benchmark:
        f"{BENCHMARK}match_stated/{{sweep}}.tsv"
    wildcard_constraints:
        sweep="blur_zooms",
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            "stability.n_resamples",
            last_scale=of(plan.last_scale, "{sweep}"),
            name=of(plan.stated_key, "{sweep}"),
            values=column("value", plan.searches_of_sweep, "{sweep}"),
        ),
    message:
        "Matching the keypoints of '{wildcards.sweep}' for {params.name} = {params.values}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


use rule match_blur_zooms as match_unbalanced with:
    # How stable interpolation is at balanced and at unbalanced samplings (caption of figure 3).
    output:
        curves=f"{HERE}tables/{{sweep}}_curves.csv",
        counts=f"{HERE}tables/{{sweep}}_counts.csv",
        interpolation=f"{HERE}tables/{{sweep}}_interpolation.csv",
    wildcard_constraints:
        sweep="unbalanced",
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            "stability.n_resamples",
            last_scale=of(plan.last_scale, "{sweep}"),
            name=of(plan.stated_key, "{sweep}"),
            values=column("value", plan.searches_of_sweep, "{sweep}"),
            n_spo=column("n_spo", plan.searches_of_sweep, "{sweep}"),
        ),


use rule match_blur_zooms as match_large_scales with:
    # Keypoints under noise and a wrong blur at once, over four octaves (section 4).
    output:
        curves=f"{HERE}tables/{{sweep}}_curves.csv",
        counts=f"{HERE}tables/{{sweep}}_counts.csv",
        scales=f"{HERE}tables/{{sweep}}_octaves.csv",
    wildcard_constraints:
        sweep="large_scales",
    params:
        **stage(
            "match_sweep",
            *IN_VIEWS,
            parameters.Octaves,
            "stability.n_resamples",
            last_scale=of(plan.last_scale, "{sweep}"),
            name=of(plan.stated_key, "{sweep}"),
            values=column("value", plan.searches_of_sweep, "{sweep}"),
            starts=of(plan.octaves_of_sweep, "{sweep}"),
            unit=setting("detector.sigma_min"),
        ),


rule match_blurs:
    """Figure S2: keypoints of views whose blur is not the assumed one."""
    input:
        **views("blur_errors"),
        **detections(plan.searches, "blur_errors"),
    output:
        table=f"{HERE}tables/figS2.csv",
    log:
        f"{LOG}match_blurs.log",
    benchmark:
        f"{BENCHMARK}match_blurs.tsv"
    params:
        **stage(
            "match_blurs",
            "sets.{set}.assumed_blur",
            "detector.kappa",
            parameters.ComparedInViews,
            parameters.Same,
            parameters.Acceptance,
            of_set="blur_errors",
        ),
    message:
        "Comparing views of other blurs with that of the assumed blur {params.assumed_blur}"
        "{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
