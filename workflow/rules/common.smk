"""What all rules share: checked settings, folders, and what their results depend on.

Comes in: config, as merged by Snakemake from config/config.yaml and the overlays on the command
line. Goes out: the same, complete and checked, and names for the parts that several rules use.
Steps: refuse settings that cannot work, with one line per problem; name the folders; fingerprint
the code and the software.
"""

import hashlib
import math
import os
import platform
import shlex
import sys
from functools import reduce
from operator import getitem
from pathlib import Path

import yaml

from keystab.camera import view_sets
from keystab.errors import InputError
from keystab.provenance import code_digest
from keystab.study import claims_by_scene, feasibility, picture_checks, settings

try:
    config.update(
        settings.checked(
            config,
            # The compiled loader is ten times as fast.
            yaml.load(
                Path(workflow.basedir, "workflow/schemas/config.schema.yaml").read_text(),
                Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader),
            ),
        )
    )
    feasibility.require(config)
    # Sweep -> its sets and their values. From here on every set is one of its own.
    SWEEPS = {
        name: view_sets.members(config["sets"], name)
        for name, views in config["sets"].items()
        if views["sweep"]
    }
    config["sets"] = view_sets.expanded(config["sets"])
except InputError as problems:
    sys.exit(str(problems))


RESULTS = config["results"]
DRAWN = config["figures"]
LOGS = config["logs"]

# Samplings whose scale-space is written to a store; all others are streamed.
KEPT = picture_checks.kept_n_spo(config)
STREAMED = sorted(set(config["samplings"]["n_spo"]) - set(KEPT))

# The same for sets of views: all or none.
SEARCHED_SETS = [name for name, views in config["sets"].items() if views["n_spo"]]
KEPT_SETS = SEARCHED_SETS if config["keep_scale_spaces"] is True else []
STREAMED_SETS = [name for name in SEARCHED_SETS if name not in KEPT_SETS]

# Compiled loops are kept with the other things that can be made again, and shared by all jobs.
os.environ.setdefault("NUMBA_CACHE_DIR", str(code_digest.folder_of_loops(Path.cwd())))

# Jobs use the Python that runs Snakemake, also where its environment was not activated.
os.environ.update(PATH=os.pathsep.join([str(Path(sys.executable).parent), *os.get_exec_path()]))


def spelled(value):
    """A value as the commands of stages take it; 3 and 3.0 are the same number."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


class Named(str):
    """A parameter that shows its name to Snakemake.

    Snakemake decides whether parameters changed by comparing the set of their representations,
    without names: of two zeros, one could become any number that another parameter already has,
    and nothing would be rerun.
    """

    def __new__(cls, name, value):
        values = value if isinstance(value, list) else [value]
        named = super().__new__(cls, " ".join(map(spelled, values)))
        named.name = name
        return named

    def __repr__(self):
        return f"{self.name} = {self}"


def setting(place):
    """Parameter with the value of a setting; wildcards in its place are filled in."""

    def value_of(wildcards):
        keys = [key.format(**dict(wildcards.items())) for key in place.split(".")]
        return Named(".".join(keys), reduce(getitem, keys, config))

    return value_of


def fixed(name, value):
    """Parameter that is the same for all jobs; given as it is, Snakemake would drop its name."""

    def value_of(_wildcards):
        return Named(name, value)

    return value_of


def fingerprint(module):
    """Parameter that changes with the code of a module and of all that it imports."""
    return fixed(f"code of {module}", code_digest.fingerprint(module))


# Snakemake does not see a change of installed packages; a parameter that changes with the lock
# file tells it.
SOFTWARE = fixed(
    "environment.lock",
    hashlib.sha256(Path(workflow.basedir, "environment.lock").read_bytes()).hexdigest(),
)


onstart:
    # Tells a killed run's lock from that of a run on another machine; see tools/interrupted.py.
    Path(".snakemake/host").write_text(platform.node())
    # Snakemake 9 limits the rate at which jobs start to 100 a second, and for that wakes up once a
    # second more for every job that has finished: after a hundred it takes a good part of a core.
    # Jobs here take seconds, so that nothing is lost without the limit.
    _limit = getattr(workflow.scheduler, "job_rate_limiter", None)
    if _limit is not None and (_limit.max_jobs, _limit.timespan) == (100, 1):
        workflow.scheduler.job_rate_limiter = None


wildcard_constraints:
    set="[a-z][a-z0-9_]*",
    n_spo="[0-9]+",


def one_of(numbers):
    """Regular expression for any of the numbers; matches nothing where there are none."""
    return "|".join(map(str, numbers)) or "(?!)"


def folder_of_inputs(_wildcards, input):
    """Folder that holds all inputs of a job."""
    return os.path.dirname(input[0])


def options_of_store(_wildcards, input):
    """Options of detection for the stored scale-space among a job's inputs; none where it streams."""
    if "store" not in input.keys():
        return ""
    return f"--store {shlex.quote(input.store)} --store-digest {shlex.quote(input.store_digest)}"


def max_offset_of_path(_wildcards):
    """M_offset where the path of a refinement depends on it, as it does for unit steps; else None."""
    refinement = config["refinement"]
    depends = refinement["move"] == "unit_step"
    return Named("refinement.max_offset", refinement["max_offset"] if depends else None)


def sources_of_pictures():
    """Ledgers of all pictures that are compared; stop where one comes from a run not yet made.

    Each picture has settings of its own, and so a run of its own: no rule here can make the others.
    """
    try:
        found = claims_by_scene.sources("config/config.yaml", config["pictures"])
    except InputError as problem:
        sys.exit(str(problem))
    problems = claims_by_scene.missing(found, made=f"{RESULTS}/claims.csv")
    if problems:
        sys.exit("\n".join(problems))
    return found


def ledgers_of_pictures(_wildcards):
    """Ledgers of all pictures."""
    return [source.ledger for source in sources_of_pictures()]


def names_of_pictures(_wildcards):
    """Names of all pictures."""
    return Named("pictures", [source.name for source in sources_of_pictures()])
