#!/usr/bin/env python3
"""Writes tests/peak_constants.csv: peaks of the tau profiles to 40 digits (needs `pip install mpmath`).

Nothing here is shared with the Rust code: derivatives come from power series arithmetic (Miller's recurrence for
the power of a series), peaks from bracketing the sign changes of the next derivative on a grid and refining them
with 60 digits. Run it from any folder; the table is checked in, so that the tests need no Python.
"""
import math
import pathlib

import mpmath as mp

mp.mp.dps = 60
DIGITS = 40
GRID = 4000


def derivatives(m, n, s, order):
    """phi and its derivatives by s, up to `order`, for phi = 1 - (1 - s^m)^n."""
    f = [-math.comb(m, i) * s ** max(m - i, 0) for i in range(order + 1)]
    f[0] += 1
    g = [f[0] ** n]
    for k in range(1, order + 1):
        g.append(sum((n * i - k + i) * f[i] * g[k - i] for i in range(1, k + 1)) / (k * f[0]))
    g = [-c for c in g]
    g[0] += 1
    return [c * math.factorial(i) for i, c in enumerate(g)]


def extrema(m, n, order):
    """Values of the derivative of this order where it is stationary inside (0, 1), and at s = 0."""
    value = lambda s, j: derivatives(m, n, s, j)[j]
    points = [i / GRID for i in range(1, GRID)]
    slopes = [derivatives(m, float(n), s, order + 1)[order + 1] for s in points]
    found = [value(mp.mpf(0), order)]
    for a, b, fa, fb in zip(points, points[1:], slopes, slopes[1:]):
        if fa * fb < 0:
            root = mp.findroot(lambda s: value(s, order + 1), (mp.mpf(a), mp.mpf(b)), solver="anderson", tol=mp.mpf(10) ** -100, verify=False)
            assert a <= root <= b
            found.append(value(root, order))
    return found


def row(m, n):
    v, a, j = (extrema(m, n, order) for order in (1, 2, 3))
    return [max(v), max(map(abs, a)), max(map(abs, j)), max(a), -min(a)]


def main():
    lines = ["m,k_or_n,c_v,c_a,c_j,c_a_positive,c_a_negative"]
    rows = [(4, str(n), mp.mpf(n)) for n in range(4, 65)]
    for m in (3, 4):
        rows += [(m, k, 1 / mp.mpf(k)) for k in ("0.01", "0.05", "0.10", "0.16", "0.20", "0.25", "0.30", "0.33")]
    for m, name, n in rows:
        lines.append(",".join([str(m), name] + [mp.nstr(x, DIGITS, strip_zeros=False) for x in row(m, n)]))
        print(lines[-1], flush=True)
    pathlib.Path(__file__).with_suffix(".csv").write_text("\n".join(lines) + "\n")


main()
