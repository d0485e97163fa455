"""How sure a share is that was counted."""

import math


def interval(hits: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's interval of a share: 95 % of the time it holds the true one.

    Args:
        hits: How often it was so.
        trials: How often it was looked at.
        z: Quantile of the normal distribution; 1.96 is for 95 %.
    """
    if trials == 0:
        return 0.0, 1.0
    share, part = hits / trials, z * z / trials
    middle = (share + part / 2) / (1 + part)
    half = z / (1 + part) * math.sqrt(share * (1 - share) / trials + part / (4 * trials))
    return max(0.0, middle - half), min(1.0, middle + half)
