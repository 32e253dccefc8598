"""An independent master drives the simulated Damiao motors on a CAN interface.

Usage: damiao_master.py SERVOSIM SETTINGS [INTERFACE]

The master is jia-xie's damiao-motor with python-can: its packing, registers and states share no line with this
project. Each check prints one line; one that fails, or an exception, ends in status 1. Nothing is skipped.
"""

import contextlib
import io
import subprocess
import sys
import time

import can
from damiao_motor import DaMiaoController
from facts import check, conclude, within


class Ear:
    """Everything on the bus, heard apart from the master."""

    def __init__(self, interface):
        self.bus = can.Bus(channel=interface, interface="socketcan")
        self.seen = []
        self.notifier = can.Notifier(self.bus, [self.seen.append])

    def count(self, identifier):
        """Frames with this identifier so far."""
        return sum(message.arbitration_id == identifier for message in list(self.seen))

    def close(self):
        """Ends listening."""
        self.notifier.stop()
        self.bus.shutdown()


def read(motor, register):
    """A register from the motor, not from the library's memory."""
    motor.registers.pop(register, None)
    return motor.get_register(register)


def status(motor):
    """The status that the motor gives when it is asked."""
    motor.state = {}
    motor.request_motor_feedback()
    within(1.0, lambda: motor.get_states())
    return motor.get_states().get("status", "silent")


def mode(motor, name):
    """The library's own way to a mode; it prints, which is kept from the list of checks."""
    motor.registers.pop(10, None)
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            motor.ensure_control_mode(name)
        except RuntimeError:
            pass  # It verifies against its memory of the register; the motor is asked below.
    return read(motor, 10)


def stream(seconds, send):
    """Commands at 200 Hz; `send(t)` sends one."""
    sent, began = 0, time.monotonic()
    while (t := time.monotonic() - began) < seconds:
        send(t)
        sent += 1
        time.sleep(0.005)
    return sent


def registers(motor):
    """Reading, writing, refusing."""
    for number, value in ((7, 0x11), (8, 1), (9, 0), (10, 1), (21, 12.5), (22, 45.0), (23, 54.0), (35, 4)):
        got = read(motor, number)
        check(got == value, f"register {number} is {value}", got)
    everything = motor.read_all_registers(timeout=0.2)
    numbers = [number for number, value in everything.items() if isinstance(value, (int, float))]
    check(len(numbers) >= 40, "registers that the library's table knows are there", len(numbers))
    motor.set_can_timeout(200)
    check(within(1, lambda: read(motor, 9) == 4000), "TIMEOUT of 200 ms is 4000 units", read(motor, 9))
    for number, value in ((2, 20.0), (5, 1.0), (10, 7), (21, -1.0)):
        before = read(motor, number)
        motor.write_register(number, value)
        time.sleep(0.05)
        check(read(motor, number) == before, f"register {number} does not take {value}", read(motor, number))


def settled(ear):
    """What the ear has counted, once everything sent so far is answered: it hears on a thread of its own."""
    time.sleep(0.1)
    return ear.count(0x11)


def modes(ear, motor):
    """Modes are taken, and a command of another mode is ignored."""
    check(mode(motor, "POS_VEL") == 2, "POS_VEL is taken")
    check(mode(motor, "VEL") == 3, "VEL is taken")
    check(mode(motor, "MIT") == 1, "MIT is taken again")
    before = settled(ear)
    motor.send_raw(bytes(8), arbitration_id=0x101)
    motor.send_raw(bytes(8), arbitration_id=0x201)
    time.sleep(0.1)
    check(ear.count(0x11) == before, "commands of other modes are not answered", ear.count(0x11) - before)


def energise(ear, motor):
    """Enable, one answer a command, motion by MIT commands."""
    check(status(motor) == "DISABLED", "disabled at first", status(motor))
    motor.enable()
    check(within(1, lambda: motor.get_states().get("status") == "ENABLED"), "enabled", motor.get_states().get("status"))
    at = motor.get_states()["pos"]
    before = settled(ear)
    sent = stream(1.5, lambda t: motor.send_cmd_mit(at + 0.4 * min(t, 1.0), 0.4 if t < 1.0 else 0.0, 300.0, 4.0))
    time.sleep(0.05)
    answers = ear.count(0x11) - before
    check(answers == sent, "one feedback a command", f"{answers} for {sent}")
    moved = motor.get_states()["pos"] - at
    check(abs(moved - 0.4) < 0.02, "MIT commands move the joint by 0.4 rad", moved)
    check(abs(motor.get_states()["vel"]) < 0.1, "where it rests", motor.get_states()["vel"])
    stream(0.3, lambda t: motor.send_cmd_mit(0.0, 0.0, 0.0, 1.0, 6.0))
    check(motor.get_states()["vel"] > 0.5, "torque without stiffness drives it on", motor.get_states()["vel"])
    stream(0.5, lambda t: motor.send_cmd_mit(0.0, 0.0, 0.0, 5.0))
    check(abs(motor.get_states()["vel"]) < 0.3, "damping alone brings it to rest", motor.get_states()["vel"])
    before = settled(ear)
    motor.request_motor_feedback()
    time.sleep(0.1)
    check(ear.count(0x11) == before + 1, "one feedback for a refresh, and none by itself", ear.count(0x11) - before)


