"""What all rules share: checked settings, folders, and what their results depend on.

Comes in: config, as merged by Snakemake from config/config.yaml and the overlays on the command
line. Goes out: the same, complete and checked, and names for the parts that several rules use.
Steps: refuse settings that cannot work, with one line per problem; name the folders; take the
functions that make parameters and files from the settings (keystab.study.rule_parameters).
"""

import hashlib
import os
import platform
import sys
from pathlib import Path

from keystab import parameters
from keystab.errors import InputError
from keystab.provenance import code_digest, imported_software
from keystab.study import (
    claims_by_scene,
    corpus,
    feasibility,
    floor_variants,
    job_resources,
    overlays,
    plan,
    scenes,
    settings,
)
from keystab.study.claims import read_claims, table_names
from keystab.study.plain_yaml import read_plain_yaml
from keystab.study.rule_parameters import Rules
from keystab.study.workflow_files import WorkflowFiles

# The folder that is worked in can be another one than that of these files.
FILES = WorkflowFiles(workflow.current_basedir, workflow.sourcecache.get_path)

try:
    # Snakemake has merged these; what it dropped or misread without a word is refused here.
    settings.read_yaml(*workflow.configfiles)
    given = settings.read_yaml(FILES.own("config/config.yaml"))
    settings.merge(given, config)  # has it already, but for a module's and with -d
    schema = read_plain_yaml(FILES.own("workflow/schemas/config.schema.yaml"))
    config.update(FILES.with_pictures(settings.checked(given, schema)))
    by_hand = overlays.of_a_person(workflow.basedir, workflow.overwrite_configfiles)
    feasibility.require(config, written=settings.read_yaml(*by_hand))
    CLAIMS = read_claims(FILES.own("config/claims.yaml"))
    CORPUS = FILES.with_photographs(corpus.read_corpus(FILES.own("config/scenes.csv")))
    CLAIMED = [f"{name}.csv" for name in table_names(CLAIMS)]
except InputError as problems:
    sys.exit(str(problems))

# A further scene is the same study of another picture: the wildcard {place} in the paths below is
# empty for the default scene, and scenes/NAME/ for one of predictors.pictures or of config/scenes.csv.
SCENES = scenes.by_place(config, corpus=CORPUS.values())
STUDY = SCENES[""]
RESULTS = config["results"]
HERE = f"{RESULTS}/{{place}}"
DRAWN = f"{config['figures']}/{{place}}"
LOG = f"{config['logs']}/{{place}}"
LAID_OVER = overlays.names_of(Path.cwd(), ["config/config.yaml", *workflow.overwrite_configfiles])
BENCHMARK = f"{config['logs']}/benchmarks/{{place}}"


wildcard_constraints:
    place=scenes.place_pattern(SCENES),
    set="[a-z][a-z0-9_]*",
    n_spo="[0-9]+",


# Snakemake does not see a change of installed packages; a parameter that changes with the lock
# file, or with what is imported instead of what it says, tells it.
RULES = Rules(
    RESULTS,
    SCENES,
    code_digest.fingerprint,
    software=imported_software.software_digest(Path(FILES.own("environment.lock"))),
)
of, column, files, placed = RULES.of, RULES.column, RULES.files, RULES.placed
detections, stage, setting = RULES.detections, RULES.stage, RULES.setting
parameter, growing = RULES.parameter, RULES.growing

# Compiled loops are kept with the other things that can be made again, and shared by all jobs.
os.environ.setdefault("NUMBA_CACHE_DIR", str(code_digest.folder_of_loops(Path.cwd())))

# No module of a job is taken from the folder in which Snakemake runs.
os.environ.update(PYTHONSAFEPATH="1")

# Jobs use the Python that runs Snakemake, also where its environment was not activated.
os.environ.update(PATH=os.pathsep.join([str(Path(sys.executable).parent), *os.get_exec_path()]))


onstart:
    overlays.note(Path.cwd(), config, workflow.overwrite_configfiles)
    # Tells a killed run's lock from that of a run on another machine; see tools/interrupted.py.
    Path(".snakemake/host").write_text(platform.node())
    # Snakemake 9 limits the rate at which jobs start to 100 a second, and for that wakes up once a
    # second more for every job that has finished: after a hundred it takes a good part of a core.
    # Jobs here take seconds, so that nothing is lost without the limit.
    _limit = getattr(workflow.scheduler, "job_rate_limiter", None)
    if _limit is not None and (_limit.max_jobs, _limit.timespan) == (100, 1):
        workflow.scheduler.job_rate_limiter = None


def views(name):
    """Input of a rule: a set of views, a store that its checksums speak for."""
    folder = f"{HERE}views/{name}"
    return {"views": ancient(folder), "views_digest": f"{folder}.sha256"}


def studies_of_pictures():
    """Studies of all pictures that are compared; stop where one is missing that no rule makes."""
    try:
        return claims_by_scene.finished(
            FILES.own("config/config.yaml"),
            [FILES.found(overlay) for overlay in config["pictures"]],
            made=f"{RESULTS}/claims.csv",
        )
    except InputError as problem:
        sys.exit(str(problem))


def verdicts_of_pictures(_wildcards):
    """Verdicts on all pictures."""
    return [study.report for study in studies_of_pictures()]


def names_of_pictures(_wildcards):
    """Names of all pictures."""
    return [study.name for study in studies_of_pictures()]
