"""What rules ask of sets of views: which one a figure studies, its files, its parameters.

Comes in: complete settings. Goes out: functions that name inputs and parameters; no rules.
"""

# Figure -> the set of views, or the sweep, that it studies.
VIEWS_OF = {"fig7": "translations", "fig8": "zooms", "figS1": "rotations"}
SWEEP_OF = {"fig10": "aliasing", "fig11": "unknown_blur", "fig12": "noise"}
SWEPT = {"fig10": "blur", "fig11": "blur_spread", "fig12": "noise"}
VARIANTS = list(config["floor"]["variants"])


def of_every_view(key):
    """Parameter with the values of one property of all views of a set."""

    def values_of(wildcards):
        values = view_sets.per_view(config["sets"][wildcards.set])[key]
        return Named(f"{wildcards.set}.{key}", values)

    return values_of


def sigma_min_of_set(wildcards):
    """First scale of the scale-spaces of a set."""
    own = config["sets"][wildcards.set]["sigma_min"]
    sigma_min = config["detector"]["sigma_min"] if own is None else own
    return Named(f"{wildcards.set}.sigma_min", sigma_min)


def assumed_blur_of_set(wildcards):
    """Blur that the detector assumes for a set; None for that of each view."""
    return Named(
        f"{wildcards.set}.assumed_blur", view_sets.assumed_blur(config["sets"][wildcards.set])
    )


def detections_of(set_name, what):
    """Tables of a set, one per sampling at which it is searched."""
    return expand(
        f"{RESULTS}/keypoints/{set_name}/{what}_n{{n_spo}}.parquet",
        n_spo=config["sets"][set_name]["n_spo"],
    )


def kappas(_wildcards):
    """Ratios of the difference of Gaussians that figure 9 compares, smallest first."""
    fractions = sorted(config["kappas"]["fractions"], reverse=True)
    return Named("kappas.fractions", [2 ** (1 / fraction) for fraction in fractions])


def dtype_of_set(wildcards):
    """Number type in which the views of a set are stored."""
    own = config["sets"][wildcards.set]["dtype"]
    return Named("dtype", config["views_dtype"] if own is None else own)


def views_of_figure(wildcards):
    """Store of the set of views that a figure studies."""
    return ancient(f"{RESULTS}/views/{VIEWS_OF[wildcards.figure]}")


def digest_of_figure(wildcards):
    """Seal of the set of views that a figure studies."""
    return f"{RESULTS}/views/{VIEWS_OF[wildcards.figure]}.sha256"


def extrema_of_figure(wildcards):
    """Extrema of the set of views that a figure studies, at all its samplings."""
    return detections_of(VIEWS_OF[wildcards.figure], "extrema")


def traces_of_figure(wildcards):
    """Refinement traces of the set of views that a figure studies, at all its samplings."""
    return detections_of(VIEWS_OF[wildcards.figure], "traces")


def of_views(key):
    """Parameter with a setting of the set of views that a figure studies."""

    def value_of(wildcards):
        name = VIEWS_OF[wildcards.figure]
        return Named(f"{name}.{key}", config["sets"][name][key])

    return value_of


def sigma_min_of_views(wildcards):
    """First scale of the set of views that a figure studies."""
    name = VIEWS_OF.get(wildcards.figure) or SWEEPS[SWEEP_OF[wildcards.figure]][0].name
    own = config["sets"][name]["sigma_min"]
    return Named("sigma_min", config["detector"]["sigma_min"] if own is None else own)


def further_max_offsets(wildcards):
    """Values of M_offset whose curves figure 7 draws; none for the other figures."""
    drawn = wildcards.figure == "fig7"
    return Named("max_offsets", config["stability"]["max_offsets"] if drawn else [])


def further_iterations(wildcards):
    """Values of N_interp whose curves figure 7 draws; none for the other figures."""
    drawn = wildcards.figure == "fig7"
    return Named("max_iterations", config["stability"]["max_iterations"] if drawn else [])


def of_sweep(path):
    """Files of all sets of the sweep that a figure studies; `path` has the name of the set."""

    def files_of(wildcards):
        return [path.format(set=one.name) for one in SWEEPS[SWEEP_OF[wildcards.figure]]]

    return files_of


def views_of_sweep(wildcards):
    """Stores of all sets of the sweep that a figure studies."""
    return ancient(of_sweep(f"{RESULTS}/views/{{set}}")(wildcards))


