"""Jerk-limited time optimum along given geometric paths, by an independent solver (CasADi and Ipopt), and two other columns.

    python3 -m venv venv && venv/bin/pip install numpy scipy casadi toppra
    taustream bench timing --paths 60 -o paths.jsonl
    venv/bin/python planner/benches/path_optimum.py paths.jsonl --blend-rad 0.1 --limits ur5

Each line of the file is one motion: limits, duration and positions at even times. The path is taken from the positions alone: a
spline by arc length. Along it the position, speed and acceleration of a point with piecewise constant jerk (K intervals of one
free length) are chosen so that every joint keeps its limits in the middle of each interval and the time is least. Prints the
duration of the motion over that optimum. The optimum is local, begins at the motion itself, and is a little too fast, since
limits hold at K instants only.

TOPP-RA's column is the duration of the motion over the optimum of TOPP-RA along the same path, which keeps velocity and
acceleration limits and no jerk limit, so that nothing that is limited in jerk reaches 1. Ruckig's column is the sum of Ruckig's
optima from point to point, at rest at each of them, over the duration of the motion.
"""
import argparse
import json
import logging

import casadi as ca
import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint
from scipy.interpolate import make_interp_spline

KNOTS = 800
# Grid of TOPP-RA: 500 and 2000 points differ by less than 0.2 %.
TOPPRA_POINTS = 1000
# Bins of path lengths, rad.
LENGTHS_RAD = ((0.3, 2), (2, 6), (6, 12))


def path_of(position_rad):
    """The path by its share of the length, 241 points of it, and that share at each sample."""
    q = np.asarray(position_rad)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    moves = np.concatenate([[True], np.diff(length) > 1e-7 * length[-1]])
    moves[-1] = True
    rough = make_interp_spline(length[moves] / length[-1], q[moves], k=3)
    share = np.linspace(0, 1, 241)
    return share, rough(share), length / length[-1]


def toppra_s(motion):
    """Least time along the motion's path under limits of velocity and acceleration."""
    share, pose_rad, _ = path_of(motion["position_rad"])
    both = lambda key: np.stack([-np.asarray(motion[key]), np.asarray(motion[key])], axis=1)
    limits = [
        toppra.constraint.JointVelocityConstraint(both("velocity_rad_s")),
        toppra.constraint.JointAccelerationConstraint(both("acceleration_rad_s2")),
    ]
    path = toppra.SplineInterpolator(share, pose_rad)
    grid = np.linspace(0, 1, TOPPRA_POINTS + 1)
    timed = toppra.algorithm.TOPPRA(limits, path, gridpoints=grid, solver_wrapper="seidel").compute_trajectory(0, 0)
    return None if timed is None else float(timed.duration)


def optimum_s(motion, intervals):
    """Least time along the motion's path, and whether the solver says that it is one."""
    at, pose_rad, share = path_of(motion["position_rad"])
    smooth = make_interp_spline(at, pose_rad, k=5)
    knots = np.linspace(0, 1, KNOTS + 1)
    tables = [smooth(knots, order).flatten().tolist() for order in (1, 2, 3)]
    derivatives = [ca.interpolant(f"d{i}", "bspline", [knots.tolist()], t) for i, t in enumerate(tables)]
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


def spread(values):
    """Median and largest, in words."""
    return f"median {np.median(values):.3f}, largest {max(values):.3f}" if len(values) else "none"


def chosen(motions, blend_rad, limits):
    """The motions of one blend under one set of limits; where none is named, all."""
    for motion in motions:
        is_other = (blend_rad and motion["blend_rad"] != blend_rad) or (limits and motion["limits"] != limits)
        if not is_other:
            yield motion


def row(motion, intervals):
    """What is printed for a motion: length, duration over the three others, and whether Ipopt solved it."""
    least_s, is_solved = optimum_s(motion, intervals)
    unlimited_s = toppra_s(motion)
    duration_s = motion["duration_s"]
    over = {"length_rad": motion["length_rad"], "ipopt": duration_s / least_s if is_solved else None}
    over["toppra"] = duration_s / unlimited_s if unlimited_s else None
    over["stops"] = motion["stops_s"] / duration_s
    text = {key: "-" if value is None else f"{value:.3f}" for key, value in over.items()}
    print(f"{motion['length_rad']:6.2f} rad  {duration_s:7.3f} s  over Ipopt's optimum {least_s:7.3f} s: {text['ipopt']}  "
          f"over TOPP-RA: {text['toppra']}  Ruckig with stops over it: {text['stops']}", flush=True)
    return over


def main():
    logging.getLogger("toppra").setLevel(logging.ERROR)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--blend-rad", type=float, help="only paths of this blend")
    parser.add_argument("--limits", help="only paths under these limits")
    parser.add_argument("--intervals", type=int, default=100)
    arguments = parser.parse_args()
    with open(arguments.file, encoding="utf-8") as lines:
        motions = [json.loads(line) for line in lines]
    rows = [row(motion, arguments.intervals) for motion in chosen(motions, arguments.blend_rad, arguments.limits)]
    for key, words in (("ipopt", "Ipopt's jerk-limited optimum"), ("toppra", "TOPP-RA's optimum without a jerk limit")):
        known = [over[key] for over in rows if over[key] is not None]
        print(f"duration over {words}: {spread(known)} of {len(known)}; {len(rows) - len(known)} not solved")
        for low, high in LENGTHS_RAD:
            part = [over[key] for over in rows if over[key] is not None and low <= over["length_rad"] < high + 1e-9]
            print(f"    {low} to {high} rad: {spread(part)} of {len(part)}")
    print(f"Ruckig with stops over the duration: {spread([over['stops'] for over in rows])}, "
          f"least {min(over['stops'] for over in rows):.3f}")


if __name__ == "__main__":
    main()
