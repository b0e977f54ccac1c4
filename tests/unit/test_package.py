"""The wheel and the sdist: what they hold, and that what pip installs works outside the repository."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import flit_core.buildapi
import pandas as pd
import pytest

from keystab import __version__

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory, flit_core.buildapi.build_wheel)


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory, flit_core.buildapi.build_sdist)


def built(tmp_path_factory, build) -> Path:
    """What the build backend makes of the project; it works in the current folder."""
    folder = tmp_path_factory.mktemp("dist")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return folder / build(str(folder))


def test_the_wheel_has_the_library_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    library = {name for name in names if name.startswith("keystab/")}
    info = f"keystab-{__version__}.dist-info/"
    assert library == {
        path.relative_to(ROOT / "src").as_posix()
        for path in (ROOT / "src/keystab").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {"keystab/py.typed", "keystab/__init__.pyi"} <= library
    assert all(name.startswith(info) for name in names - library)
    assert {f"{info}entry_points.txt", f"{info}licenses/LICENSE"} <= names


def test_extras_are_declared(wheel):
    metadata = zipfile.ZipFile(wheel).read(f"keystab-{__version__}.dist-info/METADATA").decode()
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    for extra in ("study", "audit", "dev"):
        assert f"Provides-Extra: {extra}\n" in metadata and extras[extra]


@pytest.mark.slow
def test_the_sdist_has_all_that_git_has(sdist):
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("no git, or no clone")
    with tarfile.open(sdist) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    assert set(listed.stdout.splitlines()) <= names
    assert not [name for name in names if "__pycache__" in name]


@pytest.mark.slow
def test_the_wheel_of_the_sdist_is_that_of_the_repository(sdist, wheel, tmp_path, monkeypatch):
    with tarfile.open(sdist) as packed:
        packed.extractall(tmp_path, filter="data")
    monkeypatch.chdir(tmp_path / f"keystab-{__version__}")
    again = tmp_path / flit_core.buildapi.build_wheel(str(tmp_path))
    first, second = (zipfile.ZipFile(path) for path in (wheel, again))
    assert {it.filename: it.CRC for it in first.infolist()} == {
        it.filename: it.CRC for it in second.infolist()
    }


# Outside the repository, with the packages of this environment but not with its keystab

DETECTOR = """
import numpy as np
import keystab

def mine(image, blur):
    return keystab.detect_keypoints(image, camera_blur=blur, n_spo=3)
"""


class Installed:
    """A folder in which pip has installed the wheel, and another one to work in."""

    def __init__(self, wheel: Path, folder: Path) -> None:
        self.packages, self.work = folder / "packages", folder / "work"
        self.work.mkdir(parents=True)
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "install"]
        more = ["--no-deps", "--no-index", "--target", str(self.packages), str(wheel)]
        subprocess.run([*pip, *more], check=True)

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command in a folder that knows nothing of the repository."""
        kept = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTHON", "NUMBA", "PYTEST", "KEYSTAB"))
        }
        env = {**kept, "PYTHONPATH": str(self.packages), "HOME": str(self.work)}
        return subprocess.run(
            command, cwd=self.work, env=env, capture_output=True, text=True, timeout=900
        )

    def keystab(self, line: str) -> subprocess.CompletedProcess[str]:
        """Run the command that pip has made."""
        return self.run(sys.executable, str(self.packages / "bin/keystab"), *line.split())


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    made = Installed(wheel, tmp_path_factory.mktemp("elsewhere"))
    scene = made.keystab("scene fractal --shape 120 160 -o field.png")
    assert scene.returncode == 0, scene.stderr
    return made


@pytest.mark.slow
def test_the_library_answers_elsewhere(installed):
    code = (
        "import keystab; print(keystab.__file__); scene = keystab.read_picture('field.png'); "
        "print(len(keystab.detect_keypoints(scene, 0.8)))"
    )
    done = installed.run(sys.executable, "-P", "-c", code)
    assert done.returncode == 0, done.stderr
    place, n_found = done.stdout.split()
    assert Path(place).is_relative_to(installed.packages) and int(n_found) > 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "made"),
    [
        ("--help", ""),
        ("inspect --environment", ""),
        ("inspect field.png", ""),
        ("completion bash", ""),
        ("detect field.png --camera-blur 0.8 -o found.csv", "found.csv"),
        ("truth field.png --camera-blur 0.8 -o true.parquet", "true.parquet"),
        ("uncertainty field.png --camera-blur 0.8 --n-oct 1 -o bars.csv --draw bars.png", "bars.png"),
        ("simulate field.png seen.tiff --blur 0.8 --step 2", "seen.tiff"),
    ],
)  # fmt: skip
def test_commands_work_elsewhere(installed, line, made):
    done = installed.keystab(line)
    assert done.returncode == 0, done.stderr
    assert (installed.work / made).stat().st_size > 1000 if made else len(done.stdout) > 100


@pytest.mark.slow
def test_a_function_is_audited_elsewhere(installed):
    (installed.work / "my_module.py").write_text(DETECTOR)
    done = installed.keystab("audit my_module:mine --quick -o audit")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(installed.work / "audit/audit.csv")
    mine = table[(table["detector"] == "my_module:mine") & (table["condition"] == "blobs")]
    assert len(mine) == 1
    assert mine["bias_y"].abs().max() < 0.05 and (installed.work / "audit/audit.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "line", ["whence fig.pdf", "archive", "reference", "verify", "verify a.zip"]
)
def test_what_needs_the_repository_says_so_in_one_line(installed, line):
    done = installed.keystab(line)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert "lies in no copy of the project; go to the project's folder" in done.stderr
