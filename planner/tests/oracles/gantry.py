"""Tip, torques and forces of the gantry by Pinocchio (`pip install pin`), for gantry.txt beside it.

Usage: python gantry.py > gantry.txt. Each line: 4 positions (m, rad, m, rad), velocities, accelerations, position of the tip in the
frame of the rail, 4 forces and torques (N, Nm, N, Nm). Gravity points down in the frame of the rail.
"""
import pathlib
import random

import numpy as np
import pinocchio as pin

URDF = pathlib.Path(__file__).parents[3] / "tests/robots/gantry.urdf"
model = pin.buildModelFromUrdf(str(URDF))
data = model.createData()
assert list(model.names[1:]) == ["slide", "swivel", "telescope", "wrist"]
rail = model.frames[model.getFrameId("rail")].placement
model.gravity.linear = rail.rotation @ np.array([0.0, 0.0, -9.80665])
rng = random.Random(38)
for _ in range(60):
    q, v, a = ([rng.uniform(-s, s) for _ in range(4)] for s in (1.0, 2.0, 5.0))
    torques = pin.rnea(model, data, np.array(q), np.array(v), np.array(a))
    pin.framesForwardKinematics(model, data, np.array(q))
    tip = rail.actInv(data.oMf[model.getFrameId("tcp")]).translation
    print(" ".join(repr(float(number)) for number in [*q, *v, *a, *tip, *torques]))
