"""The simulated camera (section 4 of the paper).

Comes in: the reference picture. Goes out: one store per set of views, {results}/views/{set}, with
a file of digests beside it. Steps: check the picture's pixels; blur and sample the reference for
every view of the set; write the store; seal it.
"""


rule simulate:
    """Simulate one set of views of the scene."""
    input:
        reference=local(config["reference"]),
    output:
        store=directory(f"{RESULTS}/views/{{set}}"),
        digest=f"{RESULTS}/views/{{set}}.sha256",
    log:
        f"{LOGS}/simulate/{{set}}.log",
    benchmark:
        f"{LOGS}/benchmarks/simulate/{{set}}.tsv"
    resources:
        mem_mb=memory_of_reference,
    params:
        reference_sha256=setting("reference_sha256"),
        reference_blur=setting("reference_blur"),
        blur=of_every_view("blur"),
        step=of_every_view("step"),
        shift_y=of_every_view("shift_y"),
        shift_x=of_every_view("shift_x"),
        rotation=of_every_view("rotation"),
        noise=of_every_view("noise"),
        height=setting("sets.{set}.height"),
        width=setting("sets.{set}.width"),
        whole=setting("sets.{set}.whole"),
        guard=setting("sets.{set}.guard"),
        dtype=dtype_of_set,
        code=fingerprint("keystab.stages.simulate"),
        software=SOFTWARE,
    message:
        "Simulating the views '{wildcards.set}'"
    shell:
        """
        python -m keystab.stages.simulate \
            --reference {input.reference:q} \
            --reference-sha256 {params.reference_sha256} \
            --reference-blur {params.reference_blur} \
            --set {wildcards.set} \
            --blur {params.blur} \
            --step {params.step} \
            --shift-y {params.shift_y} \
            --shift-x {params.shift_x} \
            --rotation {params.rotation} \
            --noise {params.noise} \
            --height {params.height} \
            --width {params.width} \
            --whole {params.whole} \
            --guard {params.guard} \
            --dtype {params.dtype} \
            --store {output.store:q} \
            --digest {output.digest:q} \
            >{log:q} 2>&1
        """
