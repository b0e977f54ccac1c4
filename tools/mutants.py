"""Which wrong lines do the tests notice? A fixed sample of single changes of meaning.

python tools/mutants.py draw            draw the sample anew: only where other changes are wanted
python tools/mutants.py run             make each change in a copy, run the tests of its module
python tools/mutants.py run --all       and of what survived all the others that are not slow
python tools/mutants.py run 17 230      only these, again
python tools/mutants.py table           write the result, with the commits it is of

A run goes on where the last one was stopped. Its copy, its costs and its results lie in
``build/mutants``; the sample, the equivalent ones with the reason, and the last result in
``tests/mutants``. Well-kept testers (mutmut, cosmic-ray) change a function in the running process
or beside it and know nothing of loops that numba has compiled: it compiles a loop again when its
own file changes, not when a loop that it calls in another file does, and a survivor would be one
that never ran. Here each change gets the compiled loops of exactly the modules that do not import
the changed one. What it costs to import and compile is in the seconds.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import os
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import psutil
from mutations import Change, applied, changes

import keystab
from keystab.provenance.code_digest import imported_modules, modules_of_loops

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "tests/mutants"
WORK = ROOT / "build/mutants"
TREE, LOOPS = WORK / "tree", WORK / "loops"
SOUND = WORK / "sound.txt"  # tests that pass on unchanged code, of those that noticed something
SEED, SIZE, LEAST = 20260722, 300, 10
ALLOWANCE = 40.0
"""Seconds of tests near a module, beyond its own, that are tried before all others."""
TESTS = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
NOT_CHANGED = {"figures/palette.py", "figures/style.py", "_version.py"}
GROUPS = {"comparisons, bounds, tie-breaks": ("comparison", "bound", "tie-break")}


def draw(root: Path = ROOT) -> list[dict[str, Any]]:
    """The sample: of each room at least `LEAST`, else by its lines, of each kind in turn."""
    chosen = random.Random(SEED)
    rooms: dict[str, dict[str, list[tuple[str, str, Change]]]] = {}
    lines: dict[str, int] = defaultdict(int)
    for path in sorted((root / "src/keystab").rglob("*.py")):
        name = path.relative_to(root / "src/keystab").as_posix()
        room = name.split("/")[0] if "/" in name else "utils"  # settings and errors
        if name in NOT_CHANGED:
            continue
        source = path.read_text()
        lines[room] += source.count("\n")
        for one in changes(source, room == "figures"):
            text = source.splitlines()[one.line - 1]
            rooms.setdefault(room, {}).setdefault(one.operator, []).append((name, text, one))
    rest = SIZE - LEAST * len(rooms)
    shares = {room: LEAST + rest * lines[room] / sum(lines.values()) for room in sorted(rooms)}
    counts = {room: int(share) for room, share in shares.items()}
    for room in sorted(shares, key=lambda it: counts[it] - shares[it])[
        : SIZE - sum(counts.values())
    ]:
        counts[room] += 1
    sample: list[dict[str, Any]] = []
    for room, count in counts.items():
        waiting = {kind: chosen.sample(all_, len(all_)) for kind, all_ in rooms[room].items()}
        taken: set[tuple[str, int]] = set()
        while len(taken) < count:
            for kind in chosen.sample(sorted(waiting), len(waiting)):
                while waiting[kind] and len(taken) < count:
                    name, text, one = waiting[kind].pop()
                    if (name, one.line) not in taken:
                        taken.add((name, one.line))
                        sample.append(_row(len(sample) + 1, room, name, text, one))
                        break
    return sample


def _row(number: int, room: str, name: str, text: str, one: Change) -> dict[str, Any]:
    indent = len(text.encode()) - len(text.encode().lstrip())
    return {
        "number": number, "room": room, "module": name, "line": one.line, "function": one.function,
        "operator": one.operator, "before": one.before, "after": one.after,
        "column": one.start - indent, "text": text.strip(),
    }  # fmt: skip


def find(row: dict[str, Any], source: str) -> Change | None:
    """The change of a row in a source whose other lines may have moved; None: it is gone."""
    there = [
        one
        for one in changes(source, row["room"] == "figures")
        if (one.function, one.operator, one.before, one.after)
        == (row["function"], row["operator"], row["before"], row["after"])
        and (text := source.splitlines()[one.line - 1]).strip() == row["text"]
        and one.start - (len(text.encode()) - len(text.encode().lstrip())) == int(row["column"])
    ]
    return min(there, key=lambda one: abs(one.line - int(row["line"])), default=None)


def tests_of(name: str, root: Path = ROOT) -> list[set[str]]:
    """Files with tests that name a module; then those that name one which imports it, and so on."""
    texts = {path: path.read_text() for path in sorted((root / "tests/unit").glob("test_*.py"))}
    package = root / "src/keystab"
    modules = {
        _dotted(path.relative_to(package).as_posix()): path.read_text()
        for path in sorted(package.rglob("*.py"))
        if path.parent != package or path.name != "__init__.py"
    }

    def imports(module: str) -> str:
        room, _, last = module.rpartition(".")
        return rf"{re.escape(module)}\b|from {re.escape(room)} import (\([^)]*|[^\n]*)\b{last}\b"

    def naming(module: str) -> set[str]:
        public = [it for it, home in vars(keystab)["_HOME"].items() if f"keystab.{home}" == module]
        words = [
            imports(module),
            *(rf"keystab\.{it}\b|from keystab import .*\b{it}\b" for it in public),
        ]
        room, last = module.split(".")[-2:]
        if room in ("stages", "figures"):  # many of them in one test, each by its name
            words.append(rf"{room}[\s\S]*\"{last}\"|\"{last}\"[\s\S]*{room}")
        pattern = re.compile("|".join(words))
        return {f"tests/unit/{path.name}" for path, text in texts.items() if pattern.search(text)}

    module = _dotted(name)
    layers, seen, waiting = [naming(module)], {module}, {module}
    while waiting:
        pattern = re.compile("|".join(map(imports, sorted(waiting))))
        waiting = {it for it, text in modules.items() if pattern.search(text)} - seen
        seen |= waiting
        layers.append(set().union(*map(naming, waiting)) - set().union(*layers))
    return layers


def _dotted(name: str) -> str:
    return "keystab." + name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def copy_tree() -> None:
    """Bring the copy up to date with what is tracked here, or new; compiled loops stay."""
    listing = ["git", "ls-files", "-z", "-co", "--exclude-standard"]
    named = subprocess.run(listing, cwd=ROOT, capture_output=True, check=True)
    here = {name for name in named.stdout.decode().split("\0") if name and (ROOT / name).is_file()}
    TREE.mkdir(parents=True, exist_ok=True)
    LOOPS.mkdir(exist_ok=True)
    for folder in ("src", "tests"):
        for path in (TREE / folder).rglob("*.py"):
            if path.relative_to(TREE).as_posix() not in here:
                path.unlink()
    edited = set()
    for name in sorted(here):
        old, new = TREE / name, ROOT / name
        if not old.is_file() or old.read_bytes() != new.read_bytes():
            old.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(new, old)
            edited.add(name)
    if not (TREE / ".venv").exists():
        (TREE / ".venv").symlink_to(ROOT / ".venv")
    if edited:
        SOUND.unlink(missing_ok=True)
    for name in edited:
        if name.startswith("src/keystab/") and name.endswith(".py"):
            forget(name.removeprefix("src/keystab/"), LOOPS)


def forget(name: str, loops: Path) -> None:
    """Remove the compiled loops of a module and of all that import it."""
    module, package = _dotted(name), ROOT / "src/keystab"
    for other in modules_of_loops(package):
        if module in imported_modules(other, package):
            *_, room, last = other.split(".")
            for path in loops.glob(f"{room}_*/{last}.*"):
                path.unlink()


def pytest(words: Sequence[str], loops: Path, limit: float) -> tuple[str, float]:
    """Run tests in the copy; what the first failure is (nothing: all pass), and the seconds."""
    shown = {"PYTHONPATH": str(TREE / "src"), "NUMBA_CACHE_DIR": str(loops)}
    known = {
        key: os.environ[key] for key in ("PATH", "HOME", "LANG", "TMPDIR") if key in os.environ
    }
    begin = time.monotonic()
    process = subprocess.Popen(
        [*TESTS, *words], cwd=TREE, env=known | shown, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        said, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        return "does not end", time.monotonic() - begin
    finally:  # of a run that was stopped too: nothing goes on behind it
        _end(process)
    seconds = time.monotonic() - begin
    if process.returncode in (0, 5):
        return "", seconds
    if "ERROR: file or directory not found" in said or "ERROR: not found" in said:
        raise SystemExit(said)
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, re.MULTILINE)
    return failed[1] if failed else said.strip().splitlines()[-1], seconds


def _end(process: subprocess.Popen[str]) -> None:
    """End a run of tests with all that it started, in sessions of their own too."""
    with contextlib.suppress(psutil.Error):
        for child in psutil.Process(process.pid).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                child.kill()
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def costs() -> tuple[dict[str, float], list[str]]:
    """Seconds of each file of tests on unchanged code, and the tests that fail on it."""
    report = WORK / "costs.xml"
    if not report.is_file():
        print("all tests once, on unchanged code: what each costs, and what fails in a copy")
        pytest(["-m", "not slow", f"--junitxml={report}", "tests/unit"], LOOPS, 7200.0)
    seconds: dict[str, float] = defaultdict(float)
    failing = []
    for case in ET.parse(report).getroot().iter("testcase"):
        file = case.get("classname", "").replace(".", "/") + ".py"
        seconds[file] += float(case.get("time", "0"))
        if case.find("failure") is not None or case.find("error") is not None:
            failing.append(f"{file}::{case.get('name', '')}")
    return seconds, failing


def noticed(
    row: dict[str, Any], costly: dict[str, float], failing: list[str], all_: bool
) -> dict[str, Any]:
    """Make one change in the copy, and run tests until one fails."""
    path = TREE / "src/keystab" / row["module"]
    source = path.read_text()
    change = find(row, source)
    if change is None:
        return {"by": "gone", "of": "", "seconds": 0.0}
    loops = WORK / "loops_of_change"
    shutil.rmtree(loops, ignore_errors=True)
    shutil.rmtree(TREE / ".hypothesis", ignore_errors=True)
    shutil.copytree(LOOPS, loops, copy_function=os.link)
    forget(row["module"], loops)
    original = WORK / "original.py"
    shutil.copy2(path, original)
    path.write_text(applied(source, change))
    when = 10**9 + int(row["number"])  # compiled files go by the second: each change has its own
    os.utime(path, (when, when))
    try:
        found = _until_noticed(row, costly, failing, loops, all_)
    finally:
        shutil.copy2(original, path)
    if _is_sound(found["by"]):
        return found
    print(found["by"], "fails on unchanged code at times: the change is made again without it")
    failing.append(found["by"])
    return noticed(row, costly, failing, all_)


def _is_sound(test: str) -> bool:
    """Whether a test that noticed something passes on unchanged code."""
    sound = SOUND.read_text().splitlines() if SOUND.is_file() else []
    if "::" not in test or test in sound:
        return True
    if pytest([test], LOOPS, 600.0)[0]:
        return False
    SOUND.write_text("\n".join([*sound, test]))
    return True


def _until_noticed(
    row: dict[str, Any], costly: dict[str, float], failing: list[str], loops: Path, all_: bool
) -> dict[str, Any]:
    module = _dotted(row["module"])
    own, *others = (
        sorted(it, key=lambda at: costly.get(at, 1.0)) for it in tests_of(row["module"], TREE)
    )
    near = [file for layer in others for file in layer]
    without = [word for it in failing for word in ("--deselect", it)]
    spent = 0.0
    near = list(_within(ALLOWANCE, near, costly))
    groups = [("own", own), ("near", near)]
    if ">>> " in (TREE / "src/keystab" / row["module"]).read_text():
        groups.insert(0, ("example", [f"tests/unit/test_examples.py::test_examples[{module}]"]))
    if all_:
        rest = sorted(set(costly) - {*own, *near}, key=lambda it: costly[it])
        groups.append(("all", [*rest, "tests/workflow"]))
    for of, files in groups:
        if files:
            limit = 90.0 + 8 * sum(costly.get(it, 30.0) for it in files)
            by, seconds = pytest(["-x", "-m", "not slow", *without, *files], loops, limit)
            spent += seconds
            if by:
                return {"by": by, "of": of, "seconds": round(spent, 1)}
    return {"by": "", "of": "all" if all_ else "near", "seconds": round(spent, 1)}


def _within(seconds: float, files: Iterable[str], costly: dict[str, float]) -> Iterator[str]:
    for file in files:
        seconds -= costly.get(file, 1.0)
        if seconds >= 0:
            yield file


def read(path: Path) -> list[dict[str, Any]]:
    """Rows of a table; none where it is not there."""
    if not path.is_file():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write rows as a table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def run(numbers: Sequence[int], all_: bool) -> None:
    """Make the changes that have no result yet, or those named; keep each result as it comes."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # the copy is put in order first
    copy_tree()
    costly, failing = costs()
    sample = read(KEPT / "sample.csv")
    random.Random(SEED).shuffle(sample)  # a part of it is a sample of all rooms too
    results = {
        row["number"]: row | {"commit": row.get("commit", "")} for row in read(WORK / "results.csv")
    }
    commit = _commit()  # of the copy: what is edited meanwhile is not in it
    for row in sample:
        old = results.get(row["number"])
        again = old is None or (all_ and not old["by"] and old["of"] != "all")
        if int(row["number"]) in numbers if numbers else again:
            found = {"number": row["number"], **noticed(row, costly, failing, all_)}
            found["commit"] = commit
            results[row["number"]] = found
            write(WORK / "results.csv", sorted(results.values(), key=lambda it: int(it["number"])))
            print(row["number"], row["module"], row["line"], row["before"], "->", row["after"], ":",
                  found["by"] or "NOT NOTICED", found["seconds"], flush=True)  # fmt: skip


