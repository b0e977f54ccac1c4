"""What the detections of many samplings have in common (section 5).

Comes in: tables of extrema. Goes out: tidy tables, {results}/tables/*, that the figures draw, and
{results}/matches/samplings.parquet, which detection of each sampling is which unique keypoint.
Steps: keep the common scale range and leave out the border; find the minimum set of unique
keypoints; look each up in every sampling; count, rate, score, and cut out cubes.
"""


rule semigroup:
    """Figure 1: blur a blob many times by little and once by much, in three ways."""
    output:
        table=f"{RESULTS}/tables/fig1.csv",
    log:
        f"{LOGS}/semigroup.log",
    benchmark:
        f"{LOGS}/benchmarks/semigroup.tsv"
    params:
        blob=setting("semigroup.blob"),
        n_passes=setting("semigroup.n_passes"),
        sigma_from=setting("semigroup.sigma_from"),
        sigma_to=setting("semigroup.sigma_to"),
        sigma_count=setting("semigroup.sigma_count"),
        truncation=setting("semigroup.truncation"),
        code=fingerprint("keystab.stages.semigroup"),
        software=SOFTWARE,
    message:
        "Blurring a blob of {params.blob} px {params.n_passes} times and once"
    shell:
        """
        python -m keystab.stages.semigroup \
            --blob {params.blob} \
            --n-passes {params.n_passes} \
            --sigma-from {params.sigma_from} \
            --sigma-to {params.sigma_to} \
            --sigma-count {params.sigma_count} \
            --truncation {params.truncation} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule describe_views:
    """Figure 2: what the simulated views look like, in numbers."""
    input:
        views=ancient(f"{RESULTS}/views/examples"),
        digest=f"{RESULTS}/views/examples.sha256",
    output:
        table=f"{RESULTS}/tables/fig2.csv",
        pixels=f"{RESULTS}/tables/fig2_pixels.parquet",
    log:
        f"{LOGS}/describe_views.log",
    benchmark:
        f"{LOGS}/benchmarks/describe_views.tsv"
    params:
        code=fingerprint("keystab.stages.describe_views"),
        software=SOFTWARE,
    message:
        "Describing the example views"
    shell:
        """
        python -m keystab.stages.describe_views \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --table {output.table:q} \
            --pixels {output.pixels:q} \
            >{log:q} 2>&1
        """


rule match_grid:
    """Figure 3: count the extrema of every sampling, all, comparable and unique ones."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        grid=expand(f"{RESULTS}/keypoints/grid_n{{n_spo}}.parquet", n_spo=config["grid"]["n_spo"]),
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
            n_spo=config["samplings"]["n_spo"],
        ),
    output:
        table=f"{RESULTS}/tables/fig3.csv",
    log:
        f"{LOGS}/match_grid.log",
    benchmark:
        f"{LOGS}/benchmarks/match_grid.tsv"
    params:
        n_spo=setting("grid.n_spo"),
        delta_min=setting("grid.delta_min"),
        balanced_n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        code=fingerprint("keystab.stages.match_grid"),
        software=SOFTWARE,
    message:
        "Counting the extrema of all samplings"
    shell:
        """
        python -m keystab.stages.match_grid \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --grid {input.grid:q} \
            --samplings {input.samplings:q} \
            --n-spo {params.n_spo} \
            --delta-min {params.delta_min} \
            --balanced-n-spo {params.balanced_n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule match_samplings:
    """Figure 4: which unique keypoint is detected at which balanced sampling."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
            n_spo=config["samplings"]["n_spo"],
        ),
    output:
        matches=f"{RESULTS}/matches/samplings.parquet",
        counts=f"{RESULTS}/tables/fig4_counts.csv",
        keypoints=f"{RESULTS}/tables/fig4_keypoints.csv",
        occurrence=f"{RESULTS}/tables/fig4_occurrence.csv",
        summary=f"{RESULTS}/tables/fig4_summary.csv",
    log:
        f"{LOGS}/match_samplings.log",
    benchmark:
        f"{LOGS}/benchmarks/match_samplings.tsv"
    params:
        n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        stable_above=setting("comparison.stable_above"),
        unstable_below=setting("comparison.unstable_below"),
        code=fingerprint("keystab.stages.match_samplings"),
        software=SOFTWARE,
    message:
        "Matching the extrema of the balanced samplings n_spo = {params.n_spo}"
    shell:
        """
        python -m keystab.stages.match_samplings \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --samplings {input.samplings:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --stable-above {params.stable_above} \
            --unstable-below {params.unstable_below} \
            --matches {output.matches:q} \
            --counts {output.counts:q} \
            --keypoints {output.keypoints:q} \
            --occurrence {output.occurrence:q} \
            --summary {output.summary:q} \
            >{log:q} 2>&1
        """


