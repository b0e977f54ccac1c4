"""What a detector should find, and what it finds of it (figures truth, truth_cameras, refinement,
uncertainty).

Comes in: views, tables of extrema and refinement traces. Goes out: truth/*.parquet, the true extrema
of the view and of the scene, and tables/truth_*.csv, refinement_choices.csv, uncertainty_*.csv.
Steps: climb from the discrete extrema of several samplings to the extrema of the continuous
scale-space, by Newton's method on sums over its series; evaluate detections against them: recall,
precision, errors.
"""


rule find_true_extrema:
    """Find the true extrema of the view that all samplings sample, for one ratio of the blurs."""
    input:
        **views("still"),
    output:
        table=f"{HERE}truth/view{{ratio}}.parquet",
    log:
        f"{LOG}find_true_extrema/view{{ratio}}.log",
    benchmark:
        f"{BENCHMARK}find_true_extrema/view{{ratio}}.tsv"
    wildcard_constraints:
        ratio="(_[0-9.]+)?",
    resources:
        runtime=growing(job_resources.minutes_of_truth),
    params:
        **stage(
            "find_true_extrema",
            parameters.Scales,
            kappa=of(plan.kappa_of_truth, "{ratio}"),
            sigma_max=of(plan.end_of_truth),
        ),
    message:
        "Finding the true extrema above {params.sigma_min} px, kappa = {params.kappa}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule find_scene_extrema:
    """Find the true extrema of the scene, as a view of the whole of it should see them."""
    input:
        **views("still"),
        reference=local(of(plan.setting, "reference")),
    output:
        table=f"{HERE}truth/scene.parquet",
    log:
        f"{LOG}find_scene_extrema.log",
    benchmark:
        f"{BENCHMARK}find_scene_extrema.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_truth),
        mem_mb=growing(job_resources.megabytes_of_reference),
    params:
        **stage(
            "find_scene_extrema",
            "reference_blur",
            parameters.Scales,
            sigma_max=of(plan.end_of_truth),
        ),
    message:
        "Finding the true extrema of the scene{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule evaluate_samplings:
    """Figure truth: recall, precision and errors of balanced samplings, with the spline."""
    input:
        **views("still"),
        truth=f"{HERE}truth/view.parquet",
        samplings=files("keypoints/sampling_n{}.parquet", plan.setting, "samplings.n_spo"),
        traces=files("keypoints/traces_n{}.parquet", plan.setting, "samplings.n_spo"),
    output:
        table=f"{HERE}tables/truth_samplings.csv",
    log:
        f"{LOG}evaluate_samplings/usual.log",
    benchmark:
        f"{BENCHMARK}evaluate_samplings/usual.tsv"
    params:
        **stage(
            "evaluate_samplings",
            "samplings.n_spo",
            parameters.DifferenceOfGaussians,
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            parameters.Acceptance,
        ),
    message:
        "Holding detections ({params.oversampling}) against the true extrema{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


use rule evaluate_samplings as evaluate_cosine with:
    input:
        **views("still"),
        truth=f"{HERE}truth/view.parquet",
        samplings=files("keypoints/cosine_n{}.parquet", plan.setting, "truth.cosine_n_spo"),
        traces=files("keypoints/cosine_traces_n{}.parquet", plan.setting, "truth.cosine_n_spo"),
    output:
        table=f"{HERE}tables/truth_cosine.csv",
    log:
        f"{LOG}evaluate_samplings/cosine.log",
    benchmark:
        f"{BENCHMARK}evaluate_samplings/cosine.tsv"
    params:
        **stage(
            "evaluate_samplings",
            parameters.DifferenceOfGaussians,
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            parameters.Acceptance,
            n_spo=setting("truth.cosine_n_spo"),
            oversampling="cosine",
        ),


