"""The simulated camera (section 4 of the paper).

Comes in: the picture of a scene, or what it is made of. Goes out: one store per set of views,
views/{set}, with a file of checksums beside it, and tables of what figures 2 and 12 show of views.
Steps: check the picture's pixels; blur and sample the picture for every view of the set; write the
store; list its checksums; write pixels as numbers.
"""


rule make_scene:
    """Make a scene of the corpus that is no photograph."""
    output:
        picture=f"{RESULTS}/scenes/{{name}}/scene.png",
    log:
        f"{config['logs']}/scenes/{{name}}/make_scene.log",
    benchmark:
        f"{config['logs']}/benchmarks/scenes/{{name}}/make_scene.tsv"
    wildcard_constraints:
        name="|".join(name for name, scene in CORPUS.items() if not scene.path),
    params:
        **stage(
            "make_scene",
            kind=lambda wildcards: CORPUS[wildcards.name].kind,
            seed=lambda wildcards: CORPUS[wildcards.name].seed,
            exponent=lambda wildcards: CORPUS[wildcards.name].exponent,
            angle=lambda wildcards: CORPUS[wildcards.name].angle,
        ),
    message:
        "Making the scene '{wildcards.name}'"
    shell:
        "{params.command} >{log:q} 2>&1"


rule simulate:
    """Simulate one set of views of the scene."""
    input:
        reference=local(of(plan.setting, "reference")),
    output:
        views=directory(f"{HERE}views/{{set}}"),
        views_digest=f"{HERE}views/{{set}}.sha256",
    log:
        f"{LOG}simulate/{{set}}.log",
    benchmark:
        f"{BENCHMARK}simulate/{{set}}.tsv"
    resources:
        mem_mb=growing(job_resources.megabytes_of_reference),
    params:
        **stage(
            "simulate", parameters.Reference, parameters.Camera, "sets.{set}.dtype", name="{set}"
        ),
    message:
        "Simulating the views '{wildcards.set}'{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule describe_views:
    """Figure 2: what the simulated views look like, in numbers."""
    input:
        **views("examples"),
    output:
        table=f"{HERE}tables/fig2.csv",
        pixels=f"{HERE}tables/fig2_pixels.parquet",
    log:
        f"{LOG}describe_views.log",
    benchmark:
        f"{BENCHMARK}describe_views.tsv"
    params:
        **stage("describe_views"),
    message:
        "Describing the example views{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"


rule crop_views:
    """Figure 12 b: a piece of a view at every noise."""
    input:
        views=ancient(files("views/{}", plan.sets_of_figure, "fig12")),
        views_digest=files("views/{}.sha256", plan.sets_of_figure, "fig12"),
    output:
        table=f"{HERE}tables/fig12_pixels.parquet",
    log:
        f"{LOG}crop_views.log",
    benchmark:
        f"{BENCHMARK}crop_views.tsv"
    params:
        **stage(
            "crop_views",
            name="noise",
            values=column("value", plan.searches_of_figure, "fig12"),
            size=64,
        ),
    message:
        "Cropping views with noise {params.values}{params.scene}"
    shell:
        "{params.command} >{log:q} 2>&1"
