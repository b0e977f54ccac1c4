"""Stored scale-spaces (section 2), for people to open and for detection to read.

Comes in: sets of views. Goes out: one store per n_spo in keep_scale_spaces for the view 'still',
{results}/scale_space/n{n_spo}; and where keep_scale_spaces is true one folder of stores per set and
n_spo, {results}/scale_space/{set}/n{n_spo}; each with a file of digests beside it. Steps: evaluate
the octave tile by tile; write each tile as a chunk; seal the store. Samplings that are not kept are
never written.
"""


rule scale_space:
    """Write one balanced scale-space of the view to a store."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        store=directory(f"{RESULTS}/scale_space/n{{n_spo}}"),
        digest=f"{RESULTS}/scale_space/n{{n_spo}}.sha256",
    log:
        f"{LOGS}/scale_space/n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/scale_space/n{{n_spo}}.tsv"
    wildcard_constraints:
        n_spo=one_of(KEPT),
    resources:
        runtime=minutes_of_view,
        mem_mb=memory_of_store,
    params:
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        code=fingerprint("keystab.stages.scale_space"),
        software=SOFTWARE,
    message:
        "Storing the balanced scale-space of n_spo = {wildcards.n_spo}"
    shell:
        """
        python -m keystab.stages.scale_space \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {wildcards.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --store {output.store:q} \
            --digest {output.digest:q} \
            >{log:q} 2>&1
        """


rule scale_spaces:
    """Write the balanced scale-spaces of all views of a set, one store per view and octave."""
    input:
        views=ancient(f"{RESULTS}/views/{{set}}"),
        digest=f"{RESULTS}/views/{{set}}.sha256",
    output:
        store=directory(f"{RESULTS}/scale_space/{{set}}/n{{n_spo}}"),
        digest=f"{RESULTS}/scale_space/{{set}}/n{{n_spo}}.sha256",
    log:
        f"{LOGS}/scale_spaces/{{set}}_n{{n_spo}}.log",
    benchmark:
        f"{LOGS}/benchmarks/scale_spaces/{{set}}_n{{n_spo}}.tsv"
    resources:
        runtime=minutes_of_set,
        mem_mb=memory_of_store,
    params:
        assumed_blur=assumed_blur_of_set,
        n_oct=setting("sets.{set}.n_oct"),
        delta_min=setting("sets.{set}.delta_min"),
        sigma_min=sigma_min_of_set,
        kappa=setting("detector.kappa"),
        oversampling=setting("detector.oversampling"),
        code=fingerprint("keystab.stages.scale_spaces"),
        software=SOFTWARE,
    message:
        "Storing the scale-spaces of the views '{wildcards.set}' at n_spo = {wildcards.n_spo}"
    shell:
        """
        python -m keystab.stages.scale_spaces \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {wildcards.n_spo} \
            --assumed-blur {params.assumed_blur} \
            --n-oct {params.n_oct} \
            --delta-min {params.delta_min} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --store {output.store:q} \
            --digest {output.digest:q} \
            >{log:q} 2>&1
        """
