#!/usr/bin/env python3
"""LaValle's tree of 1998 in a square with two discs, in plain Python written from his report.

Prints what tests/rrt.rs compares with: for each seed a line with the nodes of the tree and its path's coordinates.
`python3 rrt.py > rrt.txt` makes the file again.
"""
import pathlib
import sys
from math import hypot

sys.path.insert(0, str(pathlib.Path(__file__).parents[3] / "optimizers/tests/oracles"))
from draws import Draw

DISCS = [((0.0, 0.0), 1.2), ((0.5, -2.0), 0.7)]
START, GOAL = (-2.0, -0.5), (2.0, -0.4)
STEP, BIAS = 0.5, 0.05


def is_free(a, b):
    """No disc is met by the segment: its point nearest to the centre is outside."""
    d = (b[0] - a[0], b[1] - a[1])
    for (cx, cy), radius in DISCS:
        length2 = d[0] ** 2 + d[1] ** 2
        t = ((cx - a[0]) * d[0] + (cy - a[1]) * d[1]) / length2 if length2 > 0 else 0.0
        t = min(max(t, 0.0), 1.0)
        if hypot(a[0] + t * d[0] - cx, a[1] + t * d[1] - cy) < radius:
            return False
    return True


def grow(seed):
    draw = Draw(seed)
    nodes, parent = [START], [None]
    while True:
        to_goal = draw.unit() < BIAS
        target = GOAL if to_goal else (draw.within(-3.0, 3.0), draw.within(-3.0, 3.0))
        away = [hypot(n[0] - target[0], n[1] - target[1]) for n in nodes]
        near = away.index(min(away))
        base, gap = nodes[near], away[near]
        share = STEP / gap if gap > STEP else 1.0
        new = target if gap <= STEP else tuple(b + share * (t - b) for b, t in zip(base, target))
        if not is_free(base, new):
            continue
        nodes.append(new)
        parent.append(near)
        if to_goal and gap <= STEP:
            break
    path, at = [], len(nodes) - 1
    while at is not None:
        path.append(nodes[at])
        at = parent[at]
    return len(nodes), path[::-1]


for seed in range(1, 7):
    count, path = grow(seed)
    print(count, " ".join(f"{x:.12g} {y:.12g}" for x, y in path))
