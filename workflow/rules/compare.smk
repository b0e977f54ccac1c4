"""What the detections in many views of the scene have in common (sections 5.5 to 6.3).

Comes in: tables of extrema and refinement traces of sets of views. Goes out: tidy tables,
{results}/tables/fig7*.csv to fig12*.csv, figS1*.csv and figS2.csv, that the figures draw. Steps:
accept refined keypoints; bring them to the frame of the first view; keep the common field of view
and range of scales; find the minimum set of unique keypoints; look each up in every view; curves,
precisions and counts with their intervals.
"""


rule match_views:
    """Figures 7, 8, S1: stability and precision across translations, zoom-outs, rotations."""
    input:
        views=views_of_figure,
        digest=digest_of_figure,
        extrema=extrema_of_figure,
        traces=traces_of_figure,
    output:
        curves=f"{RESULTS}/tables/{{figure}}_curves.csv",
        precision=f"{RESULTS}/tables/{{figure}}_precision.csv",
        counts=f"{RESULTS}/tables/{{figure}}_counts.csv",
    log:
        f"{LOGS}/match_views/{{figure}}.log",
    benchmark:
        f"{LOGS}/benchmarks/match_views/{{figure}}.tsv"
    wildcard_constraints:
        figure=one_of(VIEWS_OF),
    params:
        n_spo=of_views("n_spo"),
        curve_n_spo=setting("stability.curve_n_spo"),
        sigma_min=sigma_min_of_views,
        n_oct=of_views("n_oct"),
        guard=of_views("guard"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        max_offsets=further_max_offsets,
        iterations=further_iterations,
        minimum_share=setting("stability.minimum_share"),
        n_resamples=setting("stability.n_resamples"),
        code=fingerprint("keystab.stages.match_views"),
        software=SOFTWARE,
    message:
        "Matching the keypoints of {wildcards.figure} at n_spo = {params.n_spo}"
    shell:
        """
        python -m keystab.stages.match_views \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --n-spo {params.n_spo} \
            --curve-n-spo {params.curve_n_spo} \
            --sigma-min {params.sigma_min} \
            --n-oct {params.n_oct} \
            --guard {params.guard} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --max-offsets {params.max_offsets} \
            --iterations {params.iterations} \
            --minimum-share {params.minimum_share} \
            --n-resamples {params.n_resamples} \
            --curves {output.curves:q} \
            --precision {output.precision:q} \
            --counts {output.counts:q} \
            >{log:q} 2>&1
        """


rule match_shipped:
    """Figure 7: stability of SIFT as it is shipped, with and without its filters."""
    input:
        views=ancient(f"{RESULTS}/views/shipped"),
        digest=f"{RESULTS}/views/shipped.sha256",
        extrema=detections_of("shipped", "extrema"),
        traces=detections_of("shipped", "traces"),
    output:
        curves=f"{RESULTS}/tables/fig7_shipped.csv",
        counts=f"{RESULTS}/tables/fig7_shipped_counts.csv",
    log:
        f"{LOGS}/match_shipped.log",
    benchmark:
        f"{LOGS}/benchmarks/match_shipped.tsv"
    params:
        sigma_min=setting("sets.shipped.sigma_min"),
        n_oct=setting("sets.shipped.n_oct"),
        guard=setting("sets.shipped.guard"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("shipped.max_iterations"),
        contrast=setting("shipped.contrast"),
        edge_ratio=setting("shipped.edge_ratio"),
        n_resamples=setting("stability.n_resamples"),
        code=fingerprint("keystab.stages.match_shipped"),
        software=SOFTWARE,
    message:
        "Matching the keypoints of SIFT as shipped"
    shell:
        """
        python -m keystab.stages.match_shipped \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --sigma-min {params.sigma_min} \
            --n-oct {params.n_oct} \
            --guard {params.guard} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --contrast {params.contrast} \
            --edge-ratio {params.edge_ratio} \
            --n-resamples {params.n_resamples} \
            --curves {output.curves:q} \
            --counts {output.counts:q} \
            >{log:q} 2>&1
        """


rule match_kappas:
    """Figure 9: which keypoint is detected with which ratio of the difference of Gaussians."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        extrema=f"{RESULTS}/keypoints/kappas_extrema.parquet",
        traces=f"{RESULTS}/keypoints/kappas_traces.parquet",
    output:
        counts=f"{RESULTS}/tables/fig9_counts.csv",
        keypoints=f"{RESULTS}/tables/fig9_keypoints.csv",
        occurrence=f"{RESULTS}/tables/fig9_occurrence.csv",
    log:
        f"{LOGS}/match_kappas.log",
    benchmark:
        f"{LOGS}/benchmarks/match_kappas.tsv"
    params:
        n_spo=setting("kappas.n_spo"),
        kappas=kappas,
        sigma_min=setting("detector.sigma_min"),
        border=setting("comparison.border"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.match_kappas"),
        software=SOFTWARE,
    message:
        "Matching the keypoints of all ratios of the difference of Gaussians"
    shell:
        """
        python -m keystab.stages.match_kappas \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --n-spo {params.n_spo} \
            --kappas {params.kappas} \
            --sigma-min {params.sigma_min} \
            --border {params.border} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --counts {output.counts:q} \
            --keypoints {output.keypoints:q} \
            --occurrence {output.occurrence:q} \
            >{log:q} 2>&1
        """


rule match_sweep:
    """Figures 11 and 12: stability across views against unknown blur and noise, and scale."""
    input:
        views=views_of_sweep,
        digest=of_sweep(f"{RESULTS}/views/{{set}}.sha256"),
        extrema=detections_of_sweep("extrema"),
        traces=detections_of_sweep("traces"),
    output:
        curves=f"{RESULTS}/tables/{{figure}}_curves.csv",
        counts=f"{RESULTS}/tables/{{figure}}_counts.csv",
        scales=f"{RESULTS}/tables/{{figure}}_scales.csv",
    log:
        f"{LOGS}/match_sweep/{{figure}}.log",
    benchmark:
        f"{LOGS}/benchmarks/match_sweep/{{figure}}.tsv"
    wildcard_constraints:
        figure=one_of(sorted(set(SWEEP_OF) - {"fig10"})),
    params:
        name=name_of_sweep,
        values=values_of_sweep,
        sigma_min=sigma_min_of_views,
        n_oct=in_sweep("n_oct"),
        guard=in_sweep("guard"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        octaves=octaves_of_sweep,
        scales=table_of_scales,
        n_resamples=setting("stability.n_resamples"),
        code=fingerprint("keystab.stages.match_sweep"),
        software=SOFTWARE,
    message:
        "Matching the keypoints of {wildcards.figure} for {params.name} = {params.values}"
    shell:
        """
        python -m keystab.stages.match_sweep \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --name {params.name} \
            --values {params.values} \
            --sigma-min {params.sigma_min} \
            --n-oct {params.n_oct} \
            --guard {params.guard} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            {params.octaves} \
            --n-resamples {params.n_resamples} \
            --curves {output.curves:q} \
            --counts {output.counts:q} \
            {params.scales} \
            >{log:q} 2>&1
        """


use rule match_sweep as match_aliasing with:
    output:
        curves=f"{RESULTS}/tables/{{figure}}_curves.csv",
        counts=f"{RESULTS}/tables/{{figure}}_counts.csv",
    wildcard_constraints:
        figure="fig10",


rule crop_views:
    """Figure 12 b: a piece of a view at every noise."""
    input:
        views=ancient([f"{RESULTS}/views/{one.name}" for one in SWEEPS["noise"]]),
        digest=[f"{RESULTS}/views/{one.name}.sha256" for one in SWEEPS["noise"]],
    output:
        table=f"{RESULTS}/tables/fig12_pixels.parquet",
    log:
        f"{LOGS}/crop_views.log",
    benchmark:
        f"{LOGS}/benchmarks/crop_views.tsv"
    params:
        values=fixed("noise.sweep", [one.value for one in SWEEPS["noise"]]),
        code=fingerprint("keystab.stages.crop_views"),
        software=SOFTWARE,
    message:
        "Cropping views with noise {params.values}"
    shell:
        """
        python -m keystab.stages.crop_views \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --name noise \
            --values {params.values} \
            --size 64 \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule match_blurs:
    """Figure S2: keypoints of views whose blur is not the assumed one."""
    input:
        views=ancient(f"{RESULTS}/views/blur_errors"),
        digest=f"{RESULTS}/views/blur_errors.sha256",
        extrema=detections_of("blur_errors", "extrema"),
        traces=detections_of("blur_errors", "traces"),
    output:
        table=f"{RESULTS}/tables/figS2.csv",
    log:
        f"{LOGS}/match_blurs.log",
    benchmark:
        f"{LOGS}/benchmarks/match_blurs.tsv"
    params:
        assumed_blur=setting("sets.blur_errors.assumed_blur"),
        kappa=setting("detector.kappa"),
        sigma_min=setting("detector.sigma_min"),
        n_oct=setting("sets.blur_errors.n_oct"),
        guard=setting("sets.blur_errors.guard"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.match_blurs"),
        software=SOFTWARE,
    message:
        "Comparing views of other blurs with that of the assumed blur {params.assumed_blur}"
    shell:
        """
        python -m keystab.stages.match_blurs \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --assumed-blur {params.assumed_blur} \
            --kappa {params.kappa} \
            --sigma-min {params.sigma_min} \
            --n-oct {params.n_oct} \
            --guard {params.guard} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """
