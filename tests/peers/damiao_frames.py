"""Frames of Damiao motors as an independent library packs and reads them.

Usage: damiao_frames.py FILE           writes the frames
       damiao_frames.py --check FILE   fails when the library gives other frames than FILE holds

The library is jia-xie's damiao-motor; its encoder and decoder share no line with this project. The test
`frames_are_those_of_an_independent_library` of drivers/ holds the codec against FILE.
"""

import random
import struct
import sys

from damiao_motor.core.motor import MOTOR_TYPE_PRESETS, DaMiaoMotor

SEED = 20_260_214
A_TYPE = 20


class Recorder:
    """A bus that keeps what is sent."""

    def __init__(self):
        self.sent = []

    def send(self, message):
        """Keeps a frame as text."""
        self.sent.append(f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}")

    def take(self):
        """The only frame since the last call."""
        (frame,) = self.sent
        self.sent = []
        return frame


def lines():
    """Every case, as comma-separated words: what, arguments, frame."""
    draw = random.Random(SEED)
    bus = Recorder()
    for kind, preset in MOTOR_TYPE_PRESETS.items():
        ranges = [preset["p_max"], preset["v_max"], preset["t_max"]]
        reach = ",".join(repr(float(r)) for r in ranges)
        for _ in range(A_TYPE):
            motor = DaMiaoMotor(draw.randint(1, 15), draw.randint(0x10, 0x7F), bus, motor_type=kind)
            esc = motor.motor_id
            # A tenth of the values lies beyond the range, where packing must cut off.
            p, v, t = (draw.uniform(-1.1 * r, 1.1 * r) for r in ranges)
            kp, kd = draw.uniform(-20.0, 520.0), draw.uniform(-0.2, 5.2)
            motor.send_cmd_mit(p, v, kp, kd, t)
            yield f"mit,{esc},{reach},{p!r},{v!r},{kp!r},{kd!r},{t!r},{bus.take()}"
            motor.send_cmd_pos_vel(p, abs(v))
            yield f"pos_vel,{esc},{p!r},{abs(v)!r},{bus.take()}"
            data = bytes([draw.choice([0, 1, 8, 9, 10, 11, 12, 13, 14]) << 4 | esc] + [draw.randrange(256) for _ in range(7)])
            seen = motor.decode_sensor_feedback(data)
            words = [seen["status_code"], seen["pos"], seen["vel"], seen["torq"], int(seen["t_mos"]), int(seen["t_rotor"])]
            yield f"feedback,{esc},{motor.feedback_id},{reach},{data.hex().upper()},{','.join(map(repr, words))}"
    for esc in range(1, 16):
        motor = DaMiaoMotor(esc, 0x10 + esc, bus, motor_type="4310")
        for word, send in (
            ("enable", motor.enable), ("disable", motor.disable), ("zero", motor.set_zero_position),
            ("clear", motor.clear_error), ("store", motor.store_parameters), ("refresh", motor.request_motor_feedback),
        ):
            send()
            yield f"{word},{esc},{bus.take()}"
        rid, value = draw.choice([0, 2, 6, 7, 9, 10, 21, 22, 23]), draw.uniform(1.0, 50.0)
        motor.request_register_reading(rid)
        yield f"read,{esc},{rid},{bus.take()}"
        motor.write_register(rid, value)
        packed = struct.pack("<I", int(value)) if rid in (7, 9, 10) else struct.pack("<f", value)
        yield f"write,{esc},{rid},{packed.hex().upper()},{bus.take()}"
        motor.set_can_timeout(100)
        yield f"write,{esc},9,{struct.pack('<I', 2000).hex().upper()},{bus.take()}"
        motor.send_cmd_vel(draw.uniform(-30.0, 30.0))
        yield f"other,{esc},3,{bus.take()}"
        motor.send_cmd_force_pos(draw.uniform(-12.0, 12.0), draw.uniform(0.0, 100.0), draw.random())
        yield f"other,{esc},4,{bus.take()}"


def main():
    """Writes the file, or compares it."""
    text = "".join(line + "\n" for line in lines())
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
