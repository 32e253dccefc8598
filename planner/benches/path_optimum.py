"""Jerk-limited time optimum along given geometric paths, by an independent solver (CasADi and Ipopt).

    python3 -m venv venv && venv/bin/pip install numpy scipy casadi
    taustream bench timing --paths 60 -o paths.jsonl
    venv/bin/python planner/benches/path_optimum.py paths.jsonl --blend-rad 0.1 --limits UR5

Each line of the file is one motion: limits, duration and positions at even times. The path is taken from the positions alone: a
spline by arc length. Along it the position, speed and acceleration of a point with piecewise constant jerk (K intervals of one
free length) are chosen so that every joint keeps its limits in the middle of each interval and the time is least. Prints the
duration of the motion over that optimum. The optimum is local, begins at the motion itself, and is a little too fast, since
limits hold at K instants only.
"""
import argparse
import json

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline

KNOTS = 800


def path_derivatives(position_rad):
    """The first three derivatives of the path by its share of the length, and that share at each sample."""
    q = np.asarray(position_rad)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    moves = np.concatenate([[True], np.diff(length) > 1e-7 * length[-1]])
    moves[-1] = True
    rough = make_interp_spline(length[moves] / length[-1], q[moves], k=3)
    share = np.linspace(0, 1, 241)
    smooth = make_interp_spline(share, rough(share), k=5)
    knots = np.linspace(0, 1, KNOTS + 1)
    tables = [smooth(knots, order).flatten().tolist() for order in (1, 2, 3)]
    return [ca.interpolant(f"d{i}", "bspline", [knots.tolist()], t) for i, t in enumerate(tables)], length / length[-1]


def optimum_s(motion, intervals):
    """Least time along the motion's path, and whether the solver says that it is one."""
    derivatives, share = path_derivatives(motion["position_rad"])
    limits = [np.asarray(motion[key]) for key in ("velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3")]
    problem = ca.Opti()
    total, state = problem.variable(), problem.variable(3, intervals + 1)
    jerk = problem.variable(1, intervals)
    h = total / intervals
    for i in range(intervals):
        s, v, a = state[0, i], state[1, i], state[2, i]
        j = jerk[0, i]
        problem.subject_to(state[0, i + 1] == s + v * h + a * h**2 / 2 + j * h**3 / 6)
        problem.subject_to(state[1, i + 1] == v + a * h + j * h**2 / 2)
        problem.subject_to(state[2, i + 1] == a + j * h)
        d1, d2, d3 = (d((s + state[0, i + 1]) / 2) for d in derivatives)
        v, a = v + a * h / 2 + j * h**2 / 8, a + j * h / 2
        joints = (d1 * v, d1 * a + d2 * v**2, d1 * j + 3 * d2 * v * a + d3 * v**3)
        for value, limit in zip(joints, limits):
            problem.subject_to(problem.bounded(-1, value / limit, 1))
    problem.subject_to(problem.bounded(0, state[0, :], 1))
    problem.subject_to(problem.bounded(0, state[1, :], 1e3))
    problem.subject_to(state[:, 0] == 0)
    problem.subject_to(state[:, intervals] == ca.vertcat(1, 0, 0))
    problem.minimize(total)
    start = motion["duration_s"]
    at = np.interp(np.linspace(0, 1, intervals + 1), np.linspace(0, 1, len(share)), share)
    speed = np.gradient(at, start / intervals)
    acceleration = np.gradient(speed, start / intervals)
    problem.set_initial(total, 1.05 * start)
    problem.set_initial(state, np.vstack([at, speed, acceleration]))
    problem.set_initial(jerk, np.diff(acceleration) / (start / intervals))
    problem.solver("ipopt", {"print_time": 0}, {"print_level": 0, "max_iter": 400, "sb": "yes"})
    try:
        return float(problem.solve().value(total)), True
    except RuntimeError:
        return float(problem.debug.value(total)), False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--blend-rad", type=float, help="only paths of this blend")
    parser.add_argument("--limits", help="only paths under these limits")
    parser.add_argument("--intervals", type=int, default=100)
    arguments = parser.parse_args()
    ratios, unsolved = [], 0
    with open(arguments.file, encoding="utf-8") as lines:
        motions = [json.loads(line) for line in lines]
    for motion in motions:
        blend, limits = arguments.blend_rad, arguments.limits
        if (blend and motion["blend_rad"] != blend) or (limits and motion["limits"] != limits):
            continue
        least_s, is_solved = optimum_s(motion, arguments.intervals)
        ratio = motion["duration_s"] / least_s
        print(f"{motion['length_rad']:6.2f} rad  {motion['duration_s']:7.3f} s  optimum {least_s:7.3f} s  "
              f"ratio {ratio:.3f}{'' if is_solved else '  (not solved)'}", flush=True)
        if is_solved:
            ratios.append(ratio)
        else:
            unsolved += 1
    if ratios:
        print(f"median {np.median(ratios):.3f}, largest {max(ratios):.3f} of {len(ratios)}; {unsolved} not solved")


if __name__ == "__main__":
    main()