def watchdog(motor):
    """TIMEOUT without commands."""
    stream(0.2, lambda t: motor.send_cmd_mit(0.0, 0.0, 0.0, 1.0))
    check(status(motor) == "ENABLED", "enabled while commands come", status(motor))
    time.sleep(0.5)
    check(status(motor) == "LOST_COMM", "LOST_COMM 500 ms after the last, at a TIMEOUT of 200 ms", status(motor))
    motor.enable()
    time.sleep(0.05)
    check(status(motor) == "LOST_COMM", "enable alone does not bring it back", status(motor))
    motor.clear_error()
    check(within(1, lambda: status(motor) == "DISABLED"), "clear does, disabled", status(motor))


def errors(simulator, motor):
    """A fault of the motor, and its remedy."""
    motor.enable()
    for name, code in (("OVER_CURRENT", "0xA"), ("ROTOR_OVER_TEMP", "0xC")):
        simulator.stdin.write(f"fault joint=1,kind=fault,value={code}\n")
        simulator.stdin.flush()
        check(within(2, lambda: status(motor) == name), f"fault {name} is reported", status(motor))
        motor.enable()
        time.sleep(0.05)
        check(status(motor) == name, "it stays when enabled", status(motor))
        simulator.stdin.write("clear\n")
        simulator.stdin.flush()
        time.sleep(0.1)
        motor.clear_error()
        check(within(1, lambda: status(motor) == "DISABLED"), "and goes when cleared", status(motor))


def pos_vel(motor):
    """Position with a largest speed."""
    check(mode(motor, "POS_VEL") == 2, "POS_VEL is taken")
    motor.enable()
    within(1, lambda: status(motor) == "ENABLED")
    at, speeds = motor.get_states()["pos"], []

    def send(_):
        motor.send_cmd_pos_vel(at - 0.3, 0.5)
        speeds.append(abs(motor.get_states().get("vel", 0.0)))

    stream(1.5, send)
    moved = motor.get_states()["pos"] - at
    check(abs(moved + 0.3) < 0.01, "POS_VEL commands move the joint by -0.3 rad", moved)
    check(0.3 < max(speeds) < 0.7, "at the speed that they state", max(speeds))
    motor.disable()
    check(within(1, lambda: status(motor) == "DISABLED"), "disabled", status(motor))
    check(mode(motor, "MIT") == 1, "MIT is taken again")


def zero_and_scale(simulator, motor):
    """Zero here, mapping ranges, flash."""
    motor.set_zero_position()
    time.sleep(0.05)
    status(motor)
    check(abs(motor.get_states()["pos"]) < 0.001, "zero is here", motor.get_states()["pos"])
    motor.write_register(21, 6.25)
    check(within(1, lambda: read(motor, 21) == 6.25), "PMAX is taken", read(motor, 21))
    status(motor)
    misread = motor.get_states()["pos"]
    motor.set_p_limits(-6.25, 6.25)
    status(motor)
    check(abs(motor.get_states()["pos"]) < 0.001, "and scales the feedback", f"{misread} before")
    restart(simulator, motor)
    check(read(motor, 21) == 12.5 and read(motor, 9) == 0, "not stored, it is gone with the power", read(motor, 21))
    motor.write_register(21, 6.25)
    motor.store_parameters()
    time.sleep(0.1)
    restart(simulator, motor)
    check(read(motor, 21) == 6.25, "stored, it is kept", read(motor, 21))


def restart(simulator, motor):
    """A dip of the motor's supply."""
    for order in ("fault joint=1,kind=restart\n", "clear\n"):
        simulator.stdin.write(order)
        simulator.stdin.flush()
        time.sleep(0.2)
    within(2, lambda: status(motor) == "DISABLED")


def main():
    """All checks, in the order of a commissioning."""
    servosim, settings = sys.argv[1:3]
    interface = sys.argv[3] if len(sys.argv) > 3 else "vcan0"
    ear = Ear(interface)
    simulator = subprocess.Popen(
        [servosim, "--settings", settings, "--link", "socketcan"], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True
    )
    try:
        check("ready" in simulator.stdout.readline(), "the simulator serves")
        time.sleep(0.2)
        controller = DaMiaoController(channel=interface, bustype="socketcan")
        motor = controller.add_motor(motor_id=1, feedback_id=0x11, motor_type="8009")
        other = controller.add_motor(motor_id=4, feedback_id=0x14, motor_type="4310")
        registers(motor)
        modes(ear, motor)
        energise(ear, motor)
        watchdog(motor)
        errors(simulator, motor)
        pos_vel(motor)
        zero_and_scale(simulator, motor)
        check(read(other, 22) == 30.0 and status(other) == "DISABLED", "the other motor is as it was", status(other))
        controller.shutdown()
        check(simulator.poll() is None, "the simulator still serves")
    finally:
        simulator.terminate()
        code = simulator.wait(10)
        ear.close()
    check(code == 0, "the simulator ends orderly", code)
    conclude("DAMIAO MASTER")


if __name__ == "__main__":
    main()
