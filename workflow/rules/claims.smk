"""What the paper claims, and what the tables answer.

Comes in: config/claims.yaml and the tables that its claims name. Goes out: claims.csv, .json and .md,
and, where it is asked for, claims_pictures.csv and .md. Steps: take the numbers of every claim from
the tables; ask its criterion; write the verdicts; put those of several pictures side by side.
"""


rule claims:
    """A verdict for every claim of the paper."""
    input:
        tables=placed(plan.table_files, RESULTS, CLAIMED),
        claims=ancient(local("config/claims.yaml")),  # its comments do not matter
    output:
        csv=f"{HERE}claims.csv",
        json=f"{HERE}claims.json",
        markdown=f"{HERE}claims.md",
    log:
        f"{LOG}claims.log",
    benchmark:
        f"{BENCHMARK}claims.tsv"
    params:
        **stage("check_claims"),
        criteria=parameter("criteria", hashlib.sha256(repr(CLAIMS).encode()).hexdigest()),
    message:
        "Judging the claims of the paper{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule claims_pictures:
    """Which verdicts depend on the picture; no part of the study, since it needs several."""
    input:
        verdicts=verdicts_of_pictures,
    output:
        csv=f"{RESULTS}/claims_pictures.csv",
        markdown=f"{RESULTS}/claims_pictures.md",
    log:
        f"{config['logs']}/claims_pictures.log",
    benchmark:
        f"{config['logs']}/benchmarks/claims_pictures.tsv"
    params:
        **stage("compare_claims", names=names_of_pictures),
    message:
        "Comparing the verdicts on {params.names}"
    shell:
        "{params.command} >{log:q} 2>&1"
