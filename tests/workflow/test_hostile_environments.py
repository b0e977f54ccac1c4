"""`make` gives the same bytes under twelve environments of other projects."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hostile_environments import ENVIRONMENTS, checkout, made

TARGETS = (
    "figures/quick/fig1.pdf",
    "figures/quick/fig2.png",
    "results/quick/tables/fig4_counts.csv",
)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return made(checkout(tmp_path_factory.mktemp("plain") / "copy"), {}, *TARGETS)


@pytest.mark.slow
@pytest.mark.parametrize("environment", ENVIRONMENTS, ids=lambda one: one.__name__)
def test_twelve_environments_give_the_same_bytes(environment, undisturbed, tmp_path):
    assert len(ENVIRONMENTS) == 12 and len(undisturbed) > 10
    assert made(checkout(tmp_path / "copy"), environment(tmp_path), *TARGETS) == undisturbed


@pytest.mark.slow
def test_a_link_a_blank_and_two_jobs_of_make_do_so_too(undisturbed, tmp_path):
    checkout(tmp_path / "my copy")
    (tmp_path / "link").symlink_to(tmp_path / "my copy")
    assert made(tmp_path / "link", {}, "-j2", *TARGETS) == undisturbed


@pytest.mark.slow
def test_the_whole_draft_gives_the_same_bytes_under_all_of_them_in_three_groups(tmp_path):
    def draft(folder: Path, *environments) -> dict[str, bytes]:
        (folder / "own").mkdir(parents=True)
        variables: dict[str, str] = {}
        for environment in environments:
            variables |= environment(folder / "own")
        files = made(checkout(folder / "copy"), variables, "quick")
        shutil.rmtree(folder)
        return files

    plain = draft(tmp_path / "plain")
    assert len(plain) > 300
    for first in range(3):
        assert draft(tmp_path / str(first), *ENVIRONMENTS[first::3]) == plain
