"""What jobs may take where time and memory are handed out, as on a cluster.

Comes in: complete settings. Goes out: functions for `resources:`; no rules. Minutes and megabytes
grow with the samples that a job visits, with room to spare over what REPRODUCING.md lists, and
double with every attempt. Rules without them are content with the defaults of a cluster's profile.
Nothing here changes a result or makes anything run again.

Every job has one thread: matrix products differ in their last digits between numbers of threads.
"""

from keystab.io.pictures import picture_shape

REFERENCE_SHAPE = picture_shape(config["reference"])
# Of a search, per pixel and scale per octave: three times what views with the most noise took.
SECONDS = 15e-6
# Of Python with its libraries, twice.
MEGABYTES = 600


def pixels(name):
    """Pixels of all views of a set, and of the widest one per row."""
    shapes = view_sets.view_shapes(config["sets"][name], REFERENCE_SHAPE)
    return sum(height * width for height, width in shapes), max(width for _, width in shapes)


def allowed(seconds, attempt):
    """Whole minutes for a job, with some for waking up a machine."""
    return (5 + math.ceil(seconds / 60)) * attempt


def minutes_of_view(wildcards, attempt):
    """Time to search or write one sampling of the view 'still'."""
    return allowed(SECONDS * pixels("still")[0] * int(wildcards.n_spo), attempt)


def minutes_of_grid(wildcards, attempt):
    """Time to search the view 'still' at all steps of figure 3's grid."""
    n_steps = len(config["grid"]["delta_min"])
    return allowed(n_steps * SECONDS * pixels("still")[0] * int(wildcards.n_spo), attempt)


def minutes_of_set(wildcards, attempt):
    """Time to search or write one sampling of all views of a set."""
    return allowed(SECONDS * pixels(wildcards.set)[0] * int(wildcards.n_spo), attempt)


def minutes_of_kappas(_wildcards, attempt):
    """Time to search the view 'still' for all ratios of the two blurs."""
    kappas = config["kappas"]
    n_samplings = len(kappas["fractions"]) * kappas["n_spo"]
    return allowed(10 * SECONDS * pixels("still")[0] * n_samplings, attempt)


def minutes_of_variant(_wildcards, attempt):
    """Time to search a view at all samplings in a variant of the arithmetic."""
    return allowed(10 * SECONDS * pixels("still")[0] * sum(config["samplings"]["n_spo"]), attempt)


def minutes_of_truth(_wildcards, attempt):
    """Time to find the true extrema of a view or of the scene."""
    return allowed(300 * SECONDS * pixels("still")[0], attempt)


def memory_of_reference(_wildcards, attempt):
    """Megabytes to work on the whole reference: some copies of it."""
    height, width = REFERENCE_SHAPE
    return (MEGABYTES + math.ceil(10 * 8 * height * width / 1e6)) * attempt


def memory_of_store(wildcards, attempt):
    """Megabytes to write or read a stored scale-space: rows of tiles, and their copies."""
    width = pixels(wildcards.get("set", "still"))[1]
    n_spo = int(wildcards.n_spo)
    across = width * n_spo  # at least the samples of a row at the balanced step
    return (MEGABYTES + math.ceil(3 * 8 * 128 * (n_spo + 2) * across / 1e6)) * attempt
