#!/usr/bin/env python3
"""One robust bacterial robot in front of a U, written from algorithm 1 of Abdi et al. (2020) (plain
Python). Prints how many places and virtual obstacles there are, every twentieth place, and the virtual obstacles, for
tests/papers_planar.rs: `python3 paper_002.py > planar_walk.txt`."""
from math import exp, hypot

from draws import Draw

N_S, R, BETA, CLEAR = 30, 2.0, 13.0, 3.0
H_O, W_O, H_G, W_G, H_ADD, W_ADD = 1.0, 0.02, 20.0, 1e-4, 1.0, 0.01
D_MIN, DIS, K = 3.0, 15.0, 10
WALLS = [(-15.0, -20.0), (-15.0, 0.0), (15.0, 0.0), (15.0, -20.0)]
START, GOAL = (3.0, -60.0), (0.0, 60.0)


def gap(a, b):
    return hypot(a[0] - b[0], a[1] - b[1])


def closest(p):
    """The nearest point of the whole obstacle."""
    found = []
    for (ax, ay), (bx, by) in zip(WALLS, WALLS[1:]):
        t = ((p[0] - ax) * (bx - ax) + (p[1] - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        t = min(1.0, max(0.0, t))
        found.append((ax + t * (bx - ax), ay + t * (by - ay)))
    return min(found, key=lambda q: gap(p, q))


def walk(steps, seed=1):
    draw, virtual = Draw(seed), []
    trace, path, since, going_back = [START], [START], 0, None
    for _ in range(steps):
        q = trace[-1]
        if gap(q, GOAL) < D_MIN:
            break
        obstacle = closest(q)
        senses = gap(q, obstacle) <= BETA

        def cost(p):
            j = -H_G * exp(-W_G * gap(p, GOAL) ** 2)
            if senses:
                j += H_O * exp(-W_O * gap(p, obstacle) ** 2)
            return j + sum(H_ADD * exp(-W_ADD * gap(p, v) ** 2) for v in virtual)

        if going_back is None:
            # Candidates that touch are dropped; staying is worth its own cost.
            best = (cost(q), gap(q, GOAL), None)
            for _ in range(N_S):
                x, y = draw.within(-1.0, 1.0), draw.within(-1.0, 1.0)
                p = (q[0] + R / hypot(x, y) * x, q[1] + R / hypot(x, y) * y)
                if gap(p, closest(p)) >= min(CLEAR, gap(q, obstacle)):
                    best = min(best, (cost(p), gap(p, GOAL), p), key=lambda b: b[:2])
            if best[2]:
                trace.append(best[2])
        else:
            if len(trace) > going_back:
                trace.pop()
            if len(trace) <= going_back:
                going_back, since = None, len(path)
        path.append(trace[-1])
        old = len(path) - 1 - K
        if going_back is None and old >= since and gap(path[-1], path[old]) < R:
            virtual.append(path[-1])
            far = [i for i, p in enumerate(trace) if gap(p, path[-1]) > DIS]
            going_back = far[-1] + 1 if far else 1
    return path, virtual


if __name__ == "__main__":
    path, virtual = walk(4000)
    print(len(path), len(virtual))
    for place in path[::20] + virtual:
        print(f"{place[0]:.9f} {place[1]:.9f}")
