"""The set-up and `make` do the same whatever variables, links and jobs they are started with."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTHON = """#!/bin/sh
# Stands for the study: works alone in its folder, and says what it was given.
mkdir busy || exit 3
sleep 0.2
printf '%s|' "$@" >>said
printf 'PYTHONPATH=%s\\n' "${PYTHONPATH-}" >>said
rmdir busy
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose .venv is made, as far as its stamp says."""
    folder = tmp_path / "checkout"
    (folder / "tools").mkdir(parents=True)
    (folder / ".venv/bin").mkdir(parents=True)
    for name in ("Makefile", "tools/environment"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "environment.lock").write_text("lock\n")
    (folder / "pyproject.toml").write_text("project\n")
    (folder / ".venv/bin/python").write_text(PYTHON)
    (folder / ".venv/bin/python").chmod(0o755)
    digest = hashlib.sha256(b"lock\nproject\n").hexdigest()
    (folder / ".venv/.stamp").write_text(f"{digest} {folder.resolve()} any")
    return folder


def run(folder: Path, *command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command with variables, some of which stand for those of another project."""
    left = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    env = {**left, **variables, "PWD": str(folder)}
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=30)


def test_a_checkout_is_the_same_through_a_link(checkout, tmp_path):
    (tmp_path / "link").symlink_to(checkout)
    # Else it would be made anew, from a lock that is none.
    done = run(tmp_path / "link", "tools/environment", PYTHON="")
    assert (done.returncode, done.stderr) == (0, "")


def test_cdpath_leads_to_no_other_checkout(checkout, tmp_path):
    (tmp_path / "other/tools").mkdir(parents=True)
    done = run(checkout, "tools/environment", CDPATH=str(tmp_path / "other"), PYTHON="")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_numbers_of_threads_are_no_numbers_of_jobs(checkout):
    plain = run(checkout, "make", "-n", "study").stdout
    with_threads = run(checkout, "make", "-n", "study", OMP_NUM_THREADS="61").stdout
    assert plain == with_threads and "--cores 61" not in plain and "--cores" in plain


def test_two_figures_at_a_time_follow_each_other(checkout):
    done = run(checkout, "make", "-j2", "figures/fig1.pdf", "figures/my roof/fig4.pdf")
    assert done.returncode == 0, done.stderr
    figures = [line.split("|")[3] for line in (checkout / "said").read_text().splitlines()]
    assert figures == ["figures/fig1.pdf", "figures/my roof/fig4.pdf"]


def test_what_python_is_told_for_other_projects_is_left_out(checkout):
    done = run(checkout, "make", "study", PYTHONPATH="/opt/cluster", PROFILE="someone's")
    assert done.returncode == 0, done.stderr
    said = (checkout / "said").read_text()
    assert said.endswith("|PYTHONPATH=\n") and "--profile" not in said


def test_a_profile_is_taken_where_it_is_asked_for(checkout):
    run(checkout, "make", "study", "PROFILE=profiles/slurm")
    said = (checkout / "said").read_text()
    assert "|--profile|profiles/slurm|" in said and "--cores" not in said


def test_a_file_name_with_a_blank_is_one_target_of_why(checkout):
    run(checkout, "make", "why", "TARGET=my roof/it's fig4.pdf")
    assert "tools/why.py|my roof/it's fig4.pdf|PYTHONPATH" in (checkout / "said").read_text()
    run(checkout, "make", "why")
    assert (checkout / "said").read_text().endswith("tools/why.py|PYTHONPATH=\n")


def test_names_of_scenes_are_words_and_no_commands(checkout):
    run(checkout, "make", "scenes", "SCENES=lake text_1; touch owned 'it's")
    said = (checkout / "said").read_text()
    assert "tools/scenes.py|lake|text_1;|touch|owned|'it's|--|" in said
    assert not (checkout / "owned").exists()


NEW_PYTHON = """#!/bin/sh
# Stands for a Python that makes .venv, and for that in it: says what pip would go by.
case "$*" in
    *"-m venv"*) mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
    *"config list"*) printf '%s\\n' "global.index-url='https://mirror'" "install.target='/opt'" \\
        "install.no-deps='true'" "global.find-links='\\\\n/one\\\\n/two three'" "user.cert='x'" ;;
    *pip_mirrors*) exec {python} "$@" ;;
    *"pip "*install*) env | grep ^PIP_ | sort >>said ;;
esac
"""


def test_of_pip_conf_only_mirrors_are_taken(checkout, tmp_path):
    shutil.rmtree(checkout / ".venv")
    shutil.copy(ROOT / "tools/pip_mirrors.py", checkout / "tools/pip_mirrors.py")
    python = tmp_path / "python"
    python.write_text(NEW_PYTHON.replace("{python}", sys.executable))
    python.chmod(0o755)
    own = {"PIP_PROXY": "http://proxy", "PIP_TARGET": "/opt", "PIP_FIND_LINKS": "/mine"}
    done = run(checkout, "tools/environment", PYTHON=str(python), **own)
    assert done.returncode == 0, done.stderr
    said = set((checkout / "said").read_text().splitlines())
    wanted = {
        "PIP_CONFIG_FILE=/dev/null",
        "PIP_INDEX_URL=https://mirror",
        "PIP_PROXY=http://proxy",
        "PIP_FIND_LINKS=/mine",
    }
    assert wanted <= said and not [it for it in said if "TARGET" in it or "NO_DEPS" in it]
