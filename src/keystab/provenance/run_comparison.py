"""Whether tables, verdicts and figures of a run are those of another one, such as the reference.

What the run says may come from a stranger. It is read as data, in bounded time and memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from keystab.errors import InputError
from keystab.provenance.lineage import file_digest, read_figure_metadata
from keystab.provenance.result_checks import Check, Run, left_out_digests, verdicts_in
from keystab.provenance.run_description import About, arithmetic, read_about
from keystab.provenance.table_differences import file_difference
from keystab.study.column_tolerances import Allowed

__all__ = ["alike", "check_reference", "compare_tables", "compare_verdicts"]

_MOST_NAMED, _MOST_CHUNKS = 5, 10_000
_ONE_KEYPOINT = (
    "on another processor rounding may decide over a single keypoint; what follows from it, shares "
    "and medians, then differs as well"
)
_GREY_LEVELS, _SHARE_OF_PIXELS = 32, 0.005


def check_reference(run: Run, reference: Path, lock: str, other: Sequence[str] = ()) -> list[Check]:
    """Compare tables, verdicts and figures with the committed reference.

    Parameters
    ----------
    run : Run
    reference : path
        Folder that `keystab.provenance.archive.publish` wrote.
    lock : str
        SHA-256 of the lock file here.
    other : sequence of str, optional
        Names of settings that are not those of the reference, as far as they are known.

    Returns
    -------
    list of Check
        One that says why, where the reference cannot be compared with.
    """
    try:
        about = read_about(reference)
    except InputError as error:
        return [Check("results/reference", f"not compared: {str(error).split('; ')[0]}")]
    if about.settings != run.about.settings:
        named = ", ".join(other[:_MOST_NAMED]) + (" and more" if len(other) > _MOST_NAMED else "")
        told = "not compared: it was made with other settings" + (f": {named}" if named else "")
        return [Check("results/reference", told)]
    exact = alike(about, run.about.lock, run.about.arithmetic)
    return [
        compare_tables(
            reference, run.folder / run.about.results, lock, machine=run.about.arithmetic
        ),
        compare_verdicts(reference, run.folder / run.about.results),
        _compare_pictures(run, reference, about, exact),
    ]


def compare_verdicts(reference: Path, results: Path) -> Check:
    """Compare the verdicts on claims of two runs.

    Parameters
    ----------
    reference, results : path
        Folders of results; where there are no verdicts, none are compared.
    """
    try:
        before, after = (
            verdicts_in(folder / "claims.csv") if (folder / "claims.csv").is_file() else {}
            for folder in (reference, results)
        )
    except InputError as error:
        return Check("claims", "", [f"claims.csv: {str(error).partition(': ')[2]}"])
    told = [
        f"{name[:60]}: {before.get(name, 'no verdict')} before, "
        f"{after.get(name, 'no verdict')[:40]} now"
        for name in sorted(before.keys() | after.keys())
        if before.get(name) != after.get(name)
    ]
    return Check("claims", f"{len(before)} verdicts the same", told)


def _compare_pictures(run: Run, reference: Path, about: About, exact: bool) -> Check:
    """Compare figures with those of the reference that the same code drew."""
    digests = {PurePosixPath(name).name: it for name, it in left_out_digests(reference).items()}
    exact = exact and about.zlib == run.about.zlib
    problems, not_compared = [], 0
    for path in run.figures:
        expected = reference / "figures" / f"{path.stem}.png"
        try:
            mine = read_figure_metadata(path, as_drawn=True)
            its = read_figure_metadata(expected, as_drawn=True)
        except InputError:
            not_compared += 1
            continue
        alike = (mine.tables, mine.settings) == (its.tables, its.settings)
        told: str | None = None
        if (mine.code, mine.lock) == (its.code, its.lock):
            digest = run.digest(run.name(path))
            if path.suffix == ".png":
                same = digest == file_digest(expected)
                told = "" if same else _other_pixels(path, expected, alike)
            elif alike and exact and path.name in digests:
                told = "" if digest == digests[path.name] else "other bytes"
        if told:
            problems.append(f"{run.name(path)}: not as in results/reference: {told}")
        not_compared += told is None
    compared = len(run.figures) - not_compared
    words = f"{compared - len(problems)} of {compared} as in results/reference"
    why = "drawn there by other code or from other tables, or on another machine, or not at all"
    notes = [f"{not_compared} not compared: {why}"] * bool(not_compared)
    return Check("pictures", words, problems, notes)


def _has_many_chunks(path: Path) -> bool:
    """Whether a PNG has so many chunks that decoding it takes long."""
    with path.open("rb") as file:
        file.seek(8)
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            if len(head) < 8:
                return False
            file.seek(int.from_bytes(head[:4], "big") + 4, 1)
    return True


def _other_pixels(path: Path, expected: Path, same_tables: bool) -> str:
    """Say how a picture differs from another; a little is allowed where tables differ."""
    import numpy as np
    from PIL import Image

    if _has_many_chunks(path):
        return "cannot be read"
    try:
        with Image.open(path, formats=["PNG"]) as one, Image.open(expected) as other:
            if one.size != other.size:
                return (
                    f"{one.size[0]} x {one.size[1]} pixels, there {other.size[0]} x {other.size[1]}"
                )
            a, b = (np.asarray(it.convert("RGB"), dtype=np.int16) for it in (one, other))
    except (OSError, SyntaxError, ValueError, LookupError, Image.DecompressionBombError):
        return "cannot be read"
    distance = np.abs(a - b).max(axis=2)
    if same_tables:
        n = int((distance > 0).sum())
        return f"{n} of its {distance.size} pixels differ" if n else ""
    n = int((distance > _GREY_LEVELS).sum())
    if n <= _SHARE_OF_PIXELS * distance.size:
        return ""
    return f"{n} of its {distance.size} pixels differ clearly"


def compare_tables(
    expected: Path,
    found: Path,
    lock: str,
    names: Sequence[str] = (),
    allowed: Allowed | None = None,
    machine: str | None = None,
) -> Check:
    """Compare tables of two runs.

    Parameters
    ----------
    expected : path
        Folder with ``archive.json`` of the one run, and its tables.
    found : path
        Folder of the results of the other.
    lock : str
        SHA-256 of the lock file of the other.
    names : sequence of str, optional
        Tables to compare, by file name; all by default.
    allowed : Allowed, optional
        What floating-point numbers may differ by, the same in all columns; by default what
        `keystab.study.column_tolerances` says of each. It counts where software or processor
        differ; where both are the same, tables have to be the same to the last bit.
    machine : str, optional
        Arithmetic of the other run, see `keystab.provenance.run_description.arithmetic`;
        that of this machine by default.

    Returns
    -------
    Check
    """
    about = read_about(expected)
    same_machine = alike(about, lock, machine)
    tables = expected / "tables"
    if not tables.is_dir():
        tables = expected / about.results / "tables"
    paths = sorted(tables.glob("*.csv")) + sorted(tables.glob("*.parquet"))
    paths = [path for path in paths if not names or path.name in names]
    left_out = {PurePosixPath(path).name for path in left_out_digests(expected)}
    new = sorted(set(names) - {path.name for path in paths} - left_out)
    problems = [f"{name}: not in the run that it is compared with" for name in new]
    notes: list[str] = []
    same = 0
    for path in paths:
        other = found / "tables" / path.name
        if not other.is_file():
            problems.append(f"{path.name}: missing")
        elif path.read_bytes() == other.read_bytes():
            same += 1
        else:
            try:
                it = file_difference(path, other, allowed)
            except InputError:
                problems.append(f"{path.name}: no readable table")
                continue
            told = f"{path.name}: {it.words or 'the same numbers in other bytes'}"
            (notes if it.within and not same_machine else problems).append(told)
    single = [told for told in problems if "one keypoint" in told]
    problems = single + [told for told in problems if told not in single]
    notes += [_ONE_KEYPOINT] * bool(single)
    most = "numbers may differ by as much as is said beside each column"
    if allowed:
        most = (
            f"numbers may differ by {allowed.relative:g} of their size or by {allowed.absolute:g}"
        )
    why = "same lock and processor" if same_machine else f"another lock or processor: {most}"
    words = f"{same} of {len(paths)} the same to the last bit ({why})"
    return Check("tables", words, problems, notes)


def alike(about: About, lock: str, other: str | None = None) -> bool:
    """Whether two runs had the same software and kind of processor: then all bits are the same.

    Parameters
    ----------
    about : About
        Of the one run.
    lock : str
        SHA-256 of the lock file of the other.
    other : str, optional
        Arithmetic of the other; that of this machine by default.
    """
    return about.lock == lock and about.arithmetic == (arithmetic() if other is None else other)
