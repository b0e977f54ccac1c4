"""The figures.

Comes in: tidy tables, and nothing else. Goes out: {figures}/figN.pdf and .png. Every figure is a
rule of its own, so that restyling one redraws one.
"""

DRAFT = "--draft" if config["draft"] else ""


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
        module="keystab.figures.figS3",
        code=fingerprint("keystab.figures.figS3"),
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
        module="keystab.figures.figS4",
        code=fingerprint("keystab.figures.figS4"),
        software=SOFTWARE,
