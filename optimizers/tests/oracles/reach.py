#!/usr/bin/env python3
"""The arm of Lv et al. (2019) by its Denavit-Hartenberg matrices, and its reward, in the paper's millimetres (plain
Python). Prints what tests/papers_reach.rs holds."""
from math import cos, exp, pi, sin, sqrt

DH = [(10, -pi / 2, 0), (104, 0, 0), (96, 0, 0), (27, pi / 2, 0), (0, 0, 137)]
OFFSET = [0.0, -pi / 2, 0.0, pi / 2, 0.0]
TARGET = (151.171, 191.62, 172.124)


def tip(q):
    m = [[float(i == j) for j in range(4)] for i in range(4)]
    for angle, off, (a, alpha, d) in zip(list(q) + [0.0], OFFSET, DH):
        c, s, ca, sa = cos(angle + off), sin(angle + off), cos(alpha), sin(alpha)
        t = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        m = [[sum(m[i][k] * t[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
    return m[0][3], m[1][3], m[2][3]


def reward(e, eps=0.005, s=0.5e-6, k=10000.0, j=3.0, e_max=674.0):
    if e > eps:
        return k * exp(-5.0 * (max(-(e - eps) / (e_max - eps), -1.0) + 1.0) ** 2)
    return -j * (-4.0 / (eps - s) * e + 0.02 / (eps - s)) if e > s else -j * (-4.0 / s * e + 8.0)


# The upright pose, table 5's rows (GA, DE, PSO, SPSO, IEPSO with the sign of its fourth angle corrected), the optimum.
for q in ((0, 0, 0, 0), (0.9, 0.92, 0.84, -1.54), (0.9, 0.09, 1.13, -0.09), (-2.24, -1.31, 1.06, -1.11),
          (0.89, 0.12, 1.47, -0.67), (0.9, 1.49, -0.23, -1.17), (0.903, 0.129, 0.903, 0.202), (-1.1, 0.4, -2.0, 1.3)):
    p = tip(q)
    e = sqrt(sum((a - b) ** 2 for a, b in zip(p, TARGET)))
    print(q, [f"{v:.12g}" for v in p], f"{e:.12g}", f"{max(map(abs, q)) / 0.2 + reward(e):.12g}")
print([f"{reward(e):.12g}" for e in (1e9, 674.0, 100.0, 1.0, 0.0050001, 0.005, 0.001, 1e-6, 0.5e-6, 1e-7, 0.0)])
