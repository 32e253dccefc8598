#!/usr/bin/env python3
"""The paper's cost of two motions of a UR5, written independently of the Rust code (plain Python, no packages).

Prints the table that tests/paper_cost.rs holds. Source: Wang et al. (2022), corrected reading: least distance over the
links, 120 equal time steps a stroke plus the end.
"""
from math import cos, sin, pi, sqrt, fsum

DH = [(0.0, pi / 2, 0.089159), (-0.425, 0.0, 0.0), (-0.39225, 0.0, 0.0),
      (0.0, pi / 2, 0.10915), (0.0, -pi / 2, 0.09465), (0.0, 0.0, 0.0823)]
SPHERES = [((-0.5, 0.2, 0.3), 0.18), ((0.4, 0.4, 0.5), 0.18), ((0.1, -0.6, 0.2), 0.18)]
EXPANSION, WEIGHTS, STEPS = 0.1, (7.0, 300.0, 1.2e7), 120


def origins(q):
    m = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
    out = [(0.0, 0.0, 0.0)]
    for angle, (a, alpha, d) in zip(q, DH):
        ct, st, ca, sa = cos(angle), sin(angle), cos(alpha), sin(alpha)
        t = [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]]
        m = [[sum(m[i][k] * t[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
        out.append((m[0][3], m[1][3], m[2][3]))
    return out


def distance(p, a, b):
    ab = [y - x for x, y in zip(a, b)]
    ap = [y - x for x, y in zip(a, p)]
    n = sum(x * x for x in ab)
    t = min(1.0, max(0.0, sum(x * y for x, y in zip(ab, ap)) / n)) if n > 0 else 0.0
    return sqrt(sum((x - t * y) ** 2 for x, y in zip(ap, ab)))


def cost(points, n):
    poses = []
    for a, b in zip(points, points[1:]):
        for k in range(STEPS):
            phi = 1.0 - (1.0 - (k / STEPS) ** 4) ** n
            poses.append([x + (y - x) * phi for x, y in zip(a, b)])
    poses.append(points[-1])
    tips, length, travel, penalties, collision = [], [], [], [], False
    for q in poses:
        o = origins(q)
        tips.append(o[-1])
        for centre, radius in SPHERES:
            reach = radius + EXPANSION
            d = min(distance(centre, a, b) for a, b in zip(o, o[1:]))
            collision = collision or d < reach
            penalties.append(max(1.0 - d / reach, 0.0))
    for a, b in zip(tips, tips[1:]):
        length.append(sqrt(sum((x - y) ** 2 for x, y in zip(a, b))))
    for a, b in zip(poses, poses[1:]):
        travel.extend(abs(x - y) for x, y in zip(a, b))
    length, travel, penalty = fsum(length), fsum(travel), fsum(penalties)
    total = WEIGHTS[0] * length + WEIGHTS[1] * travel + (WEIGHTS[2] * penalty if collision else 0.0)
    return len(poses), length, travel, penalty, collision, total


FREE = [(0.0, -1.5, 1.0, -1.0, -1.5, 0.0), (0.2, -1.7, 0.8, -1.2, -1.3, 0.3), (-0.1, -1.6, 0.9, -1.0, -1.0, 0.1),
        (0.1, -1.8, 0.6, -0.9, -1.2, -0.4), (0.0, -1.9, 0.4, -0.8, -1.5, 0.2)]
HIT = [(0.5, -1.2, 1.0, -1.0, -1.5, 0.0), (-0.5, -0.8, 1.2, -1.2, -1.3, 0.3), (-1.0, -0.6, 0.9, -1.0, -1.0, 0.1),
       (-1.6, -0.9, 0.6, -0.9, -1.2, -0.4), (-2.4, -0.7, 0.4, -0.8, -1.5, 0.2)]
for name, points in (("FREE", FREE), ("HIT", HIT)):
    poses, length, travel, penalty, collision, total = cost(points, 10)
    print(f"{name}: poses {poses} length {length:.15g} travel {travel:.15g} penalty {penalty:.15g} "
          f"collision {collision} cost {total:.15g}")
