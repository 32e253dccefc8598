#!/usr/bin/env python3
"""Holds the clearances of planned motions against an independent library of distances (coal), and poses of the tip against yourdfpy.

    clearance.py MOTIONS_PROGRAM REPOSITORY

200 motions of two arms among random spheres, boxes, cylinders and capsules, from a seed. Where the links are is computed here: from
the Denavit-Hartenberg rows and capsules of the robot file (ur5), and by yourdfpy from the URDF (ur5_balls). Each motion is sampled
densely, and around the least distance finer. No sample may be nearer than what was proven, and what was proven may be at most
1 mm too careful. Where a pose of the tip was asked for, the motion must end there. Then the comparison itself is tried: arms
that are 2 mm thicker must not agree.
"""
import json
import math
import subprocess
import sys
import tomllib
from pathlib import Path

import coal
import numpy
import yourdfpy

SAMPLES = 160
FINER = 32
CAREFUL_M = 1e-3
# Distances of cylinders are iterated on both sides.
TOLERANCE_M = 2e-5
TIP_M, TIP_RAD = 2e-6, 2e-5


def rotation(rpy):
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    x = numpy.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = numpy.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = numpy.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return z @ y @ x


def pose(position, turn=None):
    matrix = numpy.eye(4)
    matrix[:3, 3] = position
    if turn is not None:
        matrix[:3, :3] = turn
    return matrix


class Body:
    """A shape in the frame of its link; `frame` 0 stands still."""

    def __init__(self, link, frame, local, shape, bound):
        self.link, self.frame, self.local, self.shape, self.bound = link, frame, local, shape, bound


def capsule(ends, radius):
    (a, b) = (numpy.array(end) for end in ends)
    along = b - a
    length = float(numpy.linalg.norm(along))
    turn = numpy.eye(3)
    if length > 1e-12:
        z = along / length
        x = numpy.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.9 else [0.0, 1.0, 0.0])
        x /= numpy.linalg.norm(x)
        turn = numpy.stack([x, numpy.cross(z, x), z], axis=1)
    return pose(0.5 * (a + b), turn), coal.Capsule(radius, length), radius + 0.5 * length


class Rows:
    """An arm by the standard rows of its robot file."""

    def __init__(self, file, thicker):
        robot = tomllib.loads(Path(file).read_text())
        self.rows = [joint["dh"] for joint in robot["joint"]]
        self.tip = len(self.rows)
        lists = [robot.get("base_capsules", [])] + [joint.get("link_capsules", []) for joint in robot["joint"]]
        assert all(joint.get("link_radius_m", 0.0) == 0.0 for joint in robot["joint"])
        self.bodies = []
        for frame, capsules in enumerate(lists):
            for one in capsules:
                made = capsule([one["from_m"], one["to_m"]], one["radius_m"] + thicker)
                self.bodies.append(Body("base" if frame == 0 else f"link{frame}", frame, *made))

    def frames(self, angles):
        """Of every body, and of the tip: one matrix a sample."""
        frames = [numpy.tile(numpy.eye(4), (len(angles), 1, 1))]
        for index, row in enumerate(self.rows):
            theta = angles[:, index] + row["theta_offset_rad"]
            c, s = numpy.cos(theta), numpy.sin(theta)
            ca, sa = math.cos(row["alpha_rad"]), math.sin(row["alpha_rad"])
            step = numpy.zeros((len(angles), 4, 4))
            step[:, 0] = numpy.stack([c, -s * ca, s * sa, row["a_m"] * c], axis=1)
            step[:, 1] = numpy.stack([s, c * ca, -c * sa, row["a_m"] * s], axis=1)
            step[:, 2] = [0.0, sa, ca, row["d_m"]]
            step[:, 3, 3] = 1.0
            frames.append(frames[-1] @ step)
        return [frames[body.frame] for body in self.bodies], frames[self.tip]


