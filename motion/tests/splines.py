#!/usr/bin/env python3
"""Prints the table NOT_A_KNOT of src/spline.rs (needs `pip install scipy`): scipy's cubic spline with its default ends,
value and three derivatives at some times, for 2, 3, 4, 5 and 6 knots."""
from scipy.interpolate import CubicSpline

KNOTS = [
    [(0.0, 0.3), (0.8, -0.4)],
    [(0.0, 0.0), (0.4, 0.7), (1.0, 1.0)],
    [(0.0, 1.0), (0.5, -1.0), (1.7, 2.0), (2.0, 0.0)],
    [(0.0, 0.0), (100.0, 300.0), (200.0, 200.0), (300.0, -300.0), (400.0, -700.0)],
    [(-1.0, 0.3), (-0.1, -1.2), (1.6, 0.8), (2.0, 0.75), (4.2, 2.1), (5.3, -0.4)],
]
for knots in KNOTS:
    spline = CubicSpline(*zip(*knots))
    first, last = knots[0][0], knots[-1][0]
    print(f"(&{knots}, &[")
    # No time is a knot but the first: the third derivative jumps there.
    for share in (0.0, 0.17, 0.45, 0.83, 0.99):
        at = first + share * (last - first)
        print(f"    ({at!r}, {', '.join(format(float(spline(at, i)), '.15g') for i in range(4))}),")
    print("]),")
