#!/usr/bin/env python3
"""Holds our forward kinematics against an independent library (yourdfpy) on 10,000 seeded poses an arm.

    kinematics.py FRAMES_PROGRAM REPOSITORY [MBM_FOLDER]

Compared are the pose of the tip and the centre of every collision shape, shapes on joints that are held included. Then the
comparison itself is tried: the same arm with one number of its URDF changed a little must not agree.

The arms: the nasty one and the UR5 of balls of tests/robots, the shipped piper, whose modified Denavit-Hartenberg rows are
turned into a URDF here, and ur5_spherized of the published problems where their folder is at hand (it is not part of
this project; its absence is said).
"""
import json
import math
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy
import yourdfpy

POSES = 10_000
TOLERANCE_M = 1e-9
TOLERANCE_ROTATION = 1e-9


def ours(program, robot_file, poses):
    """Joints, the link of each shape, and one row of numbers a pose."""
    text = "\n".join(" ".join(repr(float(a)) for a in pose) for pose in poses)
    done = subprocess.run([program, robot_file], input=text, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{program} {robot_file}: {done.stderr}")
    joints, links, *rows = done.stdout.splitlines()
    return joints.split(), links.split(), numpy.array([[float(n) for n in row.split()] for row in rows])


def order_of(program, robot_file):
    return ours(program, robot_file, [])[0]


def theirs(urdf, base, tip, held, joints, links, poses):
    """The same by yourdfpy: its graph of transforms from the base link."""
    model = yourdfpy.URDF.load(
        str(urdf), load_meshes=False, build_scene_graph=True, load_collision_meshes=False, build_collision_scene_graph=False
    )
    centres = {}
    for link in model.robot.links:
        centres[link.name] = [numpy.eye(4) if c.origin is None else c.origin for c in link.collisions]
    # Shapes of one link come in the order of the file.
    seen, shapes = {}, []
    for link in links:
        index = seen.get(link, 0)
        seen[link] = index + 1
        shapes.append((link, centres[link][index]))
    rows = []
    for pose in poses:
        model.update_cfg({**held, **dict(zip(joints, pose))})
        tip_pose = model.get_transform(tip, base)
        row = list(tip_pose[:3, :3].flatten()) + list(tip_pose[:3, 3])
        where = {link: model.get_transform(link, base) for link in seen}
        for link, origin in shapes:
            row += list((where[link] @ origin)[:3, 3])
        rows.append(row)
    return numpy.array(rows)


def apart(mine, other):
    """Largest differences: of lengths in m, of rotation matrices."""
    gap = numpy.abs(mine - other)
    return gap[:, 9:].max(), gap[:, :9].max()


def as_urdf(robot_file, folder):
    """A URDF of the modified rows of a robot file: the joint stands at Rx(alpha) Tx(a) Tz(d) Rz(theta)."""
    robot = tomllib.loads(Path(robot_file).read_text())
    parts = ['<robot name="rows"><link name="l0"/>']
    for i, joint in enumerate(robot["joint"]):
        row = joint["mdh"]
        a, alpha, d, theta = row["a_m"], row["alpha_rad"], row["d_m"], row["theta_offset_rad"]
        # Rx(alpha) Rz(theta) as roll, pitch, yaw about fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
        ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
        r = [[ct, -st, 0.0], [ca * st, ca * ct, -sa], [sa * st, sa * ct, ca]]
        pitch = math.atan2(-r[2][0], math.hypot(r[0][0], r[1][0]))
        roll, yaw = math.atan2(r[2][1], r[2][2]), math.atan2(r[1][0], r[0][0])
        xyz = f"{a!r} {-d * sa!r} {d * ca!r}"
        parts.append(
            f'<joint name="{joint["name"]}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{xyz}" rpy="{roll!r} {pitch!r} {yaw!r}"/><axis xyz="0 0 1"/>'
            f'<limit lower="-9" upper="9" effort="1" velocity="1"/></joint><link name="l{i + 1}"/>'
        )
    path = Path(folder) / "rows.urdf"
    path.write_text("".join(parts) + "</robot>")
    return path, f"l{len(robot['joint'])}"


def compare(program, name, robot_file, urdf, base, tip, held, count=POSES, with_shapes=True):
    poses = numpy.random.default_rng(20261122).uniform(-math.pi, math.pi, (count, len(order_of(program, robot_file))))
    joints, links, mine = ours(program, robot_file, poses)
    if not with_shapes:
        links, mine = [], mine[:, :12]
    other = theirs(urdf, base, tip, held, joints, links, poses)
    if mine.shape != other.shape:
        raise SystemExit(f"{name}: {mine.shape} against {other.shape} numbers")
    length_m, rotation = apart(mine, other)
    print(f"{name}: {count} poses, {len(links)} shapes: {length_m:.2e} m, {rotation:.2e} apart at worst")
    return length_m <= TOLERANCE_M and rotation <= TOLERANCE_ROTATION


def spherized(folder, scratch):
    lines = [
        'name = "ur5_spherized"',
        f"urdf = {json.dumps(str(folder / 'ur5_spherized.urdf'))}",
        f"srdf = {json.dumps(str(folder / 'ur5.srdf'))}",
        'base_link = "base_link"',
        'tip_link = "tool0"',
    ]
    for joint in ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]:
        lines += ["[[joint]]", f'name = "{joint}_joint"', "motion = { acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }"]
    path = Path(scratch) / "ur5_spherized.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def main():
    program, root = sys.argv[1], Path(sys.argv[2])
    mbm = Path(sys.argv[3]) if len(sys.argv) > 3 else root / "../shared/mbm"
    robots = root / "tests/robots"
    nasty_urdf = robots / "nasty_description/urdf/nasty.urdf"
    # What ours holds still: at 0, at the offset of what it would follow, at the nearest end of its range.
    nasty_held = {"left_finger_slide": 0.0, "right_finger_slide": 0.005, "camera_tilt": 0.2}
    good = []
    with tempfile.TemporaryDirectory() as scratch:
        # The mimicry is ignored by ours, so it is not to be followed by theirs; and theirs knows no capsules.
        plain = Path(scratch) / "nasty.urdf"
        plain.write_text(re.sub(r"<mimic .*/>", "", nasty_urdf.read_text()).replace("<capsule", "<cylinder"))
        good.append(compare(program, "nasty", robots / "nasty.toml", plain, "plinth", "tool0", nasty_held))
        balls_urdf = Path(scratch) / "ur5_balls.urdf"
        balls_urdf.write_text(re.sub(r"<mimic .*/>", "", (robots / "ur5_balls.urdf").read_text()))
        balls_held = {"left_finger_slide": 0.0, "right_finger_slide": 0.0}
        good.append(compare(program, "ur5_balls", robots / "ur5_balls.toml", balls_urdf, "base_link", "tool0", balls_held))
        piper = root / "config/robots/piper.toml"
        rows, tip = as_urdf(piper, scratch)
        good.append(compare(program, "piper", piper, rows, "l0", tip, {}, with_shapes=False))
        if (mbm / "ur5_spherized.urdf").is_file():
            robot = spherized(mbm, scratch)
            good.append(compare(program, "ur5_spherized", robot, mbm / "ur5_spherized.urdf", "base_link", "tool0", {}))
        else:
            print(f"SKIPPED ur5_spherized: {mbm} has no ur5_spherized.urdf; name its folder as the third argument")
        # The check must be able to fail: a micrometre, a microradian, another axis, a shape a micrometre off.
        for old, new in [
            ("0.22 0.05 0.01", "0.220001 0.05 0.01"),
            ("-1.1 0.6 2.9", "-1.1 0.600001 2.9"),
            ('xyz="1 2 -0.5"', 'xyz="1 2 -0.50001"'),
            ('<origin xyz="0.02 0 0"/><geometry><box size="0.03', '<origin xyz="0.020001 0 0"/><geometry><box size="0.03'),
        ]:
            text = plain.read_text()
            assert old in text, old
            corrupted = Path(scratch) / "corrupted.urdf"
            corrupted.write_text(text.replace(old, new, 1))
            agrees = compare(program, f"corrupted ({old} -> {new})", robots / "nasty.toml", corrupted, "plinth", "tool0", nasty_held, 50)
            if agrees:
                raise SystemExit(f"the comparison did not see {old} become {new}")
    if not all(good):
        raise SystemExit(f"kinematics differ by more than {TOLERANCE_M} m or {TOLERANCE_ROTATION}")
    print("KINEMATICS OK")


if __name__ == "__main__":
    main()
