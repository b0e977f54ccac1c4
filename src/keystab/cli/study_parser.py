"""Arguments of the commands that are about the study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from keystab.cli.known_parser import Parser
from keystab.cli.study import archive, reference, verify, whence

__all__ = ["add_study_commands"]


def add_study_commands(add_parser: Callable[..., Parser]) -> None:
    """Add the commands that are about the study; they are given in the project's folder."""
    to = add_parser(
        "whence",
        help="say where a figure of the study comes from",
        description="Say what drew a figure, from which tables, what these were made from, and how "
        "to make it again; and whether files and code are still the same here.",
    )
    to.add_argument("figure", metavar="FIGURE", type=Path, help="figure of the study, PDF or PNG")
    to.set_defaults(run=whence)
    to = add_parser(
        "archive",
        help="pack a finished run of the study into one file",
        description="Write {results}/archive/keystab-VERSION.zip: figures, tables, verdicts, code, "
        "settings, environment.lock, Snakemake's records, costs and an RO-Crate.",
    )
    _configfile_argument(to)
    to.set_defaults(run=archive)
    to = add_parser(
        "reference",
        help="copy the small results of a finished run to results/reference",
        description="Copy tables, verdicts and PNG figures, with their digests and what they were "
        "made by, to results/reference, to be committed.",
    )
    _configfile_argument(to)
    to.set_defaults(run=reference)
    to = add_parser(
        "verify",
        help="check an archive of the study, or the results that are here",
        description="Check an archive against the code, settings and lock file here, without "
        "computing anything; without an archive, the results that are here, and compare them with "
        "results/reference. With --recompute, compute figures again and compare all numbers.",
    )
    to.add_argument("archive", metavar="ARCHIVE", type=Path, nargs="?", help="zip file to check")
    _configfile_argument(to)
    to.add_argument(
        "--recompute", nargs="+", metavar="FIGURE",
        help="figures to compute again, such as fig5, or all; needs the time and disk of the study",
    )  # fmt: skip
    to.add_argument("--cores", type=int, default=1, metavar="N", help="jobs at a time (default 1)")
    for name, what in (("rtol", "relative"), ("atol", "absolute")):
        to.add_argument(
            f"--{name}", type=float, metavar="T",
            help=f"{what} tolerance for all recomputed numbers where software or processor differ, "
            "instead of that of each column; where both are the same, every bit counts",
        )  # fmt: skip
    to.set_defaults(run=verify)


def _configfile_argument(to: Parser) -> None:
    to.add_argument(
        "--configfile", nargs="+", default=[], metavar="FILE",
        help="settings of the run, laid over config/config.yaml as for snakemake",
    )  # fmt: skip