class Urdf:
    """An arm by yourdfpy's reading of its URDF."""

    def __init__(self, file, header, held, base, tip, thicker):
        self.model = yourdfpy.URDF.load(
            str(file), load_meshes=False, build_scene_graph=True, load_collision_meshes=False, build_collision_scene_graph=False
        )
        self.joints, self.held, self.base, self.tip = header["joints"], held, base, tip
        frame_of = dict(map(tuple, header["shapes"]))
        self.bodies = []
        for link in self.model.robot.links:
            for one in link.collisions:
                if link.name not in frame_of:
                    raise SystemExit(f"{link.name} has a shape, and ours has none")
                local = numpy.eye(4) if one.origin is None else one.origin
                geometry = one.geometry
                if geometry.sphere is not None:
                    radius = geometry.sphere.radius + thicker
                    shape, bound = coal.Sphere(radius), radius
                elif geometry.box is not None:
                    size = numpy.array(geometry.box.size) + 2 * thicker
                    shape, bound = coal.Box(*size), 0.5 * float(numpy.linalg.norm(size))
                else:
                    radius, length = geometry.cylinder.radius + thicker, geometry.cylinder.length + 2 * thicker
                    shape, bound = coal.Cylinder(radius, length), math.hypot(radius, 0.5 * length)
                self.bodies.append(Body(link.name, frame_of[link.name], local, shape, bound))

    def frames(self, angles):
        names = {body.link for body in self.bodies} | {self.tip}
        rows = {name: [] for name in names}
        for row in angles:
            self.model.update_cfg({**self.held, **dict(zip(self.joints, row))})
            for name in names:
                rows[name].append(self.model.get_transform(name, self.base))
        rows = {name: numpy.array(matrices) for name, matrices in rows.items()}
        return [rows[body.link] for body in self.bodies], rows[self.tip]


def obstacles(text):
    bodies = []
    scene = tomllib.loads(text)
    for kind in ["sphere", "box", "cylinder", "capsule"]:
        for one in scene.get(kind, []):
            at = pose(one["center_m"], rotation(one.get("rpy_rad", [0.0] * 3)))
            if kind == "sphere":
                shape, bound = coal.Sphere(one["radius_m"]), one["radius_m"]
            elif kind == "box":
                shape, bound = coal.Box(*one["size_m"]), 0.5 * math.dist(one["size_m"], [0.0] * 3)
            elif kind == "cylinder":
                shape = coal.Cylinder(one["radius_m"], one["length_m"])
                bound = math.hypot(one["radius_m"], 0.5 * one["length_m"])
            else:
                shape = coal.Capsule(one["radius_m"], one["length_m"])
                bound = one["radius_m"] + 0.5 * one["length_m"]
            bodies.append(Body(one["name"], 0, at, shape, bound))
    return bodies


def angles_at(motion, times, joints):
    angles = numpy.tile(numpy.array(motion["base_rad"][:joints]), (len(times), 1))
    for start, duration, n, delta in motion["strokes"]:
        s = numpy.clip((times - start) / duration, 0.0, 1.0)
        angles += numpy.outer(1.0 - (1.0 - s**4) ** n, delta[:joints])
    return angles


def placed(matrix):
    return coal.Transform3s(numpy.ascontiguousarray(matrix[:3, :3]), numpy.ascontiguousarray(matrix[:3, 3]))


def distance(a, a_at, b, b_at):
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    return coal.distance(a.shape, placed(a_at), b.shape, placed(b_at), request, result)


class Pairs:
    """What must keep apart, and where all of it is at some times."""

    def __init__(self, arm, header, around):
        self.arm, self.around = arm, around
        touching = {frozenset(pair) for pair in header["may_touch"]}
        bodies = list(enumerate(arm.bodies))
        self.pairs = [(i, None, o) for i, body in bodies if body.frame > 0 for o in range(len(around))]
        self.pairs += [
            (i, j, None)
            for i, a in bodies
            for j, b in bodies
            if j < i and a.frame != b.frame and a.link != b.link and frozenset((a.link, b.link)) not in touching
        ]

    def least(self, angles, pairs=None):
        """The least distance, its sample and its pair: exact distances from the nearest by their balls on."""
        frames, _ = self.arm.frames(angles)
        at = [frame @ body.local for frame, body in zip(frames, self.arm.bodies)]
        lower = []
        for i, j, o in pairs or self.pairs:
            other, other_at = (self.arm.bodies[j], at[j]) if o is None else (self.around[o], self.around[o].local[None])
            gap = numpy.linalg.norm(at[i][:, :3, 3] - other_at[:, :3, 3], axis=1)
            lower.append(gap - self.arm.bodies[i].bound - other.bound)
        lower = numpy.array(lower)
        best = (math.inf, 0, None)
        for flat in numpy.argsort(lower, axis=None):
            index, sample = numpy.unravel_index(flat, lower.shape)
            if lower[index, sample] >= best[0]:
                break
            pair = (pairs or self.pairs)[index]
            i, j, o = pair
            other, other_at = (self.arm.bodies[j], at[j][sample]) if o is None else (self.around[o], self.around[o].local)
            found = distance(self.arm.bodies[i], at[i][sample], other, other_at)
            if found < best[0]:
                best = (found, int(sample), pair)
        return best


