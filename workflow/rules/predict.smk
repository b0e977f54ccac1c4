"""Whether a single detection shows that it can be trusted (figure predictors).

Comes in: extrema, unique keypoints and true extrema of the view 'still', and further pictures. Goes
out: {results}/pictures/{set}/*, the same of one view of every further picture, and
{results}/tables/predictors_*. Steps: take a view of each picture, find its extrema at all balanced
samplings, its unique keypoints and its true extrema; compute predictors of single detections; fit
models and score them on blocks and pictures that they have not seen.
"""


rule simulate_picture:
    """Take one view of a further picture, as that of the reference."""
    input:
        reference=path_of_picture,
    output:
        store=directory(f"{RESULTS}/pictures/{{set}}/view"),
        digest=f"{RESULTS}/pictures/{{set}}/view.sha256",
    log:
        f"{LOGS}/simulate_picture/{{set}}.log",
    benchmark:
        f"{LOGS}/benchmarks/simulate_picture/{{set}}.tsv"
    wildcard_constraints:
        set=one_of(PICTURES),
    resources:
        mem_mb=memory_of_reference,
    params:
        reference_sha256=setting("predictors.pictures.{set}.sha256"),
        blur=setting("sets.still.blur"),
        step=setting("predictors.pictures.{set}.step"),
        dtype=setting("views_dtype"),
        code=fingerprint("keystab.stages.simulate"),
        software=SOFTWARE,
    message:
        "Taking a view of the picture '{wildcards.set}'"
    shell:
        """
        python -m keystab.stages.simulate \
            --reference {input.reference:q} \
            --reference-sha256 {params.reference_sha256} \
            --reference-blur 0 \
            --set {wildcards.set} \
            --blur {params.blur} \
            --step {params.step} \
            --shift-y 0 \
            --shift-x 0 \
            --rotation 0 \
            --noise 0 \
            --height None \
            --width None \
            --whole false \
            --guard 0 \
            --dtype {params.dtype} \
            --store {output.store:q} \
            --digest {output.digest:q} \
            >{log:q} 2>&1
        """


rule detect_picture:
    """Detect the extrema of a further picture at all balanced samplings."""
    input:
        views=ancient(f"{RESULTS}/pictures/{{set}}/view"),
        digest=f"{RESULTS}/pictures/{{set}}/view.sha256",
    output:
        extrema=f"{RESULTS}/pictures/{{set}}/samplings.parquet",
    log:
        f"{LOGS}/detect_picture/{{set}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_picture/{{set}}.tsv"
    wildcard_constraints:
        set=one_of(PICTURES),
    params:
        n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        epsilon=setting("detector.epsilon"),
        code=fingerprint("keystab.stages.detect_samplings"),
        software=SOFTWARE,
    message:
        "Detecting extrema in the picture '{wildcards.set}'"
    shell:
        """
        python -m keystab.stages.detect_samplings \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --extrema {output.extrema:q} \
            >{log:q} 2>&1
        """


use rule match_samplings as match_picture with:
    input:
        views=ancient(f"{RESULTS}/pictures/{{set}}/view"),
        digest=f"{RESULTS}/pictures/{{set}}/view.sha256",
        samplings=f"{RESULTS}/pictures/{{set}}/samplings.parquet",
    output:
        matches=f"{RESULTS}/pictures/{{set}}/matches.parquet",
        counts=f"{RESULTS}/pictures/{{set}}/counts.csv",
        keypoints=f"{RESULTS}/pictures/{{set}}/keypoints.csv",
        occurrence=f"{RESULTS}/pictures/{{set}}/occurrence.csv",
        summary=f"{RESULTS}/pictures/{{set}}/summary.csv",
    log:
        f"{LOGS}/match_picture/{{set}}.log",
    benchmark:
        f"{LOGS}/benchmarks/match_picture/{{set}}.tsv"
    wildcard_constraints:
        set=one_of(PICTURES),


use rule find_truth as find_truth_of_picture with:
    input:
        views=ancient(f"{RESULTS}/pictures/{{set}}/view"),
        digest=f"{RESULTS}/pictures/{{set}}/view.sha256",
    output:
        table=f"{RESULTS}/pictures/{{set}}/truth.parquet",
    log:
        f"{LOGS}/find_truth/picture_{{set}}.log",
    benchmark:
        f"{LOGS}/benchmarks/find_truth/picture_{{set}}.tsv"
    wildcard_constraints:
        set=one_of(PICTURES),


rule score_predictors:
    """Figure predictors: what single detections tell, and models of it on what they have not seen."""
    input:
        **files_of_pictures(),
    output:
        detections=f"{RESULTS}/tables/predictors_detections.parquet",
        auc=f"{RESULTS}/tables/predictors_auc.csv",
        gain=f"{RESULTS}/tables/predictors_gain.csv",
        roc=f"{RESULTS}/tables/predictors_roc.csv",
    log:
        f"{LOGS}/score_predictors.log",
    benchmark:
        f"{LOGS}/benchmarks/score_predictors.tsv"
    params:
        pictures=options_of_pictures,
        n_spo=fixed("predictors.n_spo", PREDICTED_N_SPO),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        end=setting("truth.last_scale"),
        stable_above=setting("comparison.stable_above"),
        unstable_below=setting("comparison.unstable_below"),
        block=setting("predictors.block"),
        n_folds=setting("predictors.n_folds"),
        n_resamples=setting("predictors.n_resamples"),
        code=fingerprint("keystab.stages.score_predictors"),
        software=SOFTWARE,
    message:
        "Scoring predictors on detections of all pictures"
    shell:
        """
        python -m keystab.stages.score_predictors \
            {params.pictures} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --end {params.end} \
            --stable-above {params.stable_above} \
            --unstable-below {params.unstable_below} \
            --block {params.block} \
            --n-folds {params.n_folds} \
            --n-resamples {params.n_resamples} \
            --detections {output.detections:q} \
            --auc {output.auc:q} \
            --gain {output.gain:q} \
            --roc {output.roc:q} \
            >{log:q} 2>&1
        """
