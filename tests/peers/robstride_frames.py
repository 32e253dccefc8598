"""Frames of RobStride motors as two independent libraries pack and read them.

Usage: robstride_frames.py FILE           writes the frames
       robstride_frames.py --check FILE   fails when the libraries give other frames than FILE holds

robstride-dynamics packs commands and parameters and reads every model's feedback, sirwart's robstride reads that of RS02.
Neither shares a line with this project. The test `frames_are_those_of_independent_libraries` of drivers/ holds the codec
against FILE.
"""

import random
import sys

import can
import numpy as np
from robstride.client import Client
from robstride_dynamics import Motor, ParameterType, RobstrideBus
from robstride_dynamics.table import (
    MODEL_MIT_KD_TABLE, MODEL_MIT_KP_TABLE, MODEL_MIT_POSITION_TABLE, MODEL_MIT_TORQUE_TABLE, MODEL_MIT_VELOCITY_TABLE,
)

SEED = 20_261_130
A_MODEL = 60
TABLES = (MODEL_MIT_POSITION_TABLE, MODEL_MIT_VELOCITY_TABLE, MODEL_MIT_TORQUE_TABLE, MODEL_MIT_KP_TABLE, MODEL_MIT_KD_TABLE)


class Recorder:
    """A bus that keeps what is sent, and gives back what it was set to."""

    def __init__(self):
        self.sent = []
        self.answer = None

    def send(self, message):
        """Keeps a frame as text."""
        assert message.is_extended_id
        self.sent.append(f"{message.arbitration_id:08X}#{bytes(message.data).hex().upper()}")

    def recv(self, timeout=None):
        """The prepared answer."""
        del timeout
        return self.answer

    def shutdown(self):
        """Nothing to end."""

    def take(self):
        """The only frame since the last call."""
        (frame,) = self.sent
        self.sent = []
        return frame


def feedback(draw, node, host):
    """A feedback of any bits."""
    data = bytes(draw.randrange(256) for _ in range(8))
    number = 2 << 24 | draw.randrange(3) << 22 | draw.randrange(64) << 16 | node << 8 | host
    return can.Message(arbitration_id=number, is_extended_id=True, data=data)


def lines():
    """Every case, as comma-separated words: what, arguments, frame."""
    draw = random.Random(SEED)
    recorder = Recorder()
    for model in sorted(MODEL_MIT_POSITION_TABLE):
        reach = [float(table[model]) for table in TABLES]
        words = ",".join(map(repr, reach))
        for _ in range(A_MODEL):
            node = draw.randint(1, 127)
            bus = RobstrideBus("none", {"motor": Motor(node, model)}, calibration={"motor": {"direction": 1, "homing_offset": 0.0}})
            bus.channel_handler = recorder
            # A tenth of the values lies beyond the range, where packing must cut off.
            p, v, t = (draw.uniform(-1.1 * r, 1.1 * r) for r in reach[:3])
            kp, kd = (draw.uniform(-0.05 * r, 1.05 * r) for r in reach[3:])
            bus.write_operation_frame("motor", p, kp, kd, v, t)
            yield f"operation,{node},{words},{p!r},{v!r},{kp!r},{kd!r},{t!r},{recorder.take()}"
            recorder.answer = feedback(draw, node, bus.host_id)
            seen = bus.receive_status_frame("motor")
            frame = f"{recorder.answer.arbitration_id:08X}#{bytes(recorder.answer.data).hex().upper()}"
            yield f"feedback,{node},{words},{frame},{','.join(repr(float(value)) for value in seen)}"
            bus.channel_handler = None
    for node in (1, 2, 55, 126, 127):
        bus = RobstrideBus("none", {"motor": Motor(node, "rs-02")}, calibration={})
        bus.channel_handler = recorder
        recorder.answer = feedback(draw, node, bus.host_id)
        for word, send in (("enable", bus.enable), ("stop", bus.disable)):
            send("motor")
            yield f"{word},{node},{bus.host_id},{recorder.take()}"
        for index, kind, name in (ParameterType.MODE, ParameterType.TORQUE_LIMIT, ParameterType.CAN_TIMEOUT):
            value = draw.uniform(0.0, 17.0) if kind is np.float32 else draw.randrange(4)
            recorder.answer = feedback(draw, node, bus.host_id)
            bus.write("motor", (index, kind, name), value)
            packed = np.array([value], dtype=kind).tobytes().ljust(4, b"\0")
            yield f"write,{node},{bus.host_id},{index},{packed.hex().upper()},{recorder.take()}"
            number = 17 << 24 | node << 8 | bus.host_id
            data = index.to_bytes(2, "little") + b"\0\0" + packed
            recorder.answer = can.Message(arbitration_id=number, is_extended_id=True, data=data)
            seen = bus.read("motor", (index, kind, name))
            yield f"read,{node},{bus.host_id},{index},{recorder.take()}"
            yield f"value,{node},{bus.host_id},{index},{float(seen)!r},{number:08X}#{data.hex().upper()}"
        identity = bytes(draw.randrange(256) for _ in range(8))
        recorder.answer = can.Message(arbitration_id=node << 8 | 0xFE, is_extended_id=True, data=identity)
        assert bus.ping_by_id(node) == (node, bytearray(identity))
        yield f"get_id,{node},{bus.host_id},{recorder.take()}"
        yield f"identity,{node},{identity.hex().upper()},{node << 8 | 0xFE:08X}#{identity.hex().upper()}"
        bus.channel_handler = None
        client = Client(recorder, host_can_id=0xFD)
        for _ in range(20):
            recorder.answer = feedback(draw, node, 0xFD)
            seen = client.enable(node)
            yield f"enable,{node},{0xFD},{recorder.take()}"
            # It reads one bit of two of the mode, and five of the six faults by name.
            faults = sum(error.value for error in seen.errors)
            frame = f"{recorder.answer.arbitration_id:08X}#{bytes(recorder.answer.data).hex().upper()}"
            yield f"state,{node},{faults},{seen.angle!r},{seen.velocity!r},{seen.torque!r},{seen.temp!r},{frame}"


def main():
    """Writes the file, or compares it."""
    # The libraries print what they see.
    screen, sys.stdout = sys.stdout, sys.stderr
    text = "".join(line + "\n" for line in lines())
    sys.stdout = screen
    if sys.argv[1] != "--check":
        with open(sys.argv[1], "w", encoding="ascii") as file:
            file.write(text)
        return
    with open(sys.argv[2], encoding="ascii") as file:
        held = file.read().splitlines()
    for number, (ours, theirs) in enumerate(zip(held, text.splitlines(), strict=True), start=1):
        if ours != theirs:
            sys.exit(f"{sys.argv[2]}:{number}: {ours}\nthe libraries give: {theirs}")
    print(f"ok: {len(held)} frames are those of the libraries")


main()
