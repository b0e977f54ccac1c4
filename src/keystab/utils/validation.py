"""Arguments that are numbers or arrays, checked in one place and refused in one line."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np

from keystab.errors import InputError


def number(name: str, value: Any, least: float | None = None, above: float | None = None) -> float:
    """Return a finite number, or refuse it.

    Parameters
    ----------
    name : str
        What the number is called where it is given.
    value : object
        What was given. Text and truth values are no numbers.
    least, above : float, optional
        Smallest allowed value, or what it must exceed.

    Examples
    --------
    >>> number("epsilon", 0.5, least=0)
    0.5
    """
    good = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    good = good and math.isfinite(value)
    good = good and (least is None or value >= least) and (above is None or value > above)
    if not good:
        bound = f" of at least {least:g}" if least is not None else ""
        bound += f" above {above:g}" if above is not None else ""
        raise InputError(f"{name} is {value!r}, allowed is a number{bound}: change {name}")
    return float(value)


def limit(name: str, value: Any, least: float | None = None, above: float | None = None) -> float:
    """Return a number as `number` does, or infinity."""
    if isinstance(value, (float, np.floating)) and value == math.inf:
        return math.inf
    return number(name, value, least, above)


def boolean(name: str, value: Any) -> bool:
    """Return True or False, or refuse what is neither.

    Examples
    --------
    >>> boolean("refine", True)
    True
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name} is {value!r}, allowed are True and False: change {name}")
    return bool(value)


def count(name: str, value: Any, least: int) -> float:
    """Return a whole number, also one that is written as a float, or infinity.

    Examples
    --------
    >>> count("max_iterations", 2.0, least=1), count("max_iterations", math.inf, least=1)
    (2, inf)
    """
    given: float = math.nan
    with contextlib.suppress(InputError):
        given = limit(name, value, least)
    if given == math.inf:
        return given
    if not given.is_integer():
        raise InputError(
            f"{name} is {value!r}, allowed is a whole number of at least {least} or infinity: "
            f"change {name}"
        )
    return int(given)


def integer(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return a whole number, or refuse it.

    Examples
    --------
    >>> integer("n_spo", 3, least=1)
    3
    """
    good = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not (good and value >= least and (most is None or value <= most)):
        bound = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{name} is {value!r}, allowed is a whole number {bound}: change {name}")
    return int(value)
