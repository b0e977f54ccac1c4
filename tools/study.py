"""Run Snakemake and say how far the study is and how long it has still to go.

python tools/study.py [arguments of snakemake]                  run it
python tools/study.py --record tools/durations.csv [arguments]  and write down how long jobs take

Durations of an earlier run weigh the jobs: the same job of the same study takes about the same
share of the whole on any machine. Jobs that were never timed count like others of their kind.
"""

from __future__ import annotations

import csv
import functools
import itertools
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

DURATIONS = Path(__file__).with_name("durations.csv")

JOB = re.compile(r"^Job (\d+): (.+)$")
FINISHED = re.compile(r"^Finished jobid: (\d+) ")
WHOLE = "Finished jobid: 0 (Rule: all)"
# What stages say about their input, disk or memory, and Snakemake about folders.
REASONS = ("error: ", "OSError: ", "PermissionError: ")
AGAIN = "mend that and type the same command again."
UNKNOWN = 3.0  # seconds, for a job of which nothing is known


class Clock:
    """What has been done, and an estimate of what is left.

    Parameters
    ----------
    planned : iterable of str
        What each job that will run says about itself.
    durations : dict
        Seconds that jobs took in an earlier run, by what they say.
    """

    def __init__(self, planned: Iterable[str], durations: dict[str, float]) -> None:
        self.planned = list(planned)
        self.durations = durations
        self.total = sum(self.weight(job) for job in self.planned)
        self.done = 0.0
        self.n_done = 0

    def weight(self, job: str) -> float:
        """Seconds that a job is expected to take."""
        if job in self.durations:
            return self.durations[job]
        kind = kind_of(job)
        same = [seconds for other, seconds in self.durations.items() if kind_of(other) == kind]
        return sum(same) / len(same) if same else UNKNOWN

    def finish(self, job: str) -> None:
        """Count a job as done."""
        self.done += self.weight(job)
        self.n_done += 1

    def line(self, elapsed: float) -> str:
        """How far the study is, after some seconds."""
        share = self.done / self.total if self.total else 1.0
        text = (
            f"progress: {self.n_done} of {len(self.planned)} jobs, {100 * share:.0f} % of the work"
        )
        text += f"; {in_words(elapsed)} so far"
        if 0 < share < 1:
            text += f", about {in_words(elapsed * (1 - share) / share)} to go"
        return text


def kind_of(job: str) -> str:
    """What a job says without numbers and names, the same for all jobs of a rule."""
    return re.sub(r"'[^']*'|\S*\d\S*", "", job)


def in_words(seconds: float) -> str:
    """Duration for people.

    Examples
    --------
    >>> in_words(8), in_words(75), in_words(640)
    ('8 s', '1 min 15 s', '11 min')
    """
    if seconds < 60:
        return f"{seconds:.0f} s"
    if seconds < 600:
        return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"
    return f"{seconds / 60:.0f} min"


def jobs_of(output: str) -> list[str]:
    """What the jobs in Snakemake's output say about themselves."""
    return [found[2] for line in output.splitlines() if (found := JOB.match(line))]


def config_files(arguments: list[str]) -> list[str]:
    """Files of settings among the arguments of Snakemake.

    Examples
    --------
    >>> config_files(["-c2", "--configfile", "a.yaml", "b.yaml", "--", "figures/fig1.pdf"])
    ['a.yaml', 'b.yaml']
    """
    if "--configfile" not in arguments:
        return []
    after = arguments[arguments.index("--configfile") + 1 :]
    return list(itertools.takewhile(lambda argument: not argument.startswith("-"), after))


def settings_of(arguments: list[str]) -> dict[str, Any]:
    """Settings of a run."""
    from keystab.study.settings import read_yaml

    return read_yaml("config/config.yaml", *config_files(arguments))


def not_writable(arguments: list[str]) -> list[str]:
    """Folders of the settings in which nothing can be written."""
    from keystab.study.result_folders import FOLDERS, normal_folder

    settings = settings_of(arguments)
    folders = [".snakemake", *(normal_folder(str(settings[key])) for key in FOLDERS)]
    return [folder for folder in folders if not os.access(existing(Path(folder)), os.W_OK)]


def existing(folder: Path) -> Path:
    """The folder, or where it does not exist the one in which it would be made."""
    return folder if folder.exists() else existing(folder.absolute().parent)


