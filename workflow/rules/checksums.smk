"""One list of all that the study of a scene ends in, so that a record holds its checksums.

Comes in: all figures, tables and verdicts. Goes out: final.sha256. Snakemake writes down what a job
was made from; of files that nothing is made from it would know no checksum, and whoever changed one
would not be noticed.
"""


rule checksums:
    """SHA-256 of every figure, table and verdict."""
    input:
        files=placed(plan.final_files, RESULTS, config["figures"], CLAIMED),
    output:
        checksums=f"{HERE}final.sha256",
    log:
        f"{LOG}checksums.log",
    benchmark:
        f"{BENCHMARK}checksums.tsv"
    params:
        **stage("list_checksums"),
    message:
        "Listing the digests of all figures, tables and verdicts{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