rule evaluate_grid:
    """Figure truth: recall and precision of discrete extrema on the grid of figure 3."""
    input:
        **views("still"),
        truth=f"{HERE}truth/view.parquet",
        extrema=files("keypoints/grid_n{}.parquet", plan.setting, "grid.n_spo"),
    output:
        table=f"{HERE}tables/truth_grid.csv",
    log:
        f"{LOG}evaluate_grid.log",
    benchmark:
        f"{BENCHMARK}evaluate_grid.tsv"
    params:
        **stage(
            "evaluate_grid",
            "detector.sigma_min",
            parameters.ComparedWithTruth,
            parameters.Tolerance,
        ),
    message:
        "Holding the extrema of the grid against the true extrema{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule evaluate_kappas:
    """Figure truth: recall, precision and errors for ratios of the two blurs."""
    input:
        **views("still"),
        truths=files("truth/view{suffix}.parquet", plan.true_ratios),
        extrema=f"{HERE}keypoints/kappas_extrema.parquet",
        traces=f"{HERE}keypoints/kappas_traces.parquet",
    output:
        table=f"{HERE}tables/truth_kappas.csv",
    log:
        f"{LOG}evaluate_kappas.log",
    benchmark:
        f"{BENCHMARK}evaluate_kappas.tsv"
    params:
        **stage(
            "evaluate_kappas",
            "detector.sigma_min",
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            parameters.Acceptance,
            kappas=column("kappa", plan.true_ratios),
        ),
    message:
        "Holding the keypoints for kappa = {params.kappas} against the true extrema{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule evaluate_views:
    """Figure truth: recall and precision of sets of views against the scene itself."""
    input:
        **views("still"),
        **detections(plan.compared_with_scene),
        truth=f"{HERE}truth/scene.parquet",
        sets=ancient(files("views/{set}", plan.compared_with_scene)),
        sets_digest=files("views/{set}.sha256", plan.compared_with_scene),
    output:
        table=f"{HERE}tables/truth_views.csv",
    log:
        f"{LOG}evaluate_views.log",
    benchmark:
        f"{BENCHMARK}evaluate_views.tsv"
    params:
        **stage(
            "evaluate_views",
            "detector.sigma_min",
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            parameters.Acceptance,
            sweeps=column("sweep", plan.compared_with_scene),
            values=column("value", plan.compared_with_scene),
            n_spo=column("n_spo", plan.compared_with_scene),
            guards=column("guard", plan.compared_with_scene),
        ),
    message:
        "Holding the keypoints of sets of views against the extrema of the scene{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule evaluate_keypoints:
    """Figure truth: what stable and unstable keypoints are, and whether features tell."""
    input:
        truth=f"{HERE}truth/view.parquet",
        keypoints=f"{HERE}tables/fig4_keypoints.csv",
        features=f"{HERE}tables/fig5_features.csv",
    output:
        causes=f"{HERE}tables/truth_causes.csv",
        auc=f"{HERE}tables/truth_auc.csv",
    log:
        f"{LOG}evaluate_keypoints.log",
    benchmark:
        f"{BENCHMARK}evaluate_keypoints.tsv"
    params:
        **stage(
            "evaluate_keypoints",
            parameters.Stable,
            "detector.sigma_min",
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            "predictors.n_resamples",
        ),
    message:
        "Saying what stable and unstable keypoints are{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule evaluate_refinement:
    """Figure refinement: what ways and limits of the refinement keep and lose."""
    input:
        **views("still"),
        truth=f"{HERE}truth/view.parquet",
        samplings=files("keypoints/sampling_n{}.parquet", plan.refined_n_spo),
    output:
        table=f"{HERE}tables/refinement_choices.csv",
    log:
        f"{LOG}evaluate_refinement.log",
    benchmark:
        f"{BENCHMARK}evaluate_refinement.tsv"
    params:
        **stage(
            "evaluate_refinement",
            parameters.DifferenceOfGaussians,
            parameters.ComparedWithTruth,
            parameters.Tolerance,
            "stability.max_offsets",
            "truth.most_iterations",
            n_spo=of(plan.refined_n_spo),
        ),
    message:
        "Holding ways to refine against the true extrema{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule calibrate_bars:
    """Figure uncertainty: what error bars of keypoints hold, and what they are good for."""
    input:
        **views("shots"),
        moved=ancient(f"{HERE}views/moved"),
        moved_digest=f"{HERE}views/moved.sha256",
    output:
        coverage=f"{HERE}tables/uncertainty_coverage.csv",
        strata=f"{HERE}tables/uncertainty_strata.csv",
        reliability=f"{HERE}tables/uncertainty_reliability.csv",
        separation=f"{HERE}tables/uncertainty_separation.csv",
        weights=f"{HERE}tables/uncertainty_weights.csv",
    log:
        f"{LOG}calibrate_bars.log",
    benchmark:
        f"{BENCHMARK}calibrate_bars.tsv"
    priority: 1  # the study's longest job: begun last, it would be waited for
    resources:
        runtime=growing(job_resources.minutes_of_shots),
    params:
        **stage(
            "calibrate_bars",
            parameters.Scales,
            "comparison.border",
            "comparison.first_scale",
            parameters.ShotPairs,
        ),
    message:
        "Holding error bars against second shots, noise = {params.noise}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