def wrong_file(arguments: list[str]) -> str:
    """What is wrong with settings or this shell's memory, which Snakemake would not say."""
    from keystab.errors import InputError
    from keystab.study.settings import read_yaml
    from keystab.utils.memory import require_start

    try:
        require_start()
    except InputError as problem:
        return str(problem)
    for name in ("config/config.yaml", *config_files(arguments)):
        if not Path(name).is_file():
            return f"{name}: no such file of settings; check WITH="
        try:
            if not read_yaml(name):
                return f"{name}: holds no settings; write lines such as 'draft: true'"
        except InputError as problem:
            return str(problem)
    return ""


def read_durations(path: Path = DURATIONS) -> dict[str, float]:
    """Seconds that jobs took, by what they say; empty if nothing was written down."""
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        return {row["job"]: float(row["seconds"]) for row in csv.DictReader(file)}


def write_durations(durations: dict[str, float], path: Path) -> None:
    """Write down how long jobs took, in alphabetical order."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["job", "seconds"])
        writer.writerows((job, f"{durations[job]:.1f}") for job in sorted(durations))


def main(arguments: list[str]) -> int:
    """Plan, run, and report after every job; at the end, what stopped it."""
    record = None
    if arguments[:1] == ["--record"]:
        record, arguments = Path(arguments[1]), arguments[2:]
    wrong = wrong_file(arguments)
    if wrong:
        print(f"error: {wrong}", file=sys.stderr)
        return 2
    from interrupted import take_up, why_locked  # beside this file
    from study_end import ending, short

    take_up(Path.cwd(), functools.partial(print, flush=True))
    from keystab.provenance.shielded_environment import shielded

    profile = os.environ.get("SNAKEMAKE_PROFILE", "none")
    if profile != "none" and "--profile" not in arguments:
        print(
            f"SNAKEMAKE_PROFILE={profile} is not used here, so that results do not depend on it; "
            f"for its executor: make study PROFILE={profile}",
            file=sys.stderr,
        )
    snakemake, variables = [sys.executable, "-m", "snakemake"], shielded()
    plan = subprocess.run(
        [*snakemake, "--dry-run", *arguments], capture_output=True, text=True, env=variables
    )
    said = plan.stdout + plan.stderr
    planned = jobs_of(said)
    if (planned or "Write-protected output" in said) and (folders := not_writable(arguments)):
        print(
            f"error: {folders[0]} cannot be written to: mend that, or give another folder "
            "(settings results, figures, logs)",
            file=sys.stderr,
        )
        return 2
    if plan.returncode:  # says what is wrong
        return subprocess.run([*snakemake, *arguments], env=variables).returncode
    clock = Clock(planned, read_durations())
    began: dict[str, tuple[str, float]] = {}
    taken: dict[str, float] = {}
    reasons: list[str] = []
    locked = whole = False
    start = time.monotonic()
    with subprocess.Popen(
        [*snakemake, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        bufsize=1,
        env=variables,
    ) as run:
        assert run.stdout is not None
        try:
            for line in run.stdout:
                print(short(line), end="", flush=True)
                now = time.monotonic()
                whole = whole or line.startswith(WHOLE)
                locked = locked or "Directory cannot be locked" in line
                if line.startswith(REASONS) and line not in reasons:
                    reasons.append(line)
                if found := JOB.match(line):
                    began[found[1]] = (found[2], now)
                elif (found := FINISHED.match(line)) and found[1] in began:
                    job, since = began[found[1]]
                    taken[job] = now - since
                    clock.finish(job)
                    print(clock.line(now - start), flush=True)
        except KeyboardInterrupt:  # Snakemake got it as well, and puts its jobs away
            print(run.stdout.read(), end="", flush=True)
    if run.returncode == 0 and whole:
        end = ending(settings_of(arguments), overlays=config_files(arguments))
        print(end, end="", flush=True)
    if record is not None and run.returncode == 0:
        write_durations(taken, record)
    if locked:
        print(f"error: {why_locked(Path.cwd())}", file=sys.stderr)
    elif reasons:
        print(f"\nStopped by\n{''.join(reasons)}What was finished stays: {AGAIN}", file=sys.stderr)
    return run.returncode


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
