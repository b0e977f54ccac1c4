"""Detectors of others against what is there; no part of the study, since it needs their libraries.

Comes in: the picture of a scene. Goes out: tables/audit*.csv and figures/audit.pdf. Steps: find the
true extrema of the scene; show one detector the views of one condition, in processes of its own, of
an environment of its own where there is one (.venv-audit, from audit.lock); put all of it together.
How long detectors take stands beside the logs, where no digest counts it.
"""

from keystab.provenance.bare_code import bare_digest

WORKER = code_digest.PACKAGE_FOLDER / "audit/worker.py"

AUDITING = FILES.beside(".venv-audit/bin/python")
if AUDITING and Path(AUDITING).exists():
    os.environ.setdefault("KEYSTAB_AUDIT_PYTHON", str(Path(AUDITING).absolute()))


wildcard_constraints:
    detector="[a-z]+",
    condition="[a-z]+(_[0-9.]+)?",


rule find_audit_truth:
    """Figure audit: the true extrema of the scene that detectors are shown."""
    input:
        reference=local(of(plan.setting, "reference")),
    output:
        scene=f"{HERE}audit/scene.npy",
        truth=f"{HERE}audit/truth.parquet",
    log:
        f"{LOG}audit/truth.log",
    benchmark:
        f"{BENCHMARK}audit/truth.tsv"
    resources:
        mem_mb=growing(job_resources.megabytes_of_reference),
    params:
        **stage("find_audit_truth", parameters.AuditPlan),
    message:
        "Finding the true extrema of the scene for an audit{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule audit_detector:
    """Figure audit: one detector, with all its settings, in one condition."""
    input:
        scene=f"{HERE}audit/scene.npy",
        truth=f"{HERE}audit/truth.parquet",
    output:
        audit=f"{HERE}audit/{{detector}}/{{condition}}.csv",
        octaves=f"{HERE}audit/{{detector}}/{{condition}}_octaves.csv",
        phases=f"{HERE}audit/{{detector}}/{{condition}}_phases.csv",
    log:
        f"{LOG}audit/{{detector}}/{{condition}}.log",
    benchmark:
        f"{BENCHMARK}audit/{{detector}}/{{condition}}.tsv"
    params:
        **stage(
            "audit_detector",
            parameters.AuditPlan,
            detector="{detector}",
            condition="{condition}",
            durations=f"{LOG}audit/{{detector}}/{{condition}}_durations.csv",
        ),
        # What runs in processes of its own is not imported by the stage.
        worker=parameter("code of the worker", bare_digest(WORKER.read_bytes())),
        detectors=parameter(
            "code of keystab's detector", code_digest.fingerprint("keystab.prediction.uncertainty")
        ),
        libraries=parameter(
            "audit.lock",
            hashlib.sha256(Path(FILES.own("audit.lock")).read_bytes()).hexdigest(),
        ),
    message:
        "Auditing {wildcards.detector}: {wildcards.condition}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule gather_audits:
    """Figure audit: all detectors in all conditions."""
    input:
        audits=files("audit/{detector}/{condition}.csv", plan.audits),
        audits_by_octave=files("audit/{detector}/{condition}_octaves.csv", plan.audits),
        audits_by_phase=files("audit/{detector}/{condition}_phases.csv", plan.audits),
    output:
        audit=f"{HERE}tables/audit.csv",
        octaves=f"{HERE}tables/audit_octaves.csv",
        phases=f"{HERE}tables/audit_phases.csv",
    log:
        f"{LOG}audit/gather.log",
    benchmark:
        f"{BENCHMARK}audit/gather.tsv"
    params:
        **stage("gather_audits"),
    message:
        "Gathering what was found of all detectors{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule audit:
    """Figure audit: detectors of others against what is there."""
    input:
        audit=f"{HERE}tables/audit.csv",
        octaves=f"{HERE}tables/audit_octaves.csv",
    output:
        pdf=f"{DRAWN}audit.pdf",
        png=f"{DRAWN}audit.png",
    log:
        f"{LOG}audit/figure.log",
    benchmark:
        f"{BENCHMARK}audit/figure.tsv"
    params:
        **RULES.figure("audit", config["draft"]),
    message:
        "Drawing {output.pdf}"
    shell:
        "{params.command} >{log:q} 2>&1"
