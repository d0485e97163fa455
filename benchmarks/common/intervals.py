"""Figures with their 95 % intervals: shares by Wilson's score, quantiles by the order of the sample."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, norm


@dataclass(frozen=True)
class Figure:
    """A figure, its 95 % interval, and from how many it is; None where there is nothing to say."""

    value: float | None
    low: float | None
    high: float | None
    n: int


def share(hits: int, n: int) -> Figure:
    """Hits among n, with Wilson's interval."""
    if n == 0:
        return Figure(None, None, None, 0)
    z = float(norm.ppf(0.975))
    p = hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * float(np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)))
    return Figure(p, max(0.0, middle - half), min(1.0, middle + half), n)


def quantile(values: list[float], level: float) -> Figure:
    """A quantile of a sample; its interval lies between two members of the sample."""
    n = len(values)
    if n == 0:
        return Figure(None, None, None, 0)
    ordered = np.sort(values)
    low, high = int(binom.ppf(0.025, n, level)) - 1, int(binom.ppf(0.975, n, level))
    return Figure(
        float(np.quantile(ordered, level)),
        float(ordered[max(low, 0)]),
        float(ordered[min(high, n - 1)]),
        n,
    )
