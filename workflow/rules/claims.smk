"""The ledger of claims: what the paper says, and what the tables answer.

Comes in: config/claims.yaml and the tables that its claims name. Goes out: {results}/claims.csv,
.json and .md, and, where it is asked for, {results}/claims_pictures.csv and .md. Steps: take the
numbers of every claim from the tables; ask its criterion; write the verdicts; put those of several
pictures side by side.
"""

from keystab.study.claims import read_claims, table_names

try:
    CLAIMS = read_claims(Path(workflow.basedir, "config/claims.yaml"))
except InputError as problem:
    sys.exit(str(problem))


rule claims:
    """A verdict for every claim of the paper."""
    input:
        tables=expand(f"{RESULTS}/tables/{{table}}.csv", table=table_names(CLAIMS)),
        claims=ancient(local("config/claims.yaml")),  # its comments do not matter
    output:
        csv=f"{RESULTS}/claims.csv",
        json=f"{RESULTS}/claims.json",
        markdown=f"{RESULTS}/claims.md",
    log:
        f"{LOGS}/claims.log",
    benchmark:
        f"{LOGS}/benchmarks/claims.tsv"
    params:
        tables=folder_of_inputs,
        claims=hashlib.sha256(repr(CLAIMS).encode()).hexdigest(),
        code=fingerprint("keystab.stages.judge_claims"),
        software=SOFTWARE,
    message:
        "Judging the claims of the paper"
    shell:
        """
        python -m keystab.stages.judge_claims \
            --claims {input.claims:q} \
            --tables {params.tables:q} \
            --csv {output.csv:q} \
            --json {output.json:q} \
            --markdown {output.markdown:q} \
            >{log:q} 2>&1
        """


rule claims_pictures:
    """Which verdicts depend on the picture; no part of the study, since it needs several."""
    input:
        ledgers=ledgers_of_pictures,
    output:
        csv=f"{RESULTS}/claims_pictures.csv",
        markdown=f"{RESULTS}/claims_pictures.md",
    log:
        f"{LOGS}/claims_pictures.log",
    benchmark:
        f"{LOGS}/benchmarks/claims_pictures.tsv"
    params:
        names=names_of_pictures,
        code=fingerprint("keystab.stages.compare_claims"),
        software=SOFTWARE,
    message:
        "Comparing the ledgers of {params.names}"
    shell:
        """
        python -m keystab.stages.compare_claims \
            --ledgers {input.ledgers:q} \
            --names {params.names} \
            --csv {output.csv:q} \
            --markdown {output.markdown:q} \
            >{log:q} 2>&1
        """
