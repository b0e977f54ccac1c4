"""Arrays of which a part is masked, which numpy would take for whole."""

from __future__ import annotations

from typing import Any

import numpy as np

from keystab.errors import InputError


def unmasked(name: str, array: Any) -> Any:
    """Return what was given, unless it is an array of which a part is masked.

    ``numpy.asarray`` drops a mask, so that what lies under it would count as seen.

    Examples
    --------
    >>> unmasked("image", [[0.5]])
    [[0.5]]
    """
    is_masked = isinstance(array, np.ma.MaskedArray)
    n_masked = int(np.ma.getmaskarray(array).sum()) if is_masked else 0
    if n_masked:
        raise InputError(
            f"{name} has {n_masked} masked value{'s' * (n_masked > 1)}, of which nothing is known: "
            f"give a plain array, such as {name.split()[-1]}.filled(0.5)"
        )
    return array
