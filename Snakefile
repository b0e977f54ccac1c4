"""keystab: can a keypoint be trusted? The study's table of contents.

Comes in: a picture and the settings of config/config.yaml.
Goes out: figures/figN.pdf and .png, with the numbers that they draw in results/tables/figN*.csv.

    snakemake -j2                                      the whole study
    snakemake figures/fig5.pdf -j2                     one figure
    snakemake --configfile config/quick.yaml -j2       every figure in draft form
    snakemake --configfile config/what_if/X.yaml -j2   another answer to one question
"""


configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/simulate.smk"  # the reference picture -> sets of views
include: "workflow/rules/scale_space.smk"  # a view -> a stored scale-space, where one is kept
include: "workflow/rules/detect.smk"  # a view or its scale-space -> extrema, with refinement traces
include: "workflow/rules/truth.smk"  # a view -> what a detector should find, where it is asked for
include: "workflow/rules/match.smk"  # extrema of many samplings -> tables
include: "workflow/rules/figures.smk"  # tables -> figures


# Figure -> what it shows -> tables that it draws; the rules are in workflow/rules/figures.smk.
#
#   fig1  discrete Gaussian blurs and the semigroup property    fig1.csv
#   fig2  simulated views                                       fig2.csv, fig2_pixels.parquet
#   fig3  number of extrema against the sampling                fig3.csv
#   fig4  extrema that come and go as the sampling gets finer   fig4_*.csv
#   fig5  features against stability                            fig5_*.csv
#   fig6  iso-surfaces around stable and unstable keypoints     fig6.csv, fig6_cubes.parquet
FIGURES = ["fig1", "fig2", "fig3", "fig4", "fig5", "fig6"]


rule all:
    """Every figure, and the tables that no figure draws."""
    default_target: True
    input:
        expand(f"{DRAWN}/{{figure}}.{{kind}}", figure=FIGURES, kind=["pdf", "png"]),
        f"{RESULTS}/tables/refinement.csv",
        expand(f"{RESULTS}/scale_space/n{{n_spo}}.sha256", n_spo=KEPT),