def detections_of_sweep(what):
    """Tables of all sets of the sweep that a figure studies, at their one sampling."""

    def tables_of(wildcards):
        names = [one.name for one in SWEEPS[SWEEP_OF[wildcards.figure]]]
        return [table for name in names for table in detections_of(name, what)]

    return tables_of


def name_of_sweep(wildcards):
    """What the sets of the sweep that a figure studies differ in."""
    return SWEPT[wildcards.figure]


def values_of_sweep(wildcards):
    """Values of the sets of the sweep that a figure studies."""
    name = SWEEP_OF[wildcards.figure]
    return Named(f"{name}.sweep", [one.value for one in SWEEPS[name]])


def in_sweep(key):
    """Parameter with a setting that all sets of the sweep that a figure studies share."""

    def value_of(wildcards):
        first = SWEEPS[SWEEP_OF[wildcards.figure]][0].name
        return Named(f"{first}.{key}", config["sets"][first][key])

    return value_of


def octaves_of_sweep(wildcards):
    """Options of the counts against scale, in octaves within those searched; none for figure 10."""
    if wildcards.figure == "fig10":
        return Named("octaves", "")
    n_oct = in_sweep("n_oct")(wildcards)
    end = float(sigma_min_of_views(wildcards)) * 2 ** int(n_oct)
    starts = [one for one in config["stability"]["starts"] if 2 * one <= end * (1 + 1e-9)]
    seen_by = config["stability"]["seen_by"]
    return Named("octaves", ["--starts", *starts, "--seen-by", seen_by])


def table_of_scales(_wildcards, output):
    """Option that names the table of counts against scale, where there is one."""
    return f"--scales {shlex.quote(output.scales)}" if "scales" in output.keys() else ""


def blur_of_noisy_views(_wildcards):
    """Camera blur of the views of figure 12, which all share it."""
    blurs = view_sets.per_view(config["sets"][SWEEPS["noise"][0].name])["blur"]
    return Named("noise.blur", max(blurs))


def view_of_variant(wildcards):
    """Store of the view that a variant searches."""
    name = config["floor"]["variants"][wildcards.variant]["set"]
    return ancient(f"{RESULTS}/views/{name}")


def digest_of_variant(wildcards):
    """Seal of the view that a variant searches."""
    name = config["floor"]["variants"][wildcards.variant]["set"]
    return f"{RESULTS}/views/{name}.sha256"


def run_of_variant(name):
    """First of the variants whose extrema are the same but for the tolerance, which comes later.

    Single precision rounds in units of its own grey range, so that its variants stand alone.
    """
    variants = config["floor"]["variants"]
    if variants[name]["arithmetic"] == "float32":
        return name
    kept = ("set", "oversampling", "arithmetic", "bits")
    return next(
        other
        for other, variant in variants.items()
        if all(variant[key] == variants[name][key] for key in kept)
    )


def of_single_precision(key):
    """Parameter with a setting that only single precision uses; elsewhere one without effect."""

    def value_of(wildcards):
        variant = config["floor"]["variants"][wildcards.variant]
        usual = {"epsilon": 0.0, "grey_range": 1.0}[key]
        value = variant[key] if variant["arithmetic"] == "float32" else usual
        return Named(f"floor.variants.{wildcards.variant}.{key}", value)

    return value_of


def tolerance_of_variant(name):
    """Least difference of a variant's extrema, of grey values in [0, 1]; -1 where it was applied."""
    variant = config["floor"]["variants"][name]
    applied = variant["arithmetic"] == "float32"
    return -1.0 if applied else variant["epsilon"] / variant["grey_range"]


def end_of_truth(_wildcards):
    """Scale up to which true extrema are sought."""
    truth = config["truth"]
    end = config["detector"]["sigma_min"] * truth["last_scale"] * truth["beyond"]
    return Named("truth.end", end)


def sweep_of_set(name):
    """Sweep that a set is a member of, or its own name."""
    return next(
        (sweep for sweep, sets in SWEEPS.items() if name in {one.name for one in sets}), name
    )


def value_of_set(name):
    """Value of a member of a sweep; nan for a set of its own."""
    values = {one.name: one.value for sets in SWEEPS.values() for one in sets}
    return values.get(name, "nan")


