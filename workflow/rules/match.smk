"""What the detections of many samplings have in common (section 5).

Comes in: tables of extrema. Goes out: tidy tables that figures 3 to 6 and floor draw, and
matches/samplings.parquet, which detection of each sampling is which unique keypoint. Steps: keep the
common scale range and leave out the border; find the minimum set of unique keypoints; look each up
in every sampling; count, rate, score, and cut out cubes.
"""


rule match_grid:
    """Figure 3: count the extrema of every sampling, all, comparable and unique ones."""
    input:
        **views("still"),
        grid=files("keypoints/grid_n{}.parquet", plan.setting, "grid.n_spo"),
        samplings=files("keypoints/sampling_n{}.parquet", plan.setting, "samplings.n_spo"),
    output:
        table=f"{HERE}tables/fig3.csv",
    log:
        f"{LOG}match_grid.log",
    benchmark:
        f"{BENCHMARK}match_grid.tsv"
    params:
        **stage(
            "match_grid",
            "grid.n_spo",
            "grid.delta_min",
            parameters.Scales,
            parameters.Same,
            parameters.Compared,
            balanced_n_spo=setting("samplings.n_spo"),
        ),
    message:
        "Counting the extrema of all samplings{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_samplings:
    """Figure 4: which unique keypoint is detected at which balanced sampling."""
    input:
        **views("still"),
        samplings=files("keypoints/sampling_n{}.parquet", plan.setting, "samplings.n_spo"),
    output:
        matches=f"{HERE}matches/samplings.parquet",
        counts=f"{HERE}tables/fig4_counts.csv",
        keypoints=f"{HERE}tables/fig4_keypoints.csv",
        occurrence=f"{HERE}tables/fig4_occurrence.csv",
        summary=f"{HERE}tables/fig4_summary.csv",
    log:
        f"{LOG}match_samplings.log",
    benchmark:
        f"{BENCHMARK}match_samplings.tsv"
    params:
        **stage(
            "match_samplings",
            "samplings.n_spo",
            parameters.Scales,
            parameters.Same,
            "comparison.soft_ends",
            parameters.Compared,
            parameters.Stable,
        ),
    message:
        "Matching the extrema of the balanced samplings n_spo = {params.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule count_refined:
    """Count the keypoints that the quadratic refinement keeps at every balanced sampling."""
    input:
        **views("still"),
        samplings=files("keypoints/sampling_n{}.parquet", plan.setting, "samplings.n_spo"),
        traces=files("keypoints/traces_n{}.parquet", plan.setting, "samplings.n_spo"),
    output:
        table=f"{HERE}tables/refinement.csv",
        dead=f"{HERE}tables/dead_range.csv",
    log:
        f"{LOG}count_refined.log",
    benchmark:
        f"{BENCHMARK}count_refined.tsv"
    params:
        **stage(
            "count_refined",
            "samplings.n_spo",
            parameters.Scales,
            parameters.Compared,
            parameters.Acceptance,
        ),
    message:
        "Counting keypoints refined within {params.max_offset} in {params.max_iterations} models"
        "{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule score_features:
    """Figure 5: how well four features tell stable from unstable keypoints."""
    input:
        keypoints=f"{HERE}tables/fig4_keypoints.csv",
        matches=f"{HERE}matches/samplings.parquet",
        samplings=files("keypoints/sampling_n{}.parquet", plan.setting, "samplings.n_spo"),
    output:
        features=f"{HERE}tables/fig5_features.csv",
        thresholds=f"{HERE}tables/fig5_thresholds.csv",
        roc=f"{HERE}tables/fig5_roc.csv",
        auc=f"{HERE}tables/fig5_auc.csv",
    log:
        f"{LOG}score_features.log",
    benchmark:
        f"{BENCHMARK}score_features.tsv"
    params:
        **stage("score_features", parameters.Stable, "predictors.n_resamples"),
    message:
        "Scoring features of keypoints seen in more than {params.stable_above} or less than "
        "{params.unstable_below} of the samplings{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule cut_cubes:
    """Figure 6: cut cubes out of a very dense scale-space, around stable and unstable keypoints."""
    input:
        **views("still"),
        keypoints=f"{HERE}tables/fig4_keypoints.csv",
    output:
        panels=f"{HERE}tables/fig6.csv",
        cubes=f"{HERE}tables/fig6_cubes.parquet",
    log:
        f"{LOG}cut_cubes.log",
    benchmark:
        f"{BENCHMARK}cut_cubes.tsv"
    params:
        **stage(
            "cut_cubes",
            "cubes.n_spo",
            parameters.DifferenceOfGaussians,
            parameters.Tolerance,
            parameters.Stable,
            per_group=setting("cubes.count"),
        ),
    message:
        "Cutting {params.per_group} stable and {params.per_group} unstable cubes at n_spo = {params.n_spo}"
        "{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_variants:
    """Figure floor: new and lost extrema in every variant and in every reading, and their causes."""
    input:
        views=ancient(files("views/{set}", floor_variants.variants)),
        views_digest=files("views/{set}.sha256", floor_variants.variants),
        extrema=files("keypoints/floor/{run}.parquet", floor_variants.variants),
        truth=f"{HERE}truth/view.parquet",
    output:
        rates=f"{HERE}tables/floor_rates.csv",
        summary=f"{HERE}tables/floor_summary.csv",
        variants=f"{HERE}tables/floor_variants.csv",
        crossed=f"{HERE}tables/floor_readings.csv",
        causes=f"{HERE}tables/floor_causes.csv",
    log:
        f"{LOG}match_variants.log",
    benchmark:
        f"{BENCHMARK}match_variants.tsv"
    params:
        **stage(
            "match_variants",
            "samplings.n_spo",
            "detector.epsilon",
            parameters.Scales,
            parameters.Same,
            parameters.Compared,
            parameters.Readings,
            names=column("variant", floor_variants.variants),
            scenes=column("scene", floor_variants.variants),
            differences=column("words", floor_variants.variants),
            tolerances=column("tolerance", floor_variants.variants),
            firsts=column("first", floor_variants.variants),
            crossings=column("crossing", floor_variants.variants),
        ),
        # Which extrema belong to which variant: Snakemake compares inputs without their order.
        runs=parameter("runs", column("run", floor_variants.variants)),
    message:
        "Counting new and lost extrema in all variants and readings{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
