"""Frames of CubeMars AK motors in MIT mode as an independent library packs and reads them.

Usage: cubemars_frames.py FILE           writes the frames
       cubemars_frames.py --check FILE   fails when the library gives other frames than FILE holds

The library is mini-cheetah-motor-driver-socketcan; it shares no line with this project. The test
`frames_are_those_of_an_independent_library` of drivers/ holds the codec against FILE.
"""

import random
import struct
import sys

from motor_driver import canmotorlib
from motor_driver.canmotorlib import CanMotorController

SEED = 20_261_130
A_TYPE = 120
# Those whose axis the library does not turn round.
TYPES = ("AK80_6_V2", "AK80_9_V2", "AK70_10_V1p1")
RANGES = ("P_MAX", "V_MAX", "T_MAX")


class Recorder:
    """A socket that keeps what is sent, and gives back a prepared feedback."""

    def __init__(self):
        self.sent = []
        self.answer = b""

    def send(self, frame):
        """Keeps a frame as text."""
        number, length, data = struct.unpack("=IB3x8s", frame)
        self.sent.append(f"{number:03X}#{data[:length].hex().upper()}")

    def recvfrom(self, size):
        """The prepared feedback, of six bytes."""
        frame = struct.pack("=IB3x6s", 0, 6, self.answer)
        assert len(frame) == size
        return frame, None

    def take(self):
        """All frames since the last call."""
        sent, self.sent = self.sent, []
        return sent


def lines():
    """Every case, as comma-separated words: what, arguments, frame."""
    draw = random.Random(SEED)
    recorder = Recorder()
    CanMotorController.can_socket_declared = True
    CanMotorController.motor_socket = recorder
    canmotorlib.waitOhneSleep = lambda _: None
    for kind in TYPES:
        for _ in range(A_TYPE):
            node = draw.randint(1, 127)
            motor = CanMotorController("none", node, kind)
            reach = [float(motor.motorParams[key]) for key in RANGES]
            words = ",".join(map(repr, reach))
            # A tenth of the values lies beyond the range, where packing must cut off.
            p, v, t = (draw.uniform(-1.1 * r, 1.1 * r) for r in reach)
            kp, kd = draw.uniform(-20.0, 520.0), draw.uniform(-0.2, 5.2)
            recorder.answer = bytes([node]) + bytes(draw.randrange(256) for _ in range(5))
            seen = motor.send_rad_command(p, v, kp, kd, t)
            (frame,) = recorder.take()
            yield f"mit,{node},{words},{p!r},{v!r},{kp!r},{kd!r},{t!r},{frame}"
            yield f"feedback,{node},{words},{recorder.answer.hex().upper()},{','.join(map(repr, seen))}"
    for node in (1, 2, 64, 104, 127):
        motor = CanMotorController("none", node, TYPES[0])
        motor.set_zero_position()
        (frame,) = recorder.take()
        yield f"zero,{node},{frame}"
        motor.enable_motor()
        yield f"enter,{node},{recorder.take()[-1]}"
        motor.disable_motor()
        yield f"exit,{node},{recorder.take()[-1]}"


def main():
    """Writes the file, or compares it."""
    # The library prints what it sees.
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
            sys.exit(f"{sys.argv[2]}:{number}: {ours}\nthe library gives: {theirs}")
    print(f"ok: {len(held)} frames are those of the library")


main()
