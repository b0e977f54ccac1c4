"""An honest run of another processor is within what is said beside each column of the tables.

Three kinds of processors are asked for of the libraries; what numba compiles is for the one here.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from hostile_environments import checkout, made

from keystab.provenance.table_differences import file_difference

NAMES = (
    *("fig1", "figS3", "figS4", "fig3", "fig5_features", "fig7_precision", "fig9_keypoints"),
    *("truth_samplings", "predictors_auc", "uncertainty_coverage", "uncertainty_reliability"),
)
TABLES = [f"results/quick/tables/{name}.csv" for name in NAMES]
NO_AVX512 = "X86_V4 AVX512_ICL AVX512_SPR"
NO_AVX = f"X86_V3 {NO_AVX512}"
OLD_LIBC = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = checkout(tmp_path_factory.mktemp("here") / "copy")
    made(folder, {}, *TABLES)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blas", "disabled", "more"),
    [
        ("Haswell", NO_AVX512, {}),
        ("Sandybridge", "AVX512_SPR", {}),
        ("Nehalem", NO_AVX, {"GLIBC_TUNABLES": OLD_LIBC}),
        ("Prescott", "AVX512_ICL AVX512_SPR", {}),
    ],
)
def test_other_processors_give_the_same_numbers_but_for_rounding(
    blas, disabled, more, here, tmp_path
):
    variables = {"OPENBLAS_CORETYPE": blas, "NPY_DISABLE_CPU_FEATURES": disabled, **more}
    folder = checkout(tmp_path / "copy")
    made(folder, variables, *TABLES)
    told = {name: file_difference(here / name, folder / name) for name in TABLES}
    assert {name: it.words for name, it in told.items() if not it.within} == {}
    if blas == "Nehalem":
        assert any(it.words for it in told.values()), "the libraries took no notice"
