"""The figures.

Comes in: tidy tables, and nothing else. Goes out: {figures}/figN.pdf and .png. Every figure is a
rule of its own, so that restyling one redraws one.
"""

DRAFT = fixed("draft", "--draft" if config["draft"] else "")


rule fig1:
    """Figure 1: the semigroup property of discrete Gaussian blurs."""
    input:
        f"{RESULTS}/tables/fig1.csv",
    output:
        pdf=f"{DRAWN}/fig1.pdf",
        png=report(f"{DRAWN}/fig1.png", caption="../report/fig1.rst", category="Figures"),
    log:
        f"{LOGS}/fig1.log",
    benchmark:
        f"{LOGS}/benchmarks/fig1.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig1",
        code=fingerprint("keystab.figures.fig1"),
        software=SOFTWARE,
    message:
        "Drawing {output.pdf}"
    shell:
        """
        python -m {params.module} \
            --tables {params.tables:q} \
            --pdf {output.pdf:q} \
            --png {output.png:q} \
            {params.draft} \
            --code {params.code} \
            --lock {params.software} \
            >{log:q} 2>&1
        """


use rule fig1 as fig2 with:
    input:
        f"{RESULTS}/tables/fig2.csv",
        f"{RESULTS}/tables/fig2_pixels.parquet",
    output:
        pdf=f"{DRAWN}/fig2.pdf",
        png=report(f"{DRAWN}/fig2.png", caption="../report/fig2.rst", category="Figures"),
    log:
        f"{LOGS}/fig2.log",
    benchmark:
        f"{LOGS}/benchmarks/fig2.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig2",
        code=fingerprint("keystab.figures.fig2"),
        software=SOFTWARE,


use rule fig1 as fig3 with:
    input:
        f"{RESULTS}/tables/fig3.csv",
    output:
        pdf=f"{DRAWN}/fig3.pdf",
        png=report(f"{DRAWN}/fig3.png", caption="../report/fig3.rst", category="Figures"),
    log:
        f"{LOGS}/fig3.log",
    benchmark:
        f"{LOGS}/benchmarks/fig3.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig3",
        code=fingerprint("keystab.figures.fig3"),
        software=SOFTWARE,


use rule fig1 as fig4 with:
    input:
        f"{RESULTS}/tables/fig4_counts.csv",
        f"{RESULTS}/tables/fig4_keypoints.csv",
        f"{RESULTS}/tables/fig4_occurrence.csv",
        f"{RESULTS}/tables/fig4_summary.csv",
    output:
        pdf=f"{DRAWN}/fig4.pdf",
        png=report(f"{DRAWN}/fig4.png", caption="../report/fig4.rst", category="Figures"),
    log:
        f"{LOGS}/fig4.log",
    benchmark:
        f"{LOGS}/benchmarks/fig4.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig4",
        code=fingerprint("keystab.figures.fig4"),
        software=SOFTWARE,


use rule fig1 as fig5 with:
    input:
        f"{RESULTS}/tables/fig5_thresholds.csv",
        f"{RESULTS}/tables/fig5_roc.csv",
        f"{RESULTS}/tables/fig5_auc.csv",
    output:
        pdf=f"{DRAWN}/fig5.pdf",
        png=report(f"{DRAWN}/fig5.png", caption="../report/fig5.rst", category="Figures"),
    log:
        f"{LOGS}/fig5.log",
    benchmark:
        f"{LOGS}/benchmarks/fig5.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig5",
        code=fingerprint("keystab.figures.fig5"),
        software=SOFTWARE,


use rule fig1 as fig6 with:
    input:
        f"{RESULTS}/tables/fig6.csv",
        f"{RESULTS}/tables/fig6_cubes.parquet",
    output:
        pdf=f"{DRAWN}/fig6.pdf",
        png=report(f"{DRAWN}/fig6.png", caption="../report/fig6.rst", category="Figures"),
    log:
        f"{LOGS}/fig6.log",
    benchmark:
        f"{LOGS}/benchmarks/fig6.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig6",
        code=fingerprint("keystab.figures.fig6"),
        software=SOFTWARE,


