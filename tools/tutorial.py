"""Run the tutorial, docs/start/tutorial.md, from its first block of code to its last.

python tools/tutorial.py           write what the blocks print, and the pictures that they draw
python tools/tutorial.py --check   say whether the page shows what they print

Blocks of `sh` run in a shell, those of `python` in one interpreter, all in a new folder in which
`photo.png` is the photograph. A block without a name below one is what it prints.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/start/tutorial.md"
PHOTOGRAPH = ROOT / "config/images/stream.png"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"\]\((tutorial_\w+\.png)\)")


def executed(text: str) -> str:
    r"""Text of a page with what its blocks print, run in the folder where we are.

    Examples
    --------
    >>> print(executed("```python\nprint(1 + 1)\n```\n"))
    ```python
    print(1 + 1)
    ```
    <BLANKLINE>
    ```
    2
    ```
    <BLANKLINE>
    """
    names: dict[str, Any] = {}

    def run(block: re.Match[str]) -> str:
        language, code, _ = block.groups()
        printed = in_shell(code) if language == "sh" else in_python(code, names)
        shown = f"\n```\n{printed}```\n" if printed else ""
        return f"```{language}\n{code}```\n{shown}"

    return BLOCK.sub(run, text)


def in_shell(code: str) -> str:
    """What some lines of shell print; ends with an error where one of them fails."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    run = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", code],
        env={**os.environ, "PATH": path},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if run.returncode:
        sys.exit(f"error: {PAGE.name}: exit status {run.returncode} of: {code}")
    return run.stdout


def in_python(code: str, names: dict[str, Any]) -> str:
    """What some lines of Python print; `names` are those that stay from block to block."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, PAGE.name, "exec"), names)
    return printed.getvalue()


def main() -> int:
    """Write or check the page."""
    text = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        shutil.copy(PHOTOGRAPH, "photo.png")
        new = executed(text)
        for name in PICTURE.findall(text):
            if not Path(name).is_file():
                sys.exit(f"error: {PAGE.name}: nothing draws {name}")
            if "--check" not in sys.argv:
                shutil.copy(name, PAGE.parent / name)
    if "--check" not in sys.argv:
        PAGE.write_text(new, encoding="utf-8")
    elif new != text:
        old, other = text.splitlines(), new.splitlines()
        shown, printed = next((a, b) for a, b in zip(old, other, strict=False) if a != b)
        print(f"{PAGE.name}: shown is {shown!r}, printed was {printed!r}", file=sys.stderr)
        print("python tools/tutorial.py writes it anew", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
