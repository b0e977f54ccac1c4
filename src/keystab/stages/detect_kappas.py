"""Detect the extrema of one view in scale-spaces with different DoG ratios (figure 9)."""

from pathlib import Path
from typing import Literal

from keystab.parameters import RefinementPath
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    n_spo: int,
    kappas: list[float],
    sigma_min: float,
    oversampling: Literal["spline", "cosine"],
    epsilon: float,
    path: RefinementPath,
    *,
    extrema: Path,
    traces: Path,
) -> None:
    """Read the view; write extrema and traces of every kappa, each at its balanced sampling."""
    from keystab.detection.view_detector import Detector, detect_in_view, joined
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.utils.progress import progress

    view = read_view(*views)
    options = {"oversampling": oversampling, "epsilon": epsilon, **vars(path)}
    found = []
    for kappa in progress(kappas, len(kappas), "kappas"):
        detector = Detector(view.blur, n_spo, sigma_min=sigma_min, kappa=kappa, **options)
        found.append(detect_in_view(view.image, detector))
    table, models = joined("kappa", kappas, found)
    write_table(table, extrema)
    write_table(models, traces)
    print(f"{len(table)} extrema for {len(kappas)} ratios")