use rule fig1 as fig7 with:
    input:
        f"{RESULTS}/tables/fig7_curves.csv",
        f"{RESULTS}/tables/fig7_precision.csv",
        f"{RESULTS}/tables/fig7_counts.csv",
        f"{RESULTS}/tables/fig7_shipped.csv",
    output:
        pdf=f"{DRAWN}/fig7.pdf",
        png=report(f"{DRAWN}/fig7.png", caption="../report/fig7.rst", category="Figures"),
    log:
        f"{LOGS}/fig7.log",
    benchmark:
        f"{LOGS}/benchmarks/fig7.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig7",
        code=fingerprint("keystab.figures.fig7"),
        software=SOFTWARE,


use rule fig1 as fig8 with:
    input:
        f"{RESULTS}/tables/fig8_curves.csv",
        f"{RESULTS}/tables/fig8_precision.csv",
    output:
        pdf=f"{DRAWN}/fig8.pdf",
        png=report(f"{DRAWN}/fig8.png", caption="../report/fig8.rst", category="Figures"),
    log:
        f"{LOGS}/fig8.log",
    benchmark:
        f"{LOGS}/benchmarks/fig8.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig8",
        code=fingerprint("keystab.figures.fig8"),
        software=SOFTWARE,


use rule fig1 as fig9 with:
    input:
        f"{RESULTS}/tables/fig9_counts.csv",
        f"{RESULTS}/tables/fig9_keypoints.csv",
        f"{RESULTS}/tables/fig9_occurrence.csv",
    output:
        pdf=f"{DRAWN}/fig9.pdf",
        png=report(f"{DRAWN}/fig9.png", caption="../report/fig9.rst", category="Figures"),
    log:
        f"{LOGS}/fig9.log",
    benchmark:
        f"{LOGS}/benchmarks/fig9.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig9",
        code=fingerprint("keystab.figures.fig9"),
        software=SOFTWARE,


use rule fig1 as fig10 with:
    input:
        f"{RESULTS}/tables/fig10_counts.csv",
        f"{RESULTS}/tables/fig10_curves.csv",
    output:
        pdf=f"{DRAWN}/fig10.pdf",
        png=report(f"{DRAWN}/fig10.png", caption="../report/fig10.rst", category="Figures"),
    log:
        f"{LOGS}/fig10.log",
    benchmark:
        f"{LOGS}/benchmarks/fig10.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig10",
        code=fingerprint("keystab.figures.fig10"),
        software=SOFTWARE,


use rule fig1 as fig11 with:
    input:
        f"{RESULTS}/tables/fig11_curves.csv",
        f"{RESULTS}/tables/fig11_scales.csv",
    output:
        pdf=f"{DRAWN}/fig11.pdf",
        png=report(f"{DRAWN}/fig11.png", caption="../report/fig11.rst", category="Figures"),
    log:
        f"{LOGS}/fig11.log",
    benchmark:
        f"{LOGS}/benchmarks/fig11.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig11",
        code=fingerprint("keystab.figures.fig11"),
        software=SOFTWARE,


use rule fig1 as fig12 with:
    input:
        f"{RESULTS}/tables/fig12_curves.csv",
        f"{RESULTS}/tables/fig12_pixels.parquet",
        f"{RESULTS}/tables/fig12_scales.csv",
        f"{RESULTS}/tables/fig12_theory.csv",
    output:
        pdf=f"{DRAWN}/fig12.pdf",
        png=report(f"{DRAWN}/fig12.png", caption="../report/fig12.rst", category="Figures"),
    log:
        f"{LOGS}/fig12.log",
    benchmark:
        f"{LOGS}/benchmarks/fig12.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.fig12",
        code=fingerprint("keystab.figures.fig12"),
        software=SOFTWARE,


use rule fig1 as figS1 with:
    input:
        f"{RESULTS}/tables/figS1_curves.csv",
        f"{RESULTS}/tables/figS1_precision.csv",
    output:
        pdf=f"{DRAWN}/figS1.pdf",
        png=report(f"{DRAWN}/figS1.png", caption="../report/figS1.rst", category="Figures"),
    log:
        f"{LOGS}/figS1.log",
    benchmark:
        f"{LOGS}/benchmarks/figS1.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.figs1",
        code=fingerprint("keystab.figures.figs1"),
        software=SOFTWARE,