def measure(arm, header, motion):
    """The least distance of a motion by dense samples, and finer ones around the least."""
    joints = len(header["joints"])
    pairs = Pairs(arm, header, obstacles(motion["scene"]))
    times = numpy.linspace(0.0, motion["duration_s"], SAMPLES)
    least, sample, pair = pairs.least(angles_at(motion, times, joints))
    near = [times[sample], motion["clearance_at_s"]]
    step = times[1]
    for at in near:
        finer = numpy.clip(numpy.linspace(at - step, at + step, FINER), 0.0, motion["duration_s"])
        found, _, found_pair = pairs.least(angles_at(motion, finer, joints))
        if found < least:
            least, pair = found, found_pair
    return least, pair


def check_tip(arm, header, motion):
    """By how much the motion misses the pose of the tip that was asked for."""
    end = angles_at(motion, numpy.array([motion["duration_s"]]), len(header["joints"]))
    _, [tip] = arm.frames(end)
    x, y, z, w = motion["tip"]["quaternion_xyzw"]
    wanted = numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    turned = 0.5 * float(numpy.linalg.norm(wanted.T @ tip[:3, :3] - (wanted.T @ tip[:3, :3]).T)) / math.sqrt(2.0)
    return math.dist(tip[:3, 3], motion["tip"]["position_m"]), turned


def read(program, robot, count, seed):
    done = subprocess.run([program, robot, str(count), str(seed)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{program} {robot}: {done.stderr}")
    header, *motions = map(json.loads, done.stdout.splitlines())
    if len(motions) != count:
        raise SystemExit(f"{robot}: {len(motions)} motions instead of {count}")
    return header, motions


def compare(name, arm, header, motions):
    """How many motions are nearer to something than was proven, and how many were proven too carefully."""
    nearer, careful, missed, tips, worst = 0, 0, 0, 0, 0.0
    for number, motion in enumerate(motions):
        least, pair = measure(arm, header, motion)
        off = least - motion["clearance_m"]
        worst = max(worst, off)
        if off < -TOLERANCE_M:
            nearer += 1
            between = motion["clearance_between"]
            print(f"{name} {number}: {least:.6f} m, proven {motion['clearance_m']:.6f} m ({between}, here {pair})")
        careful += off > CAREFUL_M + TOLERANCE_M
        if motion["tip"]:
            tips += 1
            off_m, off_rad = check_tip(arm, header, motion)
            if off_m > TIP_M or off_rad > TIP_RAD:
                missed += 1
                print(f"{name} {number}: the tip is {off_m:.2e} m and {off_rad:.2e} rad off")
    print(
        f"{name}: {len(motions)} motions, {nearer} nearer than proven, {careful} proven more than {CAREFUL_M * 1e3:.0f} mm too "
        f"carefully (at most {worst * 1e3:.3f} mm); {tips} poses of the tip, {missed} missed"
    )
    return nearer, careful + missed


def main():
    program, root = sys.argv[1], Path(sys.argv[2])
    rows, balls = root / "config/robots/ur5.toml", root / "tests/robots/ur5_balls.toml"
    held = {"left_finger_slide": 0.0, "right_finger_slide": 0.0}
    urdf = root / "tests/robots/ur5_balls.urdf"
    bad = 0
    for name, file, count in [("ur5", rows, 160), ("ur5_balls", balls, 40)]:
        header, motions = read(program, file, count, 20261130)
        for thicker in [0.0, 2e-3]:
            if name == "ur5":
                arm = Rows(file, thicker)
            else:
                arm = Urdf(urdf, header, held, "base_link", "tool0", thicker)
            if thicker == 0.0:
                nearer, others = compare(name, arm, header, motions)
                bad += nearer + others
                continue
            # The check must be able to fail.
            nearer, _ = compare(f"{name}, 2 mm thicker", arm, header, motions[:5])
            if nearer < 4:
                raise SystemExit(f"{name}: the comparison did not see links that are 2 mm thicker")
    if bad:
        raise SystemExit(f"{bad} motions differ")
    print("CLEARANCE OK")


if __name__ == "__main__":
    main()
