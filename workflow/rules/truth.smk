"""What a detector should find, and what it finds of it (figures truth and refinement).

Comes in: views, tables of extrema and refinement traces. Goes out: {results}/truth/*.parquet, the
true extrema of the view and of the scene, and {results}/tables/truth_*.csv, refinement_choices.csv.
Steps: climb from the discrete extrema of several samplings to the extrema of the continuous
scale-space, by Newton's method on the full sums; hold the detections against them.
"""


rule find_truth:
    """Find the true extrema of the view that all samplings sample."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        table=f"{RESULTS}/truth/view.parquet",
    log:
        f"{LOGS}/find_truth/view.log",
    benchmark:
        f"{LOGS}/benchmarks/find_truth/view.tsv"
    resources:
        runtime=minutes_of_truth,
    params:
        sigma_min=setting("detector.sigma_min"),
        sigma_max=end_of_truth,
        kappa=setting("detector.kappa"),
        code=fingerprint("keystab.stages.find_truth"),
        software=SOFTWARE,
    message:
        "Finding the true extrema above {params.sigma_min} px, kappa = {params.kappa}"
    shell:
        """
        python -m keystab.stages.find_truth \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --sigma-min {params.sigma_min} \
            --sigma-max {params.sigma_max} \
            --kappa {params.kappa} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


use rule find_truth as find_truth_of_kappa with:
    output:
        table=f"{RESULTS}/truth/view_{{fraction}}.parquet",
    log:
        f"{LOGS}/find_truth/view_{{fraction}}.log",
    benchmark:
        f"{LOGS}/benchmarks/find_truth/view_{{fraction}}.tsv"
    wildcard_constraints:
        fraction="[0-9.]+",
    params:
        sigma_min=setting("detector.sigma_min"),
        sigma_max=end_of_truth,
        kappa=kappa_of_file,
        code=fingerprint("keystab.stages.find_truth"),
        software=SOFTWARE,


