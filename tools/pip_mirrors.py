"""Say for a shell what of a person's pip.conf the set-up takes: where packages are fetched from.

python -m pip config list | python tools/pip_mirrors.py

Mirrors, proxies and certificates are taken: what they give must have the hashes of the lock. What
says which packages are installed, or where to, is for other projects.
"""

from __future__ import annotations

import ast
import os
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping

TAKEN = {
    *("index-url", "extra-index-url", "no-index", "find-links", "trusted-host", "cert"),
    *("client-cert", "proxy", "cache-dir", "no-cache-dir", "timeout", "default-timeout", "retries"),
}


def exports(lines: Iterable[str], variables: Mapping[str, str]) -> Iterator[str]:
    """Lines of a shell that set what pip.conf says and no variable does.

    Examples
    --------
    >>> said = ["global.timeout='7'", "install.target='/opt'", "install.timeout='9'"]
    >>> list(exports(said, {}))
    ['export PIP_TIMEOUT=9']
    """
    found: dict[str, str] = {}
    for line in lines:
        name, _, value = line.strip().partition("=")
        section, _, key = name.rpartition(".")
        if section in ("global", "install") and key in TAKEN:  # in this order pip lists them
            try:
                found[f"PIP_{key.replace('-', '_').upper()}"] = str(ast.literal_eval(value))
            except (SyntaxError, ValueError):
                continue
    for name, value in found.items():
        if name not in variables:
            yield f"export {name}={shlex.quote(' '.join(value.split()))}"


if __name__ == "__main__":
    print("\n".join(exports(sys.stdin, os.environ)))
