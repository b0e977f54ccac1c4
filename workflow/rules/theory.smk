"""What theory says of blurs, cameras, blobs and noise (sections 2.3, 3.2, 4 and 6.3).

Comes in: settings, and for what the text states of views the picture. Goes out: tables/fig1*.csv,
figS3*.csv, figS4.csv and, beside the other tables of figure 12, fig12_theory.csv;
aliasing_energy.csv, wrong_blur_identity.csv, zoomed_truth.csv and reference_noise.csv. Steps: the
semigroup property of discrete blurs; the point spread functions of model cameras and the Gaussians
nearest to them; Gaussian blobs of many sizes, the scales at which they are detected, and those that
closed forms predict; the noise of the difference of Gaussians.
"""


rule semigroup:
    """Figure 1: blur a blob many times by little and once by much, in three ways."""
    output:
        table=f"{RESULTS}/tables/fig1.csv",
    log:
        f"{config['logs']}/semigroup.log",
    benchmark:
        f"{config['logs']}/benchmarks/semigroup.tsv"
    params:
        **stage("semigroup", parameters.Semigroup),
    message:
        "Blurring a blob of {params.blob} px {params.n_passes} times and once"
    shell:
        "{params.command} >{log:q} 2>&1"


rule sampling_theory:
    """Beside figure 1: how much blur samplings add, and whether their steps are balanced."""
    output:
        table=f"{RESULTS}/tables/fig1_samplings.csv",
    log:
        f"{config['logs']}/sampling_theory.log",
    benchmark:
        f"{config['logs']}/benchmarks/sampling_theory.tsv"
    params:
        **stage(
            "sampling_theory",
            "samplings.n_spo",
            parameters.Scales,
            parameters.Semigroup,
            sift_sigma_min=setting("sets.shipped.sigma_min"),
            sift_delta_min=setting("sets.shipped.delta_min"),
        ),
    message:
        "Comparing the blurs and the steps of the samplings n_spo = {params.n_spo}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule camera_optics:
    """Figure S3: the Gaussian blur that stands for a lens and its pixels."""
    output:
        table=f"{RESULTS}/tables/figS3.csv",
        profiles=f"{RESULTS}/tables/figS3_profiles.csv",
        ranges=f"{RESULTS}/tables/figS3_ranges.csv",
    log:
        f"{config['logs']}/camera_optics.log",
    benchmark:
        f"{config['logs']}/benchmarks/camera_optics.tsv"
    params:
        **stage("camera_optics", parameters.Optics),
    message:
        "Fitting Gaussians to the blur of cameras with pixels of {params.pixel_pitches} um"
    shell:
        "{params.command} >{log:q} 2>&1"


rule detect_blobs:
    """Figure S4: detect blobs of many sizes in all ways that are compared."""
    output:
        extrema=f"{RESULTS}/keypoints/blobs_extrema.parquet",
        traces=f"{RESULTS}/keypoints/blobs_traces.parquet",
    log:
        f"{config['logs']}/detect_blobs.log",
    benchmark:
        f"{config['logs']}/benchmarks/detect_blobs.tsv"
    params:
        **stage("detect_blobs", parameters.Blobs),
    message:
        "Detecting blobs of {params.size_from} to {params.size_to} px at n_spo = {params.n_spo}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule match_blobs:
    """Figure S4: the scales at which blobs are detected, and those that theory says."""
    input:
        extrema=f"{RESULTS}/keypoints/blobs_extrema.parquet",
        traces=f"{RESULTS}/keypoints/blobs_traces.parquet",
    output:
        table=f"{RESULTS}/tables/figS4.csv",
    log:
        f"{config['logs']}/match_blobs.log",
    benchmark:
        f"{config['logs']}/benchmarks/match_blobs.tsv"
    params:
        **stage("match_blobs", parameters.Blobs, parameters.Acceptance),
    message:
        "Comparing the scales of blobs with theory"
    shell:
        "{params.command} >{log:q} 2>&1"


rule noise_theory:
    """Figure 12: noise of the difference of Gaussians against scale, in closed form."""
    output:
        table=f"{HERE}tables/fig12_theory.csv",
    log:
        f"{LOG}noise_theory.log",
    benchmark:
        f"{BENCHMARK}noise_theory.tsv"
    params:
        **stage(
            "noise_theory",
            parameters.Scales,
            "sets.{set}.n_oct",
            of_set=plan.sets_of_figure(STUDY, "fig12")[0],
            camera_blur=of(plan.largest_blur, "fig12"),
        ),
    message:
        "Computing the noise of the difference of Gaussians{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule view_statements:
    """Statements on the camera and on single views: aliasing, wrong blurs, zooms, noise."""
    input:
        **views("still"),
        reference=local(of(plan.setting, "reference")),
    output:
        aliasing=f"{HERE}tables/aliasing_energy.csv",
        wrong_blur=f"{HERE}tables/wrong_blur_identity.csv",
        zoomed=f"{HERE}tables/zoomed_truth.csv",
        noisy=f"{HERE}tables/reference_noise.csv",
    log:
        f"{LOG}view_statements.log",
    benchmark:
        f"{BENCHMARK}view_statements.tsv"
    resources:
        mem_mb=growing(job_resources.megabytes_of_reference),
    params:
        **stage(
            "view_statements",
            parameters.Detection,
            parameters.Refining,
            parameters.Compared,
            parameters.Same,
            parameters.Stated,
            n_spo=of(plan.finest_curve),
        ),
    message:
        "Measuring aliasing, true extrema at zooms {params.zooms} and noise of the reference"
        "{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
