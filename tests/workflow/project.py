"""Copies of the project in which the workflow can be tried, and a way to run it there."""

from __future__ import annotations

import functools
import gc
import importlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARTS = ["Snakefile", "workflow", "profiles", "config", "src", "audit.lock", "environment.lock"]
IMPORTED_LATE = ("PIL.PngImagePlugin", "jsonschema", "smart_open", "snakemake.storage")
QUICK = ("--configfile", "config/quick.yaml")


class Project:
    """A copy of the project, run with its own library or, to save compiling, with the original's."""

    def __init__(self, folder: Path, own_library: bool = True) -> None:
        self.folder = folder
        self.library = (folder if own_library else ROOT) / "src"

    @property
    def environment(self) -> dict[str, str]:
        """Variables that make commands run in the copy use its library."""
        return {
            **os.environ,
            "PYTHONPATH": str(self.library),
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        }

    def snakemake(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run Snakemake on the copy; what it says on both streams is its output."""
        command = ["--cores", "1", *arguments]
        status, said, _ = in_fork(self._become, command, one_stream=True)
        return subprocess.CompletedProcess(command, status, said)

    def dry_run(self, *arguments: str) -> tuple[int, str]:
        """Run Snakemake without running jobs; its exit status and what it said."""
        status, output, errors = in_fork(self._become, ["--cores", "1", "--dry-run", *arguments])
        return status, output + errors

    def _become(self) -> None:
        """Make this process one in the copy's folder, with its library."""
        os.chdir(self.folder)
        os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        os.environ["PYTHONPATH"] = str(self.library)
        if self.library == ROOT / "src":
            return
        sys.path.insert(0, str(self.library))
        for name in [name for name in sys.modules if name.partition(".")[0] == "keystab"]:
            del sys.modules[name]

    def would_run(self, *arguments: str) -> dict[str, int]:
        """Rules that would run, with their numbers of jobs."""
        status, said = self.dry_run(*arguments)
        assert status == 0, said
        if "Nothing to be done" in said:
            return {}
        table = said.split("Job stats:")[1].split("total")[0]
        return {rule: int(n) for rule, n in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)}

    def edit(self, name: str, old: str, new: str) -> None:
        """Replace a text in a file, once."""
        path = self.folder / name
        text = path.read_text()
        assert old in text, f"{old!r} is not in {name}: adapt the test"
        path.write_text(text.replace(old, new, 1))


def in_fork(
    prepare: Callable[[], None], arguments: list[str], one_stream: bool = False
) -> tuple[int, str, str]:
    """Run Snakemake; its exit status, output and errors (in one stream: all is output).

    In a fork of this process, which has imported Snakemake and its plugins already, and without
    the collection of garbage of a process that ends soon: a third of the time.
    """
    _import_what_runs_need()
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        process = os.fork()
        if process == 0:
            status = 1
            try:
                gc.disable()
                os.dup2(output.fileno(), 1)
                os.dup2((output if one_stream else errors).fileno(), 2)
                sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
                sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
                if one_stream:
                    sys.stderr = sys.stdout
                # It gives jobs what this was when it was imported, perhaps by a test that
                # captures it.
                sys.modules["snakemake.shell"].STDOUT = sys.stdout
                prepare()
                sys.modules["snakemake.cli"].main(arguments)
                status = 0
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else int(end.code is not None)
                if isinstance(end.code, str):
                    print(end.code)
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(status)
        _, ended = os.waitpid(process, 0)
        said = []
        for file in (output, errors):
            file.seek(0)
            said.append(file.read())
        return os.waitstatus_to_exitcode(ended), said[0], said[1]


@functools.cache
def _import_what_runs_need() -> None:
    """Do once for all forks what each would do: import Snakemake, digest the code of jobs."""
    import snakemake.cli

    import keystab
    from keystab.provenance.code_digest import fingerprint

    assert Path(keystab.__file__).is_relative_to(ROOT / "src"), "another keystab is tested"
    for room in ("stages", "figures"):
        for path in (ROOT / "src/keystab" / room).glob("[!_]*.py"):
            fingerprint(f"keystab.{room}.{path.stem}")

    for name in IMPORTED_LATE:
        importlib.import_module(name)
    snakemake.cli.get_argument_parser()  # loads the plugins


def forked(
    command: list[str], cwd: Path, env: dict[str, str], **_options: object
) -> subprocess.CompletedProcess[str]:
    """Do for Snakemake what `subprocess.run` does, with `in_fork`."""

    def prepare() -> None:
        os.chdir(cwd)
        os.environ.update(env)

    assert command[:3] == [sys.executable, "-m", "snakemake"]
    status, output, errors = in_fork(prepare, command[3:])
    if status:
        print(errors, file=sys.stderr)  # for the report of a test that fails
    return subprocess.CompletedProcess(command, status, output, errors)


def copy_of_project(folder: Path, own_library: bool = True) -> Project:
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(source, folder / part, ignore=ignored)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, folder / part)
    return Project(folder, own_library)
