"""What several scenes say together (figure predictors).

Comes in: views, extrema, unique keypoints and true extrema of the default scene and of further ones,
scenes/{name}/*, made by the same rules. Goes out: tables/predictors_*. Steps: compute predictors of
single detections; fit models and score them on blocks and scenes that they have not seen.
"""


rule score_predictors:
    """Figure predictors: what single detections tell, and models of it on what they have not seen."""
    input:
        views=ancient(files("views/still", scenes.scored_scenes)),
        views_digest=files("views/still.sha256", scenes.scored_scenes),
        keypoints=files("tables/fig4_keypoints.csv", scenes.scored_scenes),
        truth=files("truth/view.parquet", scenes.scored_scenes),
        samplings=files("keypoints/sampling_n{n_spo}.parquet", scenes.scored_samplings),
    output:
        detections=f"{RESULTS}/tables/predictors_detections.parquet",
        auc=f"{RESULTS}/tables/predictors_auc.csv",
        gain=f"{RESULTS}/tables/predictors_gain.csv",
        roc=f"{RESULTS}/tables/predictors_roc.csv",
    log:
        f"{config['logs']}/score_predictors.log",
    benchmark:
        f"{config['logs']}/benchmarks/score_predictors.tsv"
    params:
        **stage(
            "score_predictors",
            parameters.Scales,
            parameters.Same,
            parameters.Compared,
            parameters.Stable,
            parameters.Folds,
            "predictors.n_resamples",
            names=column("name", scenes.scored_scenes),
            n_spo=of(scenes.scored_n_spo),
            end=setting("truth.last_scale"),
        ),
    message:
        "Scoring predictors on detections of all pictures"
    shell:
        "{params.command} >{log:q} 2>&1"
