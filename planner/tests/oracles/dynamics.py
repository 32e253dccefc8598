#!/usr/bin/env python3
"""Torques and energies of a UR5 by Lagrange's equations (plain Python, no recursion from link to link). Prints what
tests/dynamics.txt holds: python3 planner/tests/oracles/dynamics.py > planner/tests/oracles/dynamics.txt

Kinetic energy comes from Jacobians of the centres of mass, potential energy from their heights; every derivative is a
complex step, exact to rounding. Masses and centres are the manufacturer's; the moments are made up, so that they count.
Each line: gravity, 6 angles, 6 speeds, 6 accelerations, then 6 torques, kinetic and potential energy."""
import cmath
import random

PI = cmath.pi
ROWS = [(0.0, PI / 2, 0.089159), (-0.425, 0.0, 0.0), (-0.39225, 0.0, 0.0), (0.0, PI / 2, 0.10915),
        (0.0, -PI / 2, 0.09465), (0.0, 0.0, 0.0823)]
MASS = [3.7, 8.393, 2.33, 1.219, 1.219, 0.1879]
CENTER = [(0.0, -0.02561, 0.00193), (0.2125, 0.0, 0.11336), (0.15, 0.0, 0.0265), (0.0, -0.0018, 0.01634),
          (0.0, 0.0018, 0.01634), (0.0, 0.0, -0.001159)]
# xx, yy, zz, xy, xz, yz
MOMENTS = [(0.02, 0.018, 0.011, 0.001, -0.002, 0.0015), (0.03, 0.25, 0.24, 0.0, 0.01, 0.0),
           (0.01, 0.06, 0.058, 0.002, 0.0, -0.003), (0.002, 0.0022, 0.0018, 0.0, 0.0, 0.0002),
           (0.002, 0.0022, 0.0018, 0.0001, 0.0, -0.0002), (0.0001, 0.0001, 0.00015, 0.0, 0.0, 0.0)]
STEP = 1e-30


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def frames(q):
    turn, at = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0]
    result = [(turn, at)]
    for angle, (a, alpha, d) in zip(q, ROWS):
        ct, st, ca, sa = cmath.cos(angle), cmath.sin(angle), cmath.cos(alpha), cmath.sin(alpha)
        step = [[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0, sa, ca]]
        way = [a * ct, a * st, d]
        at = [at[i] + dot(turn[i], way) for i in range(3)]
        turn = [[sum(turn[i][k] * step[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
        result.append((turn, at))
    return result


def centers(q):
    result = []
    for (turn, at), center in zip(frames(q)[1:], CENTER):
        result.append([at[i] + dot(turn[i], center) for i in range(3)])
    return result


def mass_matrix(q):
    poses, points = frames(q), centers(q)
    axes = [[turn[i][2] for i in range(3)] for turn, _ in poses[:6]]
    matrix = [[0j] * 6 for _ in range(6)]
    for link in range(6):
        turn, _ = poses[link + 1]
        xx, yy, zz, xy, xz, yz = MOMENTS[link]
        body = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        linear = [cross(axes[j], [points[link][i] - poses[j][1][i] for i in range(3)]) for j in range(link + 1)]
        # The axes as the link sees them.
        own = [[sum(turn[k][i] * axes[j][k] for k in range(3)) for i in range(3)] for j in range(link + 1)]
        for r in range(link + 1):
            for c in range(link + 1):
                spun = [dot(body[i], own[c]) for i in range(3)]
                matrix[r][c] += MASS[link] * dot(linear[r], linear[c]) + dot(own[r], spun)
    return matrix


def potential(q, gravity):
    return -sum(m * dot(gravity, c) for m, c in zip(MASS, centers(q)))


def kinetic(q, v):
    matrix = mass_matrix(q)
    return 0.5 * sum(matrix[r][c] * v[r] * v[c] for r in range(6) for c in range(6))


def stepped(q, j):
    return [x + (1j * STEP if i == j else 0) for i, x in enumerate(q)]


def torques(q, v, a, gravity):
    matrix = mass_matrix(q)
    # How the matrix changes along the motion: a complex step along the speeds.
    along = mass_matrix([x + 1j * STEP * y for x, y in zip(q, v)])
    result = []
    for j in range(6):
        inertial = sum(matrix[j][c].real * a[c] + along[j][c].imag / STEP * v[c] for c in range(6))
        result.append(inertial - kinetic(stepped(q, j), v).imag / STEP + potential(stepped(q, j), gravity).imag / STEP)
    return result


draw = random.Random(4)
for case in range(12):
    gravity = (0.0, 0.0, -9.80665) if case % 3 else (5.0, -7.0, -3.0)
    q, v, a = ([draw.uniform(-s, s) for _ in range(6)] for s in (3.0, 3.0, 15.0))
    values = [*gravity, *q, *v, *a, *torques(q, v, a, gravity), kinetic(q, v).real, potential(q, gravity).real]
    print(" ".join(repr(float(x)) for x in values))
