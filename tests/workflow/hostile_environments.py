"""Environments of people whose other projects want other things: variables, homes and links.

Processors and their libraries are no part of this: what they may change is said beside each column
of the tables (`keystab.study.column_tolerances`).
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

from project import ROOT, copy_of_project

Variables = dict[str, str]
BROKEN = "raise ImportError('another project')\n"


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def profile(folder: Path) -> Variables:
    """A profile of Snakemake that reruns nothing, says nothing and has settings of its own."""
    written(
        folder / "mine/config.yaml",
        "rerun-triggers: [mtime]\nquiet: [all]\nkeep-going: true\ncores: 64\n"
        f"configfile: [{ROOT}/config/what_if/cosine.yaml]\n",
    )
    return {"SNAKEMAKE_PROFILE": str(folder / "mine"), "SNAKEMAKE_OUTPUT_CACHE": str(folder)}


def home(folder: Path) -> Variables:
    """A home with settings of Snakemake, pip and matplotlib."""
    config = folder / "home/.config"
    written(config / "snakemake/default/config.yaml", "rerun-triggers: [mtime]\nquiet: [all]\n")
    written(config / "pip/pip.conf", "[install]\ntarget = /nowhere\nno-deps = true\n")
    written(config / "matplotlib/matplotlibrc", "font.size: 30\nsavefig.dpi: 20\naxes.grid: True\n")
    return {"HOME": str(folder / "home"), "XDG_CONFIG_HOME": str(config)}


def other_packages(folder: Path) -> Variables:
    """Another matplotlib and another keystab before all others."""
    for name in ("matplotlib", "numpy", "keystab", "yaml"):
        written(folder / f"packages/{name}/__init__.py", BROKEN)
    return {"PYTHONPATH": str(folder / "packages")}


def other_python(folder: Path) -> Variables:
    """What the modules of a cluster say of another Python."""
    return {
        "PYTHONHOME": str(folder / "nowhere"),
        "PYTHONSTARTUP": str(written(folder / "start.py", BROKEN)),
        "PYTHONOPTIMIZE": "2",
        "PYTHONSAFEPATH": "",
        "VIRTUAL_ENV": str(folder / "nowhere"),
        "CONDA_PREFIX": str(folder / "nowhere"),
    }


def packages_of_user(folder: Path) -> Variables:
    """Packages that a user has installed for all projects."""
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = folder / f"base/lib/{version}/site-packages"
    for name in ("usercustomize.py", "matplotlib/__init__.py", "scipy/__init__.py"):
        written(site / name, BROKEN)
    return {"PYTHONUSERBASE": str(folder / "base"), "PYTHONNOUSERSITE": ""}


def shell(folder: Path) -> Variables:
    """A shell that goes elsewhere, and that says and does something when it starts."""
    (folder / "elsewhere/tools").mkdir(parents=True)
    start = written(folder / "start.sh", "echo hello\nset -u\ncd /\n")
    return {"CDPATH": str(folder / "elsewhere"), "BASH_ENV": str(start), "ENV": str(start)}


def threads(_folder: Path) -> Variables:
    """Many threads."""
    names = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "VECLIB_MAXIMUM", "NUMBA")
    return {f"{name}_NUM_THREADS": "64" for name in names if name != "NUMBA"}


def place(_folder: Path) -> Variables:
    """Another language, another time, other letters."""
    return {
        "LC_ALL": "tr_TR.ISO-8859-9",
        "LANGUAGE": "tr",
        "TZ": "Asia/Kathmandu",
        "PYTHONIOENCODING": "latin-1",
        "PYTHONUTF8": "0",
        "COLUMNS": "20",
    }


def drawing(folder: Path) -> Variables:
    """Other drawing."""
    rc = written(folder / "rc/matplotlibrc", "font.size: 30\nlines.linewidth: 9\npdf.fonttype: 3\n")
    return {"MPLBACKEND": "TkAgg", "MPLCONFIGDIR": str(rc.parent), "MATPLOTLIBRC": str(rc)}


def nobody(folder: Path) -> Variables:
    """No home, and a folder for temporary files with a blank in its name."""
    (folder / "for a while").mkdir()
    return {
        "HOME": "/nonexistent",
        "USER": "",
        "LOGNAME": "",
        "TMPDIR": str(folder / "for a while"),
    }


def strictness(_folder: Path) -> Variables:
    """Warnings that are errors, another order of sets, another date."""
    return {"PYTHONWARNINGS": "error", "PYTHONHASHSEED": "7", "SOURCE_DATE_EPOCH": "1"}


def installing(folder: Path) -> Variables:
    """What pip is told for other projects."""
    return {
        "PIP_TARGET": str(folder / "target"),
        "PIP_USER": "1",
        "PIP_NO_DEPS": "1",
        "PIP_REQUIRE_VIRTUALENV": "1",
        "PIP_PREFIX": str(folder / "prefix"),
    }


ENVIRONMENTS: tuple[Callable[[Path], Variables], ...] = (
    profile, home, other_packages, other_python, packages_of_user, shell,
    threads, place, drawing, nobody, strictness, installing,
)  # fmt: skip


def checkout(folder: Path) -> Path:
    """A copy of the project that `make` works in, with the packages of this Python."""
    copy_of_project(folder, own_library=False)
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy2(ROOT / name, folder / name)
    shutil.copytree(ROOT / "tools", folder / "tools", ignore=shutil.ignore_patterns("__pycache__"))
    venv = folder / ".venv"
    packages = sysconfig.get_path("purelib", vars={"base": str(venv)})
    written(Path(packages) / "here.pth", f"{ROOT / 'src'}\n{sysconfig.get_path('purelib')}\n")
    shutil.copy(Path(sys.prefix) / "pyvenv.cfg", venv / "pyvenv.cfg")
    (venv / "bin").mkdir()
    (venv / "bin/python").symlink_to(sys.executable)
    lock, project = (ROOT / name for name in ("environment.lock", "pyproject.toml"))
    digest = hashlib.sha256(lock.read_bytes() + project.read_bytes()).hexdigest()
    (venv / ".stamp").write_text(f"{digest} {folder.resolve()} any")
    return folder


def made(folder: Path, variables: Variables, *targets: str) -> dict[str, bytes]:
    """What `make` makes in a copy under some variables: bytes of tables, verdicts and figures."""
    plain = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("MAKE", "SNAKEMAKE", "PYTHON"))
    }
    done = subprocess.run(
        ["make", "CORES=2", *targets],
        cwd=folder,
        env={**plain, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert done.returncode == 0, done.stdout.decode(errors="replace")[-3000:]
    files = [*folder.glob("figures/**/*"), *folder.glob("results/quick/**/*")]
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in files
        if path.is_file() and path.name != ".snakemake_timestamp"
    }
