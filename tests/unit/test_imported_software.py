"""What is imported is compared with the lock, not what the lock says with itself."""

from __future__ import annotations

import ast
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from keystab.provenance.imported_software import MODULES, software_digest, software_problems

ROOT = Path(__file__).parents[2]
SAYS = """
import sys
from pathlib import Path
from keystab.provenance.imported_software import software_digest, software_problems
lock = Path(sys.argv[1])
print(software_digest(lock), *software_problems(lock), sep="\\n")
"""


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    """A lock of this very environment."""
    from importlib.metadata import version

    path = tmp_path / "environment.lock"
    path.write_text(
        "".join(f"{name}=={version(name)} \\\n    --hash=sha256:0\n" for name in MODULES)
    )
    return path


def said(lock: Path, folder: Path, **variables: str) -> list[str]:
    """Digest and problems that a Python with foreign packages tells."""
    paths = os.pathsep.join([str(folder), str(ROOT / "src")])
    env = {**os.environ, "PYTHONPATH": paths, **variables}
    command = [sys.executable, "-c", SAYS, str(lock)]
    return subprocess.run(
        command, env=env, check=True, capture_output=True, text=True
    ).stdout.splitlines()


def test_what_the_lock_says_is_the_digest_of_the_lock(lock):
    assert software_problems(lock) == []
    assert software_digest(lock) == hashlib.sha256(lock.read_bytes()).hexdigest()


def test_another_version_is_named(lock):
    lock.write_text(lock.read_text().replace("numpy==", "numpy==9."))
    (line,) = software_problems(lock)
    assert line.startswith("numpy ") and "environment.lock says 9." in line


@pytest.mark.parametrize("with_metadata", [False, True])
def test_foreign_packages_before_the_locked_ones_are_named(lock, tmp_path, with_metadata):
    foreign = tmp_path / "cluster"
    (foreign / "matplotlib").mkdir(parents=True)
    (foreign / "matplotlib/__init__.py").write_text("__version__ = '0.1'\n")
    if with_metadata:
        (foreign / "matplotlib-0.1.dist-info").mkdir()
        (foreign / "matplotlib-0.1.dist-info/METADATA").write_text(
            "Metadata-Version: 2.1\nName: matplotlib\nVersion: 0.1\n"
        )
    digest, line = said(lock, foreign)
    assert digest != hashlib.sha256(lock.read_bytes()).hexdigest()
    assert line.startswith("matplotlib ") and str(foreign) in line
    assert ("0.1 is imported" in line) == with_metadata


def test_every_package_that_the_library_imports_is_compared():
    own = {*sys.stdlib_module_names, "keystab", "mpl_toolkits"}
    found = set()
    # Libraries of other detectors run in processes of their own, and have a lock of their own; of
    # OpenCV no more is asked here than its class of keypoints, by whoever has it.
    worker = ROOT / "src/keystab/audit/worker.py"
    for path in {*(ROOT / "src/keystab").rglob("*.py")} - {worker}:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add((node.module or "").partition(".")[0])
    assert found - own - {"cv2"} <= set(MODULES.values())


def test_the_lock_of_the_project_names_every_package():
    text = (ROOT / "environment.lock").read_text()
    assert [name for name in MODULES if f"\n{name}==" not in f"\n{text}"] == []
