"""Tips and torques of the bimanual OpenArm by Pinocchio (`pip install pin`), for openarm.txt beside it.

Usage: python openarm.py > openarm.txt. Each line: 14 angles, velocities, accelerations (left arm first), positions of the left and the
right tip, 14 torques.
"""
import pathlib
import random
import re

import numpy as np
import pinocchio as pin

URDF = pathlib.Path(__file__).parents[3] / "config/robots/openarm.urdf"
# Its parser knows no capsules, and shapes have no part in this.
text = re.sub(r"<collision>.*?</collision>", "", URDF.read_text(), flags=re.S)
model = pin.buildModelFromXML(text)
model.gravity.linear = np.array([0.0, 0.0, -9.80665])
data = model.createData()
assert [name.rsplit("_", 2)[-2] for name in model.names[1:]] == ["left"] * 7 + ["right"] * 7
rng = random.Random(31)
for _ in range(40):
    q, v, a = ([rng.uniform(-s, s) for _ in range(14)] for s in (2.0, 2.0, 5.0))
    torques = pin.rnea(model, data, np.array(q), np.array(v), np.array(a))
    pin.framesForwardKinematics(model, data, np.array(q))
    tips = [data.oMf[model.getFrameId(f"openarm_{side}_tcp")].translation for side in ("left", "right")]
    numbers = [*q, *v, *a, *tips[0], *tips[1], *torques]
    print(" ".join(repr(float(number)) for number in numbers))
