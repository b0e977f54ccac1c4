"""One list of all that the study ends in, so that a record holds its digests.

Comes in: all figures, tables and verdicts. Goes out: {results}/final.sha256. Snakemake writes down
what a job was made from; of files that nothing is made from it would know no digest, and whoever
changed one would not be noticed.
"""


rule checksums:
    """SHA-256 of every figure, table and verdict."""
    input:
        FINAL,
    output:
        f"{RESULTS}/final.sha256",
    log:
        f"{LOGS}/checksums.log",
    benchmark:
        f"{LOGS}/benchmarks/checksums.tsv"
    params:
        code=fingerprint("keystab.stages.list_checksums"),
        software=SOFTWARE,
    message:
        "Listing the digests of all figures, tables and verdicts"
    shell:
        """
        python -m keystab.stages.list_checksums \
            --files {input:q} \
            --list {output:q} \
            >{log:q} 2>&1
        """
