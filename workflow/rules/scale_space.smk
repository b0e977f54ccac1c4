"""Stored scale-spaces (section 2), for people to open and for detection to read.

Comes in: sets of views. Goes out: one store per n_spo in keep_scale_spaces for the view 'still',
scale_space/n{n_spo}; and where keep_scale_spaces is true one folder of stores per set and n_spo,
scale_space/{set}/n{n_spo}; each with a file of checksums beside it. Steps: evaluate the octave tile
by tile; write each tile as a chunk; list the store's checksums. Samplings that are not kept are
never written.
"""


rule scale_space:
    """Write one balanced scale-space of the view to a store."""
    input:
        **views("still"),
    output:
        store=directory(f"{HERE}scale_space/n{{n_spo}}"),
        store_digest=f"{HERE}scale_space/n{{n_spo}}.sha256",
    log:
        f"{LOG}scale_space/n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}scale_space/n{{n_spo}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_set, "still", "{n_spo}"),
        mem_mb=growing(job_resources.megabytes_of_store, "still", "{n_spo}"),
    params:
        **stage("scale_space", parameters.DifferenceOfGaussians, n_spo="{n_spo}"),
    message:
        "Storing the balanced scale-space of n_spo = {wildcards.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule scale_spaces:
    """Write the balanced scale-spaces of all views of a set, one store per view and octave."""
    input:
        **views("{set}"),
    output:
        store=directory(f"{HERE}scale_space/{{set}}/n{{n_spo}}"),
        store_digest=f"{HERE}scale_space/{{set}}/n{{n_spo}}.sha256",
    log:
        f"{LOG}scale_spaces/{{set}}_n{{n_spo}}.log",
    benchmark:
        f"{BENCHMARK}scale_spaces/{{set}}_n{{n_spo}}.tsv"
    resources:
        runtime=growing(job_resources.minutes_of_set, "{set}", "{n_spo}"),
        mem_mb=growing(job_resources.megabytes_of_store, "{set}", "{n_spo}"),
    params:
        **stage("scale_spaces", parameters.ScaleSpaceOfViews, n_spo="{n_spo}"),
    message:
        "Storing the scale-spaces of the views '{wildcards.set}' at n_spo = {wildcards.n_spo}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