def judged_sets():
    """Sets of views of the step of the view 'still', each with the samplings that are judged."""
    step = config["sets"]["still"]["step"]
    judged = ["translations", "rotations"]
    judged += [one.name for sweep in SWEEP_OF.values() for one in SWEEPS[sweep]]
    return [
        (name, n_spo)
        for name in judged
        if config["sets"][name]["step"] == step
        for n_spo in config["sets"][name]["n_spo"]
    ]


JUDGED = judged_sets()

# What figures truth and refinement single out of the ratios and samplings that are searched.
TRUE_FRACTIONS = [
    fraction
    for fraction in config["truth"]["fractions"]
    if fraction in config["kappas"]["fractions"]
] or config["kappas"]["fractions"][:1]
REFINED_N_SPO = [
    n_spo for n_spo in config["truth"]["refined_n_spo"] if n_spo in config["samplings"]["n_spo"]
] or sorted({config["samplings"]["n_spo"][0], config["samplings"]["n_spo"][-1]})


def files_of_variants(path):
    """Files of the views that the variants search, one per variant."""
    sets = [variant["set"] for variant in config["floor"]["variants"].values()]
    return [path.format(set=name) for name in sets]


def truth_of_kappa(fraction):
    """File of the true extrema of the view for kappa = 2^(1/fraction)."""
    if math.isclose(2 ** (1 / fraction), config["detector"]["kappa"]):
        return f"{RESULTS}/truth/view.parquet"
    return f"{RESULTS}/truth/view_{fraction:g}.parquet"


def kappas_with_truth(_wildcards):
    """Ratios of the two blurs that have a truth of their own."""
    return Named("truth.kappas", [2 ** (1 / one) for one in TRUE_FRACTIONS])


def guards_of_judged_sets(_wildcards):
    """Guard band of every set that is held against the scene."""
    return Named("guards", [config["sets"][name]["guard"] for name, _ in JUDGED])


def kappa_of_file(wildcards):
    """Ratio of the two blurs that a file of true extrema belongs to."""
    return Named("kappa", 2 ** (1 / float(wildcards.fraction)))


# Figure predictors: further pictures, and the samplings whose detections it scores.
PICTURES = picture_checks.further_pictures(config)
PREDICTED_N_SPO = [
    n_spo for n_spo in config["predictors"]["n_spo"] if n_spo in config["samplings"]["n_spo"]
] or sorted({config["samplings"]["n_spo"][0], config["samplings"]["n_spo"][-1]})


def path_of_picture(wildcards):
    """File of a further picture."""
    return local(config["predictors"]["pictures"][wildcards.set]["path"])


def name_of_reference():
    """What figure predictors calls the reference: its name among the pictures, or its file's."""
    others = config["predictors"]["pictures"]
    known = [name for name in others if name not in PICTURES]
    own = Path(config["reference"]).stem
    return known[0] if known else own if own not in others else "reference"


def files_of_pictures():
    """What figure predictors needs of the reference and of each further picture, by kind."""
    folders = [f"{RESULTS}/pictures/{name}" for name in PICTURES]
    return {
        "views": [ancient(f) for f in [f"{RESULTS}/views/still", *(f"{f}/view" for f in folders)]],
        "digests": [f"{RESULTS}/views/still.sha256", *(f"{f}/view.sha256" for f in folders)],
        "keypoints": [
            f"{RESULTS}/tables/fig4_keypoints.csv",
            *(f"{f}/keypoints.csv" for f in folders),
        ],
        "truth": [f"{RESULTS}/truth/view.parquet", *(f"{f}/truth.parquet" for f in folders)],
        "samplings": [f"{RESULTS}/keypoints/sampling_n{n}.parquet" for n in PREDICTED_N_SPO],
        "extrema": [f"{f}/samplings.parquet" for f in folders],
    }


def options_of_pictures(_wildcards, input):
    """Options of the stage that scores predictors: the name and the files of every picture."""
    kinds = ("views", "digests", "keypoints", "truth")
    options = []
    for k, name in enumerate([name_of_reference(), *PICTURES]):
        own = input.samplings if k == 0 else [input.extrema[k - 1]]
        files = [input[kind][k] for kind in kinds]
        options.append(shlex.join(["--picture", name, *map(str, [*files, *own])]))
    return " ".join(options)
