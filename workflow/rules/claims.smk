"""What the paper claims, and what the tables answer.

Comes in: config/claims.yaml and the tables that its claims name. Goes out: claims.csv, .json and .md,
and, where it is asked for, claims_pictures.csv and .md. Steps: take the numbers of every claim from
the tables; ask its criterion; write the verdicts; put those of several pictures side by side, and
say what claims are over the scenes of the corpus.
"""

# Scenes of the corpus whose verdicts are there; tools/scenes.py makes them one after the other.
JUDGED = corpus.judged(CORPUS, SCENES, RESULTS)


rule claims:
    """A verdict for every claim of the paper."""
    input:
        tables=placed(plan.table_files, RESULTS, CLAIMED),
        claims=ancient(local(FILES.own("config/claims.yaml"))),  # its comments do not matter
    output:
        csv=f"{HERE}claims.csv",
        json=f"{HERE}claims.json",
        markdown=f"{HERE}claims.md",
    log:
        f"{LOG}claims.log",
    benchmark:
        f"{BENCHMARK}claims.tsv"
    params:
        **stage("check_claims", "reference", "draft", told={"settings": LAID_OVER}),
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


rule claims_scenes:
    """What claims are over the scenes of the corpus; no part of the study, since it takes hours."""
    input:
        verdicts=[f"{RESULTS}/{place}claims.csv" for place in JUDGED.values()],
    output:
        csv=f"{RESULTS}/scenes/claims.csv",
        json=f"{RESULTS}/scenes/claims.json",
        markdown=f"{RESULTS}/scenes/claims.md",
        over_scenes=f"{RESULTS}/scenes/claims_over_scenes.csv",
        by_family=f"{RESULTS}/scenes/claims_by_family.csv",
        numbers=f"{RESULTS}/scenes/numbers.csv",
    log:
        f"{config['logs']}/claims_scenes.log",
    benchmark:
        f"{config['logs']}/benchmarks/claims_scenes.tsv"
    params:
        **stage(
            "compare_scenes",
            names=list(JUDGED),
            families=[CORPUS[name].family for name in JUDGED],
        ),
    message:
        "Judging the claims over scenes"
    shell:
        "{params.command} >{log:q} 2>&1"


rule scenes:
    """Figure scenes: which claims hold on all scenes, and which depend on the family."""
    input:
        f"{RESULTS}/scenes/claims_over_scenes.csv",
        f"{RESULTS}/scenes/claims_by_family.csv",
    output:
        pdf=f"{config['figures']}/scenes.pdf",
        png=f"{config['figures']}/scenes.png",
    log:
        f"{config['logs']}/scenes.log",
    benchmark:
        f"{config['logs']}/benchmarks/scenes.tsv"
    params:
        **RULES.figure("scenes", config["draft"]),
    message:
        "Drawing {output.pdf}"
    shell:
        "{params.command} >{log:q} 2>&1"
