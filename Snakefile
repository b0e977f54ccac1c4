"""keystab: can a keypoint be trusted? The study's table of contents.

Comes in: a picture and the settings of config/config.yaml.
Goes out: figures/figN.pdf and .png, with the numbers that they draw in results/tables/figN*.csv,
results/claims.md, a verdict for every claim of the paper, and results/final.sha256, their digests.

    snakemake -j2                                      the whole study
    snakemake figures/fig5.pdf -j2                     one figure
    snakemake --configfile config/quick.yaml -j2       every figure in draft form
    snakemake --configfile config/what_if/X.yaml -j2   another answer to one question
"""

from keystab.study.wrong_targets import Offered
from snakemake.logging import logger


configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/simulate.smk"  # the picture of a scene -> sets of views
include: "workflow/rules/scale_space.smk"  # a view -> a stored scale-space, where one is kept
include: "workflow/rules/detect.smk"  # a view or its scale-space -> extrema, with refinement traces
include: "workflow/rules/truth.smk"  # a view -> what a detector should find, and what it finds of it
include: "workflow/rules/match.smk"  # extrema of many samplings -> tables
include: "workflow/rules/compare.smk"  # extrema of many views -> tables
include: "workflow/rules/scenes.smk"  # matches and true extrema of several scenes -> tables
include: "workflow/rules/theory.smk"  # settings -> tables of what needs no picture
include: "workflow/rules/claims.smk"  # tables -> verdicts on what the paper says
include: "workflow/rules/figures.smk"  # tables -> figures, as plan.FIGURES says
include: "workflow/rules/audit.smk"  # the picture -> detectors of others, where it is asked for
include: "workflow/rules/checksums.smk"  # all of these -> one list of checksums


rule all:
    """Every figure, every table, and the verdicts."""
    default_target: True
    input:
        plan.final_files("", RESULTS, config["figures"], CLAIMED),
        f"{RESULTS}/final.sha256",
        expand(f"{RESULTS}/scale_space/n{{n_spo}}.sha256", n_spo=plan.kept_n_spo(STUDY)),
    message:
        "All figures, tables and verdicts"


# Of a file that no rule makes, Snakemake says no more than that.
if workflow.modifier.is_main_snakefile():
    FINAL = plan.final_files("", RESULTS, config["figures"], CLAIMED)
    Offered(STUDY, SCENES, workflow.rules, FINAL).listen(logger)
