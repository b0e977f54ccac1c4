"""keystab: can a keypoint be trusted? The study's table of contents.

Comes in: a picture and the settings of config/config.yaml.
Goes out: figures/figN.pdf and .png, with the numbers that they draw in results/tables/figN*.csv,
results/claims.md, a verdict for every claim of the paper, and results/final.sha256, their digests.

    snakemake -j2                                      the whole study
    snakemake figures/fig5.pdf -j2                     one figure
    snakemake --configfile config/quick.yaml -j2       every figure in draft form
    snakemake --configfile config/what_if/X.yaml -j2   another answer to one question
"""


configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/sets.smk"
include: "workflow/rules/resources.smk"
include: "workflow/rules/simulate.smk"  # the reference picture -> sets of views
include: "workflow/rules/scale_space.smk"  # a view -> a stored scale-space, where one is kept
include: "workflow/rules/detect.smk"  # a view or its scale-space -> extrema, with refinement traces
include: "workflow/rules/truth.smk"  # a view -> what a detector should find, where it is asked for
include: "workflow/rules/match.smk"  # extrema of many samplings -> tables
include: "workflow/rules/predict.smk"  # matches and truth of several pictures -> tables
include: "workflow/rules/compare.smk"  # extrema of many views -> tables
include: "workflow/rules/floor.smk"  # views -> extrema in variants of the arithmetic -> tables
include: "workflow/rules/theory.smk"  # settings -> tables of what needs no picture
include: "workflow/rules/claims.smk"  # tables -> verdicts on what the paper says
include: "workflow/rules/figures.smk"  # tables -> figures


# Figure -> what it shows -> tables that it draws; the rules are in workflow/rules/figures.smk.
#
#   fig1  discrete Gaussian blurs and the semigroup property    fig1.csv
#   fig2  simulated views                                       fig2.csv, fig2_pixels.parquet
#   fig3  number of extrema against the sampling                fig3.csv
#   fig4  extrema that come and go as the sampling gets finer   fig4_*.csv
#   fig5  features against stability                            fig5_*.csv
#   fig6  iso-surfaces around stable and unstable keypoints     fig6.csv, fig6_cubes.parquet
#   fig7  limits of the refinement, under translations          fig7_*.csv
#   fig8  stability and precision when the camera zooms out     fig8_*.csv
#   fig9  keypoints against the ratio of the two blurs          fig9_*.csv
#   fig10 aliasing                                              fig10_*.csv
#   fig11 a wrongly assumed camera blur                         fig11_*.csv
#   fig12 noise                                                 fig12_*.csv, fig12_pixels.parquet
#   figS1 stability and precision when the camera rotates       figS1_*.csv
#   figS2 a wrong blur, by its sign                             figS2.csv
#   figS3 the blur of a real camera                             figS3*.csv
#   figS4 blobs, whose scale is known                           figS4.csv
#   floor why extrema come and go at any density                floor_*.csv
#   truth detections against the true extrema                   truth_*.csv
#   refinement what it keeps and loses of the true extrema      refinement_choices.csv
#   predictors whether one detection shows that it is unstable  predictors_*.csv
FIGURES = ["fig1", "fig2", "fig3", "fig4", "fig5", "fig6"]
FIGURES += ["fig7", "fig8", "fig9", "fig10", "fig11", "fig12"]
FIGURES += ["figS1", "figS2", "figS3", "figS4"]
FIGURES += ["floor", "truth", "refinement", "predictors"]


# Tables that no figure draws and no claim needs.
TABLES_NOT_DRAWN = ["fig5_features.csv", "predictors_detections.parquet", "refinement.csv"]

# All that the study ends in. What figures draw is named too: Snakemake would not miss a lost table
# whose figure is there.
FINAL = sorted(
    {
        *expand(f"{DRAWN}/{{figure}}.{{kind}}", figure=FIGURES, kind=["pdf", "png"]),
        *(table for figure in FIGURES for table in getattr(rules, figure).input),
        *expand(f"{RESULTS}/tables/{{table}}", table=TABLES_NOT_DRAWN),
        *rules.claims.input.tables,
        *rules.claims.output,
    }
)


include: "workflow/rules/checksums.smk"  # all of these -> one list of digests


rule all:
    """Every figure, every table, and the verdicts."""
    default_target: True
    input:
        FINAL,
        f"{RESULTS}/final.sha256",
        expand(f"{RESULTS}/scale_space/n{{n_spo}}.sha256", n_spo=KEPT),
