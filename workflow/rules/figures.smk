"""The figures.

Comes in: tidy tables, and nothing else. Goes out: figN.pdf and .png. Every figure is a rule of its
own, so that restyling one redraws one.
"""

for FIGURE, ABOUT in plan.FIGURES.items():
    # What shows no single scene is drawn once.
    PLACE = "{place}" if ABOUT.of_scene else ""

    rule:
        name:
            FIGURE
        input:
            placed(plan.table_files, RESULTS, ABOUT.tables),
        output:
            pdf=f"{config['figures']}/{PLACE}{FIGURE}.pdf",
            png=report(
                f"{config['figures']}/{PLACE}{FIGURE}.png",
                caption=f"../report/{FIGURE}.rst",
                category="Figures",
            ),
        log:
            f"{config['logs']}/{PLACE}{FIGURE}.log",
        benchmark:
            f"{config['logs']}/benchmarks/{PLACE}{FIGURE}.tsv"
        params:
            **RULES.figure(FIGURE, config["draft"]),
        message:
            "Drawing {output.pdf}"
        shell:
            "{params.command} >{log:q} 2>&1"