use rule fig1 as figS2 with:
    input:
        f"{RESULTS}/tables/figS2.csv",
    output:
        pdf=f"{DRAWN}/figS2.pdf",
        png=report(f"{DRAWN}/figS2.png", caption="../report/figS2.rst", category="Figures"),
    log:
        f"{LOGS}/figS2.log",
    benchmark:
        f"{LOGS}/benchmarks/figS2.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.figs2",
        code=fingerprint("keystab.figures.figs2"),
        software=SOFTWARE,


use rule fig1 as figS3 with:
    input:
        f"{RESULTS}/tables/figS3.csv",
        f"{RESULTS}/tables/figS3_profiles.csv",
    output:
        pdf=f"{DRAWN}/figS3.pdf",
        png=report(f"{DRAWN}/figS3.png", caption="../report/figS3.rst", category="Figures"),
    log:
        f"{LOGS}/figS3.log",
    benchmark:
        f"{LOGS}/benchmarks/figS3.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.figs3",
        code=fingerprint("keystab.figures.figs3"),
        software=SOFTWARE,


use rule fig1 as figS4 with:
    input:
        f"{RESULTS}/tables/figS4.csv",
    output:
        pdf=f"{DRAWN}/figS4.pdf",
        png=report(f"{DRAWN}/figS4.png", caption="../report/figS4.rst", category="Figures"),
    log:
        f"{LOGS}/figS4.log",
    benchmark:
        f"{LOGS}/benchmarks/figS4.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.figs4",
        code=fingerprint("keystab.figures.figs4"),
        software=SOFTWARE,


use rule fig1 as floor with:
    input:
        f"{RESULTS}/tables/floor_rates.csv",
        f"{RESULTS}/tables/floor_summary.csv",
    output:
        pdf=f"{DRAWN}/floor.pdf",
        png=report(f"{DRAWN}/floor.png", caption="../report/floor.rst", category="Figures"),
    log:
        f"{LOGS}/floor.log",
    benchmark:
        f"{LOGS}/benchmarks/floor.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.floor",
        code=fingerprint("keystab.figures.floor"),
        software=SOFTWARE,


use rule fig1 as truth with:
    input:
        f"{RESULTS}/tables/truth_samplings.csv",
        f"{RESULTS}/tables/truth_cosine.csv",
        f"{RESULTS}/tables/truth_grid.csv",
        f"{RESULTS}/tables/truth_kappas.csv",
        f"{RESULTS}/tables/truth_views.csv",
        f"{RESULTS}/tables/truth_causes.csv",
        f"{RESULTS}/tables/truth_auc.csv",
    output:
        pdf=f"{DRAWN}/truth.pdf",
        png=report(f"{DRAWN}/truth.png", caption="../report/truth.rst", category="Figures"),
    log:
        f"{LOGS}/truth.log",
    benchmark:
        f"{LOGS}/benchmarks/truth.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.truth",
        code=fingerprint("keystab.figures.truth"),
        software=SOFTWARE,


use rule fig1 as refinement with:
    input:
        f"{RESULTS}/tables/refinement_choices.csv",
    output:
        pdf=f"{DRAWN}/refinement.pdf",
        png=report(
            f"{DRAWN}/refinement.png", caption="../report/refinement.rst", category="Figures"
        ),
    log:
        f"{LOGS}/refinement.log",
    benchmark:
        f"{LOGS}/benchmarks/refinement.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.refinement",
        code=fingerprint("keystab.figures.refinement"),
        software=SOFTWARE,


use rule fig1 as predictors with:
    input:
        f"{RESULTS}/tables/predictors_auc.csv",
        f"{RESULTS}/tables/predictors_gain.csv",
        f"{RESULTS}/tables/predictors_roc.csv",
    output:
        pdf=f"{DRAWN}/predictors.pdf",
        png=report(
            f"{DRAWN}/predictors.png", caption="../report/predictors.rst", category="Figures"
        ),
    log:
        f"{LOGS}/predictors.log",
    benchmark:
        f"{LOGS}/benchmarks/predictors.tsv"
    params:
        tables=folder_of_inputs,
        draft=DRAFT,
        module="keystab.figures.predictors",
        code=fingerprint("keystab.figures.predictors"),
        software=SOFTWARE,