_UNFINISHED = [
    "This is no finished measurement: changes are not all made yet, or not all with the tests of "
    "one commit. What survived at first had tests written for it and was made again, so that the "
    "shares are higher than those of changes that nobody has looked at.",
    "",
]


def _commit() -> str:
    """The commit here, and whether files differ from it."""
    said = ["git", "describe", "--always", "--dirty", "--exclude=*"]
    return subprocess.run(said, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def table() -> str:
    """The result in words: shares by room and by kind, what survived, what is equivalent."""
    sample = {row["number"]: row for row in read(KEPT / "sample.csv")}
    equal = {row["number"]: row["reason"] for row in read(KEPT / "equivalent.csv")}
    results = [sample[it["number"]] | it for it in read(WORK / "results.csv") if it["by"] != "gone"]
    counted = [it for it in results if it["by"] or it["number"] not in equal]
    commits = sorted({it.get("commit") or "a commit that was not noted" for it in results})
    seconds = [float(it["seconds"]) for it in counted if it["by"]]
    lines = [
        "# Which wrong lines the tests notice", "",
        f"By `make mutants`, of {', '.join(commits)}: {len(results)} of the {len(sample)} changes "
        f"of `sample.csv` were made, {len(results) - len(counted)} of them change nothing "
        f"(`equivalent.csv`). Median time to notice: {statistics.median(seconds):.1f} s.", "",
        *_UNFINISHED * (len(results) < len(sample) or len(commits) > 1),
        "| what | noticed | of | share |", "|---|--:|--:|--:|",
    ]  # fmt: skip
    parts = {"all": counted}
    parts |= {name: [it for it in counted if it["operator"] in of] for name, of in GROUPS.items()}
    for key in ("room", "operator"):
        for value in sorted({it[key] for it in counted}):
            parts[f"{key} {value}"] = [it for it in counted if it[key] == value]
    for name, rows in parts.items():
        good = sum(bool(it["by"]) for it in rows)
        share = f"{100 * good / len(rows):.0f} %" if rows else ""
        lines.append(f"| {name} | {good} | {len(rows)} | {share} |")
    lines += ["", "| not noticed | place | line | change |", "|--:|---|---|---|"]
    for it in counted:
        if not it["by"]:
            place, text, before, after = (
                it[key].replace("|", "\\|") for key in ("module", "text", "before", "after")
            )
            lines.append(
                f"| {it['number']} | {place}:{it['line']} | `{text}` | `{before}` to `{after}` |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Do what is asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("what", choices=["draw", "run", "table"])
    parser.add_argument("numbers", nargs="*", type=int)
    parser.add_argument("--all", action="store_true", help="survivors: all tests that are not slow")
    given = parser.parse_args()
    if given.what == "draw":
        write(KEPT / "sample.csv", draw())
    elif given.what == "run":
        run(given.numbers, given.all)
    else:
        write(KEPT / "results.csv", read(WORK / "results.csv"))
        (KEPT / "README.md").write_text(table())


if __name__ == "__main__":
    main()
