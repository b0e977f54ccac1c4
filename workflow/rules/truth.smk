"""What a detector of any sampling should find: the true extrema of the continuous scale-space.

Comes in: {results}/views/still. Goes out: {results}/tables/truth_extrema.parquet, the extrema of
the octave from sigma_min to 2 sigma_min with how well conditioned each is.
Steps: climb from the discrete extrema of several samplings, by Newton's method on the full sums.
"""


rule find_truth:
    """Find the true extrema of the view that all samplings sample."""
    input:
        views=ancient(f"{RESULTS}/views/still"),
        digest=f"{RESULTS}/views/still.sha256",
    output:
        table=f"{RESULTS}/tables/truth_extrema.parquet",
    log:
        f"{LOGS}/find_truth.log",
    benchmark:
        f"{LOGS}/benchmarks/find_truth.tsv"
    params:
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        code=fingerprint("keystab.stages.find_truth"),
        software=SOFTWARE,
    message:
        "Finding the true extrema above {params.sigma_min} px"
    shell:
        """
        python -m keystab.stages.find_truth \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """
