"""The examples in the documentation of the code give what they say."""

import doctest
import importlib
from pathlib import Path

import pytest

import keystab

PACKAGE = Path(keystab.__file__).parent
MODULES = sorted(
    ".".join(("keystab", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    )
    for path in PACKAGE.rglob("*.py")
    if ">>> " in path.read_text()
)


# Imported one by one as each test runs, not by every worker as it collects them.
@pytest.mark.parametrize("name", MODULES)
def test_examples(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what an example writes is not left behind
    failed, tried = doctest.testmod(
        importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE
    )
    assert failed == 0 and tried > 0