rule find_scene:
    """Find the true extrema of the scene, as a view of the whole of it should see them."""
    input:
        reference=local(config["reference"]),
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        table=f"{RESULTS}/truth/scene.parquet",
    log:
        f"{LOGS}/find_scene.log",
    benchmark:
        f"{LOGS}/benchmarks/find_scene.tsv"
    resources:
        runtime=minutes_of_truth,
        mem_mb=memory_of_reference,
    params:
        reference_blur=setting("reference_blur"),
        sigma_min=setting("detector.sigma_min"),
        sigma_max=end_of_truth,
        kappa=setting("detector.kappa"),
        code=fingerprint("keystab.stages.find_scene"),
        software=SOFTWARE,
    message:
        "Finding the true extrema of the scene"
    shell:
        """
        python -m keystab.stages.find_scene \
            --reference {input.reference:q} \
            --reference-blur {params.reference_blur} \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --sigma-min {params.sigma_min} \
            --sigma-max {params.sigma_max} \
            --kappa {params.kappa} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule judge_samplings:
    """Figure truth: recall, precision and errors of balanced samplings, with the spline."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truth=f"{RESULTS}/truth/view.parquet",
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet", n_spo=config["samplings"]["n_spo"]
        ),
        traces=expand(
            f"{RESULTS}/keypoints/traces_n{{n_spo}}.parquet", n_spo=config["samplings"]["n_spo"]
        ),
    output:
        table=f"{RESULTS}/tables/truth_samplings.csv",
    log:
        f"{LOGS}/judge_samplings/usual.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_samplings/usual.tsv"
    params:
        n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.judge_samplings"),
        software=SOFTWARE,
    message:
        "Holding detections ({params.oversampling}) against the true extrema"
    shell:
        """
        python -m keystab.stages.judge_samplings \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --truth {input.truth:q} \
            --samplings {input.samplings:q} \
            --traces {input.traces:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


use rule judge_samplings as judge_cosine with:
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truth=f"{RESULTS}/truth/view.parquet",
        samplings=expand(
            f"{RESULTS}/keypoints/cosine_n{{n_spo}}.parquet",
            n_spo=config["truth"]["cosine_n_spo"],
        ),
        traces=expand(
            f"{RESULTS}/keypoints/cosine_traces_n{{n_spo}}.parquet",
            n_spo=config["truth"]["cosine_n_spo"],
        ),
    output:
        table=f"{RESULTS}/tables/truth_cosine.csv",
    log:
        f"{LOGS}/judge_samplings/cosine.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_samplings/cosine.tsv"
    params:
        n_spo=setting("truth.cosine_n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling="cosine",
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.judge_samplings"),
        software=SOFTWARE,


rule judge_grid:
    """Figure truth: recall and precision of discrete extrema on the grid of figure 3."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truth=f"{RESULTS}/truth/view.parquet",
        extrema=expand(
            f"{RESULTS}/keypoints/grid_n{{n_spo}}.parquet", n_spo=config["grid"]["n_spo"]
        ),
    output:
        table=f"{RESULTS}/tables/truth_grid.csv",
    log:
        f"{LOGS}/judge_grid.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_grid.tsv"
    params:
        sigma_min=setting("detector.sigma_min"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        code=fingerprint("keystab.stages.judge_grid"),
        software=SOFTWARE,
    message:
        "Holding the extrema of the grid against the true extrema"
    shell:
        """
        python -m keystab.stages.judge_grid \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --truth {input.truth:q} \
            --extrema {input.extrema:q} \
            --sigma-min {params.sigma_min} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule judge_kappas:
    """Figure truth: recall, precision and errors for ratios of the two blurs."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truths=[truth_of_kappa(fraction) for fraction in TRUE_FRACTIONS],
        extrema=f"{RESULTS}/keypoints/kappas_extrema.parquet",
        traces=f"{RESULTS}/keypoints/kappas_traces.parquet",
    output:
        table=f"{RESULTS}/tables/truth_kappas.csv",
    log:
        f"{LOGS}/judge_kappas.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_kappas.tsv"
    params:
        kappas=kappas_with_truth,
        sigma_min=setting("detector.sigma_min"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.judge_kappas"),
        software=SOFTWARE,
    message:
        "Holding the keypoints for kappa = {params.kappas} against the true extrema"
    shell:
        """
        python -m keystab.stages.judge_kappas \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --truths {input.truths:q} \
            --kappas {params.kappas} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --sigma-min {params.sigma_min} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule judge_views:
    """Figure truth: recall and precision of sets of views against the scene itself."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truth=f"{RESULTS}/truth/scene.parquet",
        sets=ancient([f"{RESULTS}/views/{name}" for name, _ in JUDGED]),
        sets_digest=[f"{RESULTS}/views/{name}.sha256" for name, _ in JUDGED],
        extrema=[f"{RESULTS}/keypoints/{name}/extrema_n{n}.parquet" for name, n in JUDGED],
        traces=[f"{RESULTS}/keypoints/{name}/traces_n{n}.parquet" for name, n in JUDGED],
    output:
        table=f"{RESULTS}/tables/truth_views.csv",
    log:
        f"{LOGS}/judge_views.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_views.tsv"
    params:
        sweeps=fixed("sweeps", [sweep_of_set(name) for name, _ in JUDGED]),
        values=fixed("values", [value_of_set(name) for name, _ in JUDGED]),
        n_spo=fixed("n_spo", [n for _, n in JUDGED]),
        guards=guards_of_judged_sets,
        sigma_min=setting("detector.sigma_min"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.judge_views"),
        software=SOFTWARE,
    message:
        "Holding the keypoints of sets of views against the extrema of the scene"
    shell:
        """
        python -m keystab.stages.judge_views \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --truth {input.truth:q} \
            --sets {input.sets:q} \
            --sets-digest {input.sets_digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --sweeps {params.sweeps} \
            --values {params.values} \
            --n-spo {params.n_spo} \
            --guards {params.guards} \
            --sigma-min {params.sigma_min} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule judge_keypoints:
    """Figure truth: what stable and unstable keypoints are, and whether features tell."""
    input:
        truth=f"{RESULTS}/truth/view.parquet",
        keypoints=f"{RESULTS}/tables/fig4_keypoints.csv",
        features=f"{RESULTS}/tables/fig5_features.csv",
    output:
        causes=f"{RESULTS}/tables/truth_causes.csv",
        auc=f"{RESULTS}/tables/truth_auc.csv",
    log:
        f"{LOGS}/judge_keypoints.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_keypoints.tsv"
    params:
        stable_above=setting("comparison.stable_above"),
        unstable_below=setting("comparison.unstable_below"),
        sigma_min=setting("detector.sigma_min"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        n_resamples=setting("predictors.n_resamples"),
        code=fingerprint("keystab.stages.judge_keypoints"),
        software=SOFTWARE,
    message:
        "Saying what stable and unstable keypoints are"
    shell:
        """
        python -m keystab.stages.judge_keypoints \
            --truth {input.truth:q} \
            --keypoints {input.keypoints:q} \
            --features {input.features:q} \
            --stable-above {params.stable_above} \
            --unstable-below {params.unstable_below} \
            --sigma-min {params.sigma_min} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --n-resamples {params.n_resamples} \
            --causes {output.causes:q} \
            --auc {output.auc:q} \
            >{log:q} 2>&1
        """


rule judge_refinement:
    """Figure refinement: what ways and limits of the refinement keep and lose."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        truth=f"{RESULTS}/truth/view.parquet",
        samplings=expand(
            f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
            n_spo=REFINED_N_SPO,
        ),
    output:
        table=f"{RESULTS}/tables/refinement_choices.csv",
    log:
        f"{LOGS}/judge_refinement.log",
    benchmark:
        f"{LOGS}/benchmarks/judge_refinement.tsv"
    params:
        n_spo=fixed("truth.refined_n_spo", REFINED_N_SPO),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("truth.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        max_offsets=setting("stability.max_offsets"),
        most_iterations=setting("truth.most_iterations"),
        code=fingerprint("keystab.stages.judge_refinement"),
        software=SOFTWARE,
    message:
        "Holding ways to refine against the true extrema"
    shell:
        """
        python -m keystab.stages.judge_refinement \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --truth {input.truth:q} \
            --samplings {input.samplings:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --max-offsets {params.max_offsets} \
            --most-iterations {params.most_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """
