#!/usr/bin/env python3
"""Holds our inverse dynamics against an independent library (Pinocchio) on 2,000 seeded states an arm.

    torques.py TORQUES_PROGRAM REPOSITORY

Compared are the torques of all joints for angles, speeds and accelerations. Then the comparison itself is tried: the same
arm with one number changed a little must not agree.

Of prismatic joints, positions are in m and what is compared are forces in N.

The arms: the nasty one of tests/robots with a made-up mass in every link, links on joints that are held included; its UR5 of
balls as it stands; and the shipped UR5, whose Denavit-Hartenberg rows are built joint by joint, with made-up moments of
inertia, a payload and a base on a slope; the same on its lift; and a gantry whose prismatic joints stand before and behind revolute
ones.
"""
import math
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy
import pinocchio

STATES = 2_000
TOLERANCE_NM = 1e-9
SLOPE = [1.5, -2.5, -9.2]


def ours(program, robot_file, states):
    """Joints, gravity in the base's frame, and one row of torques a state."""
    text = "\n".join(" ".join(repr(float(number)) for number in state) for state in states)
    done = subprocess.run([program, robot_file], input=text, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{program} {robot_file}: {done.stderr}")
    joints, gravity, *rows = done.stdout.splitlines()
    numbers = lambda line: [float(number) for number in line.split()]
    return joints.split(), numpy.array(numbers(gravity)), numpy.array([numbers(row) for row in rows])


def theirs(model, joints, states):
    """The same by the recursive algorithm of Pinocchio; a joint without end is a point on the unit circle there."""
    data, count, rows = model.createData(), len(joints), []
    of = [model.joints[model.getJointId(name)] for name in joints]
    for state in states:
        q, v, a = pinocchio.neutral(model), numpy.zeros(model.nv), numpy.zeros(model.nv)
        for i, joint in enumerate(of):
            angle = state[i]
            q[joint.idx_q : joint.idx_q + joint.nq] = [math.cos(angle), math.sin(angle)] if joint.nq == 2 else [angle]
            v[joint.idx_v], a[joint.idx_v] = state[count + i], state[2 * count + i]
        torques = pinocchio.rnea(model, data, q, v, a)
        rows.append([torques[joint.idx_v] for joint in of])
    return numpy.array(rows)


def states_of(joints, count):
    random = numpy.random.default_rng(20261130)
    size = (count, joints)
    return numpy.hstack([random.uniform(-math.pi, math.pi, size), random.uniform(-3, 3, size), random.uniform(-15, 15, size)])


def agrees(program, name, robot_file, model_of, count=STATES):
    """`model_of` takes gravity in the base's frame."""
    joints, gravity, _ = ours(program, robot_file, [])
    states = states_of(len(joints), count)
    _, _, mine = ours(program, robot_file, states)
    other = theirs(model_of(gravity), joints, states)
    gap = numpy.abs(mine - other).max()
    print(f"{name}: {count} states of {len(joints)} joints, up to {numpy.abs(other).max():.1f} Nm: {gap:.2e} Nm apart at worst")
    return gap <= TOLERANCE_NM


def of_urdf(urdf, base, held):
    """The model of a URDF whose joints `held` stand still, with gravity turned from the base link's frame into the world's."""
    def model_of(gravity):
        model = pinocchio.buildModelFromUrdf(str(urdf))
        q = pinocchio.neutral(model)
        for name, value in held.items():
            q[model.joints[model.getJointId(name)].idx_q] = value
        model = pinocchio.buildReducedModel(model, [model.getJointId(name) for name in held], q)
        frame = model.frames[model.getFrameId(base)]
        assert frame.parentJoint == 0, f"{base} moves"
        model.gravity.linear = frame.placement.rotation @ gravity
        return model

    return model_of


def inertia_of(mass, center, moments):
    xx, yy, zz, xy, xz, yz = moments
    matrix = numpy.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pinocchio.Inertia(mass, numpy.array(center), matrix)


def of_rows(robot_file):
    """The model of standard Denavit-Hartenberg rows: frame = Rz(q + theta) Tz(d) Tx(a) Rx(alpha)."""
    def model_of(gravity):
        robot, model, behind = tomllib.loads(Path(robot_file).read_text()), pinocchio.Model(), pinocchio.SE3.Identity()
        parent = 0
        for joint in robot["joint"]:
            row = joint["dh"]
            turn = pinocchio.SE3(pinocchio.utils.rotate("z", row["theta_offset_rad"]), numpy.zeros(3))
            kind = pinocchio.JointModelPZ() if joint.get("kind") == "prismatic" else pinocchio.JointModelRZ()
            # Turns about z and shifts along it may change places.
            parent = model.addJoint(parent, kind, behind, joint["name"])
            shift = pinocchio.SE3(numpy.eye(3), numpy.array([row["a_m"], 0.0, row["d_m"]]))
            behind = turn * shift * pinocchio.SE3(pinocchio.utils.rotate("x", row["alpha_rad"]), numpy.zeros(3))
            body = inertia_of(joint["link_mass_kg"], joint["link_center_m"], joint["link_inertia_kg_m2"])
            model.appendBodyToJoint(parent, body, behind)
        payload = robot["payload"]
        body = inertia_of(payload["mass_kg"], payload["center_m"], payload["inertia_kg_m2"])
        model.appendBodyToJoint(parent, body, behind)
        model.gravity.linear = gravity
        return model

    return model_of


def body(random, size):
    """Moments of inertia of some body: by the second moments of its mass, which make any positive matrix."""
    root = random.uniform(-size, size, (3, 3))
    second = root @ root.T
    return numpy.trace(second) * numpy.eye(3) - second


def weighed(text, random):
    """A URDF with a made-up mass in every link but the root, for those that it has."""
    text = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.S)

    def massive(found):
        i = body(random, 0.3)
        xyz, rpy = random.uniform(-0.1, 0.1, 3), random.uniform(-3, 3, 3)
        words = lambda numbers: " ".join(repr(float(number)) for number in numbers)
        moments = " ".join(
            f'{name}="{float(i[a, b])!r}"'
            for name, a, b in [("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)]
        )
        mass = float(random.uniform(0.2, 4.0))
        return (
            f'<link name="{found[1]}"><inertial><mass value="{mass!r}"/><origin xyz="{words(xyz)}" rpy="{words(rpy)}"/>'
            f'<inertia {moments}/></inertial>{"</link>" if found[2] else ""}'
        )

    return re.sub(r'<link name="(?!world)(\w+)"\s*(/?)>', massive, text)


def heavy_rows(shipped, scratch):
    """A shipped arm of rows with moments of inertia, a payload and a base on a slope."""
    random = numpy.random.default_rng(7)

    def moments():
        i = body(random, 0.2)
        return [float(i[a, b]) for a, b in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]]

    text = Path(shipped).read_text()
    text = re.sub("link_mass_kg", lambda _: f"link_inertia_kg_m2 = {moments()}\nlink_mass_kg", text)
    payload = f"[payload]\nmass_kg = 1.7\ncenter_m = [0.03, -0.02, 0.11]\ninertia_kg_m2 = {moments()}\n"
    text = text.replace("[[joint]]", payload + "[[joint]]", 1)
    path = Path(scratch) / Path(shipped).name
    path.write_text(f"gravity_m_s2 = {SLOPE}\n{text}")
    return path


def main():
    program, root = sys.argv[1], Path(sys.argv[2])
    robots, good = root / "tests/robots", []
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        # The mimicry is ignored by ours, and theirs knows no capsules.
        plain = lambda text: re.sub(r"<mimic .*/>", "", text).replace("<capsule", "<cylinder")
        shutil.copytree(robots / "nasty_description", scratch / "nasty_description")
        urdf = scratch / "nasty_description/urdf/nasty.urdf"
        heavy = weighed(urdf.read_text(), numpy.random.default_rng(3))
        urdf.write_text(heavy)
        nasty, nasty_toml = scratch / "nasty.urdf", scratch / "nasty.toml"
        nasty.write_text(plain(heavy))
        nasty_toml.write_text(f"gravity_m_s2 = {SLOPE}\n{(robots / 'nasty.toml').read_text()}")
        held = {"left_finger_slide": 0.0, "right_finger_slide": 0.005, "camera_tilt": 0.2}
        good.append(agrees(program, "nasty", nasty_toml, of_urdf(nasty, "plinth", held)))
        balls = scratch / "ur5_balls.urdf"
        balls.write_text(plain((robots / "ur5_balls.urdf").read_text()))
        fingers = {"left_finger_slide": 0.0, "right_finger_slide": 0.0}
        good.append(agrees(program, "ur5_balls", robots / "ur5_balls.toml", of_urdf(balls, "base_link", fingers)))
        ur5 = heavy_rows(root / "config/robots/ur5.toml", scratch)
        good.append(agrees(program, "ur5", ur5, of_rows(ur5)))
        lift = heavy_rows(root / "config/robots/ur5-lift.toml", scratch)
        good.append(agrees(program, "ur5-lift", lift, of_rows(lift)))
        good.append(agrees(program, "gantry", robots / "gantry.toml", of_urdf(robots / "gantry.urdf", "rail", {})))
        # The check must be able to fail: a gram, a hundredth of a millimetre, a part in a thousand of a moment.
        for old, new in [("mass_kg = 1.7", "mass_kg = 1.701"), ("0.11]", "0.11001]"), ("= 2.33", "= 2.331")]:
            text = ur5.read_text()
            assert old in text, old
            corrupted = scratch / "corrupted.toml"
            corrupted.write_text(text.replace(old, new, 1))
            if agrees(program, f"corrupted ({old} -> {new})", ur5, of_rows(corrupted), 50):
                raise SystemExit(f"the comparison did not see {old} become {new}")
    if not all(good):
        raise SystemExit(f"torques differ by more than {TOLERANCE_NM} Nm")
    print("TORQUES OK")


if __name__ == "__main__":
    main()
