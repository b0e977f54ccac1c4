"""Discrete extrema of the difference of Gaussians, with their refinement traces (section 2.1).

Comes in: the view 'still' and sets of views, or stored scale-spaces of them. Goes out:
keypoints/*.parquet, one table of extrema and one of refinement traces per sampling, and one table of
extrema per row of figure 3's grid; keypoints/{set}/*.parquet, the same for all views of a set; and
keypoints/floor/*.parquet, the extrema in variants of the arithmetic. Steps: search tile by tile for
samples above or below their 26 neighbours; follow each through its quadratic models, so that
max_offset and max_iterations can be decided afterwards.
"""


rule detect:
    """Detect the extrema of one balanced sampling, in its stored scale-space or streaming it."""
    input:
        **views("still"),
        store=ancient(files("scale_space/n{}", plan.kept_sampling, "{n_spo}")),
        store_digest=files("scale_space/n{}.sha256", plan.kept_sampling, "{n_spo}"),
    output:
        extrema=f"{HERE}keypoints/sampling_n{{n_spo}}.parquet",
        traces=f"{HERE}keypoints/traces_n{{n_spo}}.parquet",
    log:
        f"{LOG}detect/n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}detect/n{{n_spo}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_set, "still", "{n_spo}"),
        mem_mb=growing(job_resources.megabytes_of_store, "still", "{n_spo}"),
    params:
        **stage(
            "detect",
            parameters.Detection,
            parameters.RefinementPath,
            max_offset=of(plan.max_offset_of_path),
            n_spo="{n_spo}",
        ),
    message:
        "Detecting extrema at the balanced sampling of n_spo = {wildcards.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


use rule detect as detect_cosine with:
    input:
        **views("still"),
    output:
        extrema=f"{HERE}keypoints/cosine_n{{n_spo}}.parquet",
        traces=f"{HERE}keypoints/cosine_traces_n{{n_spo}}.parquet",
    log:
        f"{LOG}detect_cosine/n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}detect_cosine/n{{n_spo}}.tsv"
    params:
        **stage(
            "detect",
            parameters.Detection,
            parameters.RefinementPath,
            oversampling="cosine",
            max_offset=of(plan.max_offset_of_path),
            n_spo="{n_spo}",
        ),


rule detect_grid:
    """Detect the extrema of one row of figure 3's grid: one n_spo, every delta_min."""
    input:
        **views("still"),
    output:
        extrema=f"{HERE}keypoints/grid_n{{n_spo}}.parquet",
    log:
        f"{LOG}detect_grid/n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}detect_grid/n{{n_spo}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_grid, "{n_spo}"),
    params:
        **stage("detect_grid", "grid.delta_min", parameters.Detection, n_spo="{n_spo}"),
    message:
        "Detecting extrema at n_spo = {wildcards.n_spo}, delta_min = {params.delta_min}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule detect_views:
    """Detect the extrema of all views of a set at one sampling, in stores or streaming."""
    input:
        **views("{set}"),
        store=ancient(files("scale_space/{set}/n{n_spo}", plan.kept_set, "{set}")),
        store_digest=files("scale_space/{set}/n{n_spo}.sha256", plan.kept_set, "{set}"),
    output:
        extrema=f"{HERE}keypoints/{{set}}/extrema_n{{n_spo}}.parquet",
        traces=f"{HERE}keypoints/{{set}}/traces_n{{n_spo}}.parquet",
    log:
        f"{LOG}detect_views/{{set}}_n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}detect_views/{{set}}_n{{n_spo}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_set, "{set}", "{n_spo}"),
        mem_mb=growing(job_resources.megabytes_of_store, "{set}", "{n_spo}"),
    params:
        **stage(
            "detect_views",
            parameters.DetectionInViews,
            parameters.RefinementPath,
            max_offset=of(plan.max_offset_of_path),
            n_spo="{n_spo}",
        ),
    message:
        "Detecting extrema in the views '{wildcards.set}' at n_spo = {wildcards.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule detect_kappas:
    """Detect the extrema of the view for every ratio of the difference of Gaussians."""
    input:
        **views("still"),
    output:
        extrema=f"{HERE}keypoints/kappas_extrema.parquet",
        traces=f"{HERE}keypoints/kappas_traces.parquet",
    log:
        f"{LOG}detect_kappas.log",
    benchmark:
        f"{BENCHMARK}detect_kappas.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_kappas),
    params:
        **stage(
            "detect_kappas",
            "kappas.n_spo",
            "detector.sigma_min",
            "detector.oversampling",
            "detector.epsilon",
            parameters.RefinementPath,
            max_offset=of(plan.max_offset_of_path),
            kappas=of(plan.kappas),
        ),
    message:
        "Detecting extrema for all ratios of the difference of Gaussians{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule detect_variant:
    """Detect the extrema of balanced samplings in one variant of the arithmetic or the camera."""
    input:
        views=ancient(files("views/{set}", floor_variants.variant, "{variant}")),
        views_digest=files("views/{set}.sha256", floor_variants.variant, "{variant}"),
    output:
        extrema=f"{HERE}keypoints/floor/{{variant}}.parquet",
    log:
        f"{LOG}detect_variant/{{variant}}.log",
    benchmark:
        f"{BENCHMARK}detect_variant/{{variant}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_variant),
    params:
        **stage(
            "detect_variant",
            parameters.Scales,
            parameters.Arithmetic,
            n_spo=of(floor_variants.samplings, "{variant}"),
            epsilon=of(floor_variants.of_single_precision, "{variant}", "epsilon"),
            grey_range=of(floor_variants.of_single_precision, "{variant}", "grey_range"),
            sides=of(floor_variants.of_single_precision, "{variant}", "sides"),
        ),
    message:
        "Detecting extrema in the variant '{wildcards.variant}'{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
