#!/usr/bin/env python3
"""Degree-seven interpolation by scipy's make_interp_spline (scipy is needed). Prints what tests/papers_spline.rs holds:
values and derivatives 0 to 4 at some times, and the root mean square of the jerk."""
import numpy as np
from scipy.integrate import quad
from scipy.interpolate import make_interp_spline

POINTS, TIMES = [0.3, -1.2, 0.8, 0.75, 2.1, -0.4], [0.9, 1.7, 0.4, 2.2, 1.1]
t = np.concatenate([[0.0], np.cumsum(TIMES)])
knots = np.concatenate([[0.0] * 7, t, [t[-1]] * 7])
rest = [(1, 0.0), (2, 0.0), (3, 0.0)]
curve = make_interp_spline(t, POINTS, k=7, t=knots, bc_type=(rest, rest))
for at in (0.0, 0.31, 0.9, 2.05, 2.6, 4.4, 6.3):
    print(at, [f"{curve.derivative(i)(at) if i else curve(at):.12g}" for i in range(5)])
jerk = curve.derivative(3)
print(f"{np.sqrt(sum(quad(lambda x: jerk(x)**2, a, b, epsabs=1e-13, epsrel=1e-13)[0] for a, b in zip(t, t[1:])) / t[-1]):.12g}")
