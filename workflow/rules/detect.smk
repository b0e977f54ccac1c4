"""Discrete extrema of the difference of Gaussians, with their refinement traces (section 2.1).

Comes in: the view 'still' and sets of views, or stored scale-spaces of them. Goes out:
{results}/keypoints/*.parquet, one table of extrema and one of refinement traces per sampling, and
one table of extrema per row of figure 3's grid; {results}/keypoints/{set}/*.parquet, the same for
all views of a set. Steps: search tile by tile for samples above or below their 26 neighbours; follow
each through its quadratic models, so that max_offset and max_iterations can be decided afterwards.
"""


rule detect:
    """Detect the extrema of one balanced sampling, streaming its scale-space."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        extrema=f"{RESULTS}/keypoints/sampling_n{{n_spo}}.parquet",
        traces=f"{RESULTS}/keypoints/traces_n{{n_spo}}.parquet",
    log:
        f"{LOGS}/detect/n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect/n{{n_spo}}.tsv"
    wildcard_constraints:
        n_spo=one_of(STREAMED),
    resources:
        runtime=minutes_of_view,
        mem_mb=memory_of_store,
    params:
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        epsilon=setting("detector.epsilon"),
        scale_moves=setting("refinement.scale_moves"),
        move=setting("refinement.move"),
        max_offset=max_offset_of_path,
        store=options_of_store,
        code=fingerprint("keystab.stages.detect"),
        software=SOFTWARE,
    message:
        "Detecting extrema at the balanced sampling of n_spo = {wildcards.n_spo}"
    shell:
        """
        python -m keystab.stages.detect \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {wildcards.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --scale-moves {params.scale_moves} \
            --move {params.move} \
            --max-offset {params.max_offset} \
            {params.store} \
            --extrema {output.extrema:q} \
            --traces {output.traces:q} \
            >{log:q} 2>&1
        """


use rule detect as detect_stored with:
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
        store=ancient(f"{RESULTS}/scale_space/n{{n_spo}}"),
        store_digest=f"{RESULTS}/scale_space/n{{n_spo}}.sha256",
    wildcard_constraints:
        n_spo=one_of(KEPT),


use rule detect as detect_cosine with:
    output:
        extrema=f"{RESULTS}/keypoints/cosine_n{{n_spo}}.parquet",
        traces=f"{RESULTS}/keypoints/cosine_traces_n{{n_spo}}.parquet",
    log:
        f"{LOGS}/detect_cosine/n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_cosine/n{{n_spo}}.tsv"
    wildcard_constraints:
        n_spo="[0-9]+",
    params:
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling="cosine",
        epsilon=setting("detector.epsilon"),
        scale_moves=setting("refinement.scale_moves"),
        move=setting("refinement.move"),
        max_offset=max_offset_of_path,
        store="",
        code=fingerprint("keystab.stages.detect"),
        software=SOFTWARE,


rule detect_grid:
    """Detect the extrema of one row of figure 3's grid: one n_spo, every delta_min."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        extrema=f"{RESULTS}/keypoints/grid_n{{n_spo}}.parquet",
    log:
        f"{LOGS}/detect_grid/n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_grid/n{{n_spo}}.tsv"
    resources:
        runtime=minutes_of_grid,
    params:
        delta_min=setting("grid.delta_min"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        epsilon=setting("detector.epsilon"),
        code=fingerprint("keystab.stages.detect_grid"),
        software=SOFTWARE,
    message:
        "Detecting extrema at n_spo = {wildcards.n_spo}, delta_min = {params.delta_min}"
    shell:
        """
        python -m keystab.stages.detect_grid \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {wildcards.n_spo} \
            --delta-min {params.delta_min} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --extrema {output.extrema:q} \
            >{log:q} 2>&1
        """


rule detect_views:
    """Detect the extrema of all views of a set at one sampling, streaming their scale-spaces."""
    input:
        views=ancient(f"{RESULTS}/views/{{set}}"),
        digest=f"{RESULTS}/views/{{set}}.sha256",
    output:
        extrema=f"{RESULTS}/keypoints/{{set}}/extrema_n{{n_spo}}.parquet",
        traces=f"{RESULTS}/keypoints/{{set}}/traces_n{{n_spo}}.parquet",
    log:
        f"{LOGS}/detect_views/{{set}}_n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_views/{{set}}_n{{n_spo}}.tsv"
    wildcard_constraints:
        set=one_of(STREAMED_SETS),
    resources:
        runtime=minutes_of_set,
        mem_mb=memory_of_store,
    params:
        assumed_blur=assumed_blur_of_set,
        n_oct=setting("sets.{set}.n_oct"),
        guard=setting("sets.{set}.guard"),
        delta_min=setting("sets.{set}.delta_min"),
        sigma_min=sigma_min_of_set,
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        epsilon=setting("detector.epsilon"),
        scale_moves=setting("refinement.scale_moves"),
        move=setting("refinement.move"),
        max_offset=max_offset_of_path,
        store=options_of_store,
        code=fingerprint("keystab.stages.detect_views"),
        software=SOFTWARE,
    message:
        "Detecting extrema in the views '{wildcards.set}' at n_spo = {wildcards.n_spo}"
    shell:
        """
        python -m keystab.stages.detect_views \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {wildcards.n_spo} \
            --assumed-blur {params.assumed_blur} \
            --n-oct {params.n_oct} \
            --guard {params.guard} \
            --delta-min {params.delta_min} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --scale-moves {params.scale_moves} \
            --move {params.move} \
            --max-offset {params.max_offset} \
            {params.store} \
            --extrema {output.extrema:q} \
            --traces {output.traces:q} \
            >{log:q} 2>&1
        """


use rule detect_views as detect_stored_views with:
    input:
        views=ancient(f"{RESULTS}/views/{{set}}"),
        digest=f"{RESULTS}/views/{{set}}.sha256",
        store=ancient(f"{RESULTS}/scale_space/{{set}}/n{{n_spo}}"),
        store_digest=f"{RESULTS}/scale_space/{{set}}/n{{n_spo}}.sha256",
    wildcard_constraints:
        set=one_of(KEPT_SETS),


rule detect_kappas:
    """Detect the extrema of the view for every ratio of the difference of Gaussians."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        extrema=f"{RESULTS}/keypoints/kappas_extrema.parquet",
        traces=f"{RESULTS}/keypoints/kappas_traces.parquet",
    log:
        f"{LOGS}/detect_kappas.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_kappas.tsv"
    resources:
        runtime=minutes_of_kappas,
    params:
        n_spo=setting("kappas.n_spo"),
        kappas=kappas,
        sigma_min=setting("detector.sigma_min"),
        oversampling=setting("detector.oversampling"),
        epsilon=setting("detector.epsilon"),
        scale_moves=setting("refinement.scale_moves"),
        move=setting("refinement.move"),
        max_offset=max_offset_of_path,
        code=fingerprint("keystab.stages.detect_kappas"),
        software=SOFTWARE,
    message:
        "Detecting extrema for all ratios of the difference of Gaussians"
    shell:
        """
        python -m keystab.stages.detect_kappas \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {params.n_spo} \
            --kappas {params.kappas} \
            --sigma-min {params.sigma_min} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --scale-moves {params.scale_moves} \
            --move {params.move} \
            --max-offset {params.max_offset} \
            --extrema {output.extrema:q} \
            --traces {output.traces:q} \
            >{log:q} 2>&1
        """
