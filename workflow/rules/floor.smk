"""Why some extrema come and go at any density of the sampling (figure floor).

Comes in: views. Goes out: {results}/tables/floor_*.csv. Steps: compute the extrema of all balanced
samplings in variants of precision, tolerance, interpolation and view; count the new and the lost.
"""


rule detect_variant:
    """Detect the extrema of all balanced samplings in one variant."""
    input:
        views=view_of_variant,
        digest=digest_of_variant,
    output:
        extrema=f"{RESULTS}/keypoints/floor/{{variant}}.parquet",
    log:
        f"{LOGS}/detect_variant/{{variant}}.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_variant/{{variant}}.tsv"
    wildcard_constraints:
        variant=one_of(sorted({run_of_variant(name) for name in VARIANTS})),
    resources:
        runtime=minutes_of_variant,
    params:
        n_spo=setting("samplings.n_spo"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        oversampling=setting("floor.variants.{variant}.oversampling"),
        epsilon=of_single_precision("epsilon"),
        grey_range=of_single_precision("grey_range"),
        arithmetic=setting("floor.variants.{variant}.arithmetic"),
        bits=setting("floor.variants.{variant}.bits"),
        code=fingerprint("keystab.stages.detect_variant"),
        software=SOFTWARE,
    message:
        "Detecting extrema in the variant '{wildcards.variant}'"
    shell:
        """
        python -m keystab.stages.detect_variant \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --n-spo {params.n_spo} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --oversampling {params.oversampling} \
            --epsilon {params.epsilon} \
            --grey-range {params.grey_range} \
            --arithmetic {params.arithmetic} \
            --bits {params.bits} \
            --extrema {output.extrema:q} \
            >{log:q} 2>&1
        """


rule match_variants:
    """Figure floor: rates of new and lost extrema in every variant."""
    input:
        views=ancient(files_of_variants(f"{RESULTS}/views/{{set}}")),
        digest=files_of_variants(f"{RESULTS}/views/{{set}}.sha256"),
        extrema=[f"{RESULTS}/keypoints/floor/{run_of_variant(name)}.parquet" for name in VARIANTS],
    output:
        rates=f"{RESULTS}/tables/floor_rates.csv",
        summary=f"{RESULTS}/tables/floor_summary.csv",
    log:
        f"{LOGS}/match_variants.log",
    benchmark:
        f"{LOGS}/benchmarks/match_variants.tsv"
    params:
        names=fixed("floor.variants", VARIANTS),
        # Which extrema belong to which variant: Snakemake compares inputs without their order.
        runs=fixed("runs", [run_of_variant(name) for name in VARIANTS]),
        tolerances=fixed("tolerances", [tolerance_of_variant(name) for name in VARIANTS]),
        n_spo=setting("samplings.n_spo"),
        settles_at=setting("floor.settles_at"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        space_tolerance=setting("comparison.space_tolerance"),
        scale_ratio=setting("comparison.scale_ratio"),
        match_sign=setting("comparison.match_sign"),
        border=setting("comparison.border"),
        first_scale=setting("comparison.first_scale"),
        last_scale=setting("comparison.last_scale"),
        code=fingerprint("keystab.stages.match_variants"),
        software=SOFTWARE,
    message:
        "Counting new and lost extrema in all variants"
    shell:
        """
        python -m keystab.stages.match_variants \
            --views {input.views:q} \
            --views-digest {input.digest:q} \
            --extrema {input.extrema:q} \
            --names {params.names} \
            --tolerances {params.tolerances} \
            --n-spo {params.n_spo} \
            --settles-at {params.settles_at} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --space-tolerance {params.space_tolerance} \
            --scale-ratio {params.scale_ratio} \
            --match-sign {params.match_sign} \
            --border {params.border} \
            --first-scale {params.first_scale} \
            --last-scale {params.last_scale} \
            --rates {output.rates:q} \
            --summary {output.summary:q} \
            >{log:q} 2>&1
        """
