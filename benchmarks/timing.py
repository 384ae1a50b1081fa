"""Rows of the table: results first, then times as ratios."""

import statistics
import time


def timed(function):
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def ratio_row(name, bar, fast, slow, difference, tolerance, repeats=5, inner=5, scale=1.0):
    """Print one row: difference of the results against its tolerance, times and how many times faster.

    The slow side may do a part of the work; its time is then scaled.
    """
    if not difference <= tolerance:
        print(f"{name:62s} FAIL: results differ by {difference:.2g}, permitted {tolerance:.2g}")
        return False
    pairs = [(timed(lambda: [fast() for _ in range(inner)]) / inner, scale * timed(slow)) for _ in range(repeats)]
    ratio = statistics.median(b / a for a, b in pairs)
    quick, long = (statistics.median(column) for column in zip(*pairs, strict=True))
    met = "met" if ratio >= bar else "MISSED"
    print(
        f"{name:62s} {1e3 * quick:8.2f} ms {1e3 * long:9.1f} ms  {ratio:6.3g} times, bar {bar}: {met} "
        f"(results differ by {difference:.1g})"
    )
    return ratio >= bar
