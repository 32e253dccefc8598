#!/usr/bin/env python3
"""F1 to F6 of Li, Xing and Qin (2025) at a few points, from the usual definitions (plain Python). Prints the table that
tests/benchmarks.rs holds."""
from math import cos, e, exp, pi, prod, sin, sqrt


def u(x, a, k, m):
    return k * (x - a) ** m if x > a else k * (-x - a) ** m if x < -a else 0.0


def f1(x):
    return sum(100 * (x[i + 1] - x[i] ** 2) ** 2 + (x[i] - 1) ** 2 for i in range(len(x) - 1))


def f2(x):
    return sum((v + 0.5) ** 2 for v in x)


def f3(x):
    n = len(x)
    return (-20 * exp(-0.2 * sqrt(sum(v * v for v in x) / n)) - exp(sum(cos(2 * pi * v) for v in x) / n) + 20 + e)


def f4(x):
    return sum(-v * sin(sqrt(abs(v))) for v in x)


def f5(x):
    wave = sin(3 * pi * x[0]) ** 2
    wave += sum((x[i] - 1) ** 2 * (1 + sin(3 * pi * x[i + 1]) ** 2) for i in range(len(x) - 1))
    wave += (x[-1] - 1) ** 2 * (1 + sin(2 * pi * x[-1]) ** 2)
    return 0.1 * wave + sum(u(v, 5, 100, 4) for v in x)


def f6(x):
    return sum(v * v for v in x) / 4000 - prod(cos(v / sqrt(i)) for i, v in enumerate(x, 1)) + 1


for f in (f1, f2, f3, f4, f5, f6):
    print(f.__name__.upper(), [f"{f(x):.15g}" for x in ([1.5, -2.25, 0.75], [-7.5, 6.125, 12.0], [0.4], [20.0, -1.0])])