rule count_refined:
    """Count the keypoints that the quadratic refinement keeps at every balanced sampling."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
            n_spo=config["samplings"]["n_spo"],
        ),
        traces=expand(
            f"{RESULTS}/keypoints/traces_n{{n_spo}}.parquet",
            n_spo=config["samplings"]["n_spo"],
        ),
    output:
        table=f"{RESULTS}/tables/refinement.csv",
    log:
        f"{LOGS}/count_refined.log",
    benchmark:
        f"{LOGS}/benchmarks/count_refined.tsv"
    params:
        n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.count_refined"),
        software=SOFTWARE,
    message:
        "Counting keypoints refined within {params.max_offset} in {params.max_iterations} models"
    shell:
        """
        python -m keystab.stages.count_refined \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --samplings {input.samplings:q} \
            --traces {input.traces:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule score_features:
    """Figure 5: how well four features tell stable from unstable keypoints."""
    input:
        keypoints=f"{RESULTS}/tables/fig4_keypoints.csv",
        matches=f"{RESULTS}/matches/samplings.parquet",
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
            n_spo=config["samplings"]["n_spo"],
        ),
    output:
        features=f"{RESULTS}/tables/fig5_features.csv",
        thresholds=f"{RESULTS}/tables/fig5_thresholds.csv",
        roc=f"{RESULTS}/tables/fig5_roc.csv",
        auc=f"{RESULTS}/tables/fig5_auc.csv",
    log:
        f"{LOGS}/score_features.log",
    benchmark:
        f"{LOGS}/benchmarks/score_features.tsv"
    params:
        stable_above=setting("comparison.stable_above"),
        unstable_below=setting("comparison.unstable_below"),
        n_resamples=setting("predictors.n_resamples"),
        code=fingerprint("keystab.stages.score_features"),
        software=SOFTWARE,
    message:
        "Scoring features of keypoints seen in more than {params.stable_above} or less than "
        "{params.unstable_below} of the samplings"
    shell:
        """
        python -m keystab.stages.score_features \
            --keypoints {input.keypoints:q} \
            --matches {input.matches:q} \
            --samplings {input.samplings:q} \
            --stable-above {params.stable_above} \
            --unstable-below {params.unstable_below} \
            --n-resamples {params.n_resamples} \
            --features {output.features:q} \
            --thresholds {output.thresholds:q} \
            --roc {output.roc:q} \
            --auc {output.auc:q} \
            >{log:q} 2>&1
        """


rule cut_cubes:
    """Figure 6: cut cubes out of a very dense scale-space, around stable and unstable keypoints."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        keypoints=f"{RESULTS}/tables/fig4_keypoints.csv",
    output:
        panels=f"{RESULTS}/tables/fig6.csv",
        cubes=f"{RESULTS}/tables/fig6_cubes.parquet",
    log:
        f"{LOGS}/cut_cubes.log",
    benchmark:
        f"{LOGS}/benchmarks/cut_cubes.tsv"
    params:
        n_spo=setting("cubes.n_spo"),
        per_group=setting("cubes.count"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        stable_above=setting("comparison.stable_above"),
        unstable_below=setting("comparison.unstable_below"),
        code=fingerprint("keystab.stages.cut_cubes"),
        software=SOFTWARE,
    message:
        "Cutting {params.per_group} stable and {params.per_group} unstable cubes at n_spo = {params.n_spo}"
    shell:
        """
        python -m keystab.stages.cut_cubes \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --keypoints {input.keypoints:q} \
            --n-spo {params.n_spo} \
            --per-group {params.per_group} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --stable-above {params.stable_above} \
            --unstable-below {params.unstable_below} \
            --panels {output.panels:q} \
            --cubes {output.cubes:q} \
            >{log:q} 2>&1
        """
