"""Our streamer brings somebody else's CANopen devices up as CiA 402 drives and moves them, on the bus that argv names.

The devices are durand's (PyPI, pinned in requirements.txt): its SDO server, its PDO mapping, its SYNC and NMT. Only the
drive profile on top is written here, as small as it can be. Nothing of it shares a line with our simulator.

    durand_drives.py FOLDER_OF_PROGRAMS SETTINGS [INTERFACE]
"""
import importlib.metadata
import json
import logging
import math
import subprocess
import sys
import threading
import time

import can
from durand import MinimalNode, Record, Variable
from durand.datatypes import DatatypeEnum as DT
from durand.network import CANBusNetwork
from durand.object_dictionary import Array
from durand.scheduler import SyncScheduler, set_scheduler

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
SIGNS = (1, -1, 1, 1, -1, 1)
COUNTS_PER_RAD = 101.0 * 131072.0 / (2.0 * math.pi)
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
GOAL = (0.4, -1.37, 1.27, -1.37, -1.47, 0.3)
OFFERS_CSP = 1 << 7
CHECKS = 0


def check(truth, what, seen=""):
    """A check that fails ends the run."""
    global CHECKS
    CHECKS += 1
    if not truth:
        raise AssertionError(f"{what}: {seen}")


class Drive:
    """The state machine of CiA 402 on a device of durand's; a motor that is at its target one SYNC later."""

    STATUS = {"off": 0x0240, "ready": 0x0221, "on": 0x0223, "enabled": 0x1227, "quick": 0x0207}

    def __init__(self, interface, node_id, position, modes=OFFERS_CSP, scale=None):
        bus = can.Bus(interface="socketcan", channel=interface)
        self.node = MinimalNode(CANBusNetwork(bus), node_id)
        self.od, self.state = self.node.object_dictionary, "off"
        variables = {
            0x603F: (DT.UNSIGNED16, "ro", 0), 0x6040: (DT.UNSIGNED16, "rw", 0), 0x6041: (DT.UNSIGNED16, "ro", 0x0240),
            0x605A: (DT.INTEGER16, "rw", 2), 0x6007: (DT.INTEGER16, "rw", 1), 0x6060: (DT.INTEGER8, "rw", 0),
            0x6061: (DT.INTEGER8, "ro", 0), 0x6064: (DT.INTEGER32, "ro", position), 0x607A: (DT.INTEGER32, "rw", position),
            0x6502: (DT.UNSIGNED32, "ro", modes),
        }
        for index, (kind, access, value) in variables.items():
            self.od[index] = Variable(kind, access, value)
        self.od[0x1000] = Variable(DT.UNSIGNED32, "ro", 0x0002_0192)
        self.od[0x1016] = Array(Variable(DT.UNSIGNED32, "rw"), length=1)
        period = Record()
        period[1], period[2] = Variable(DT.UNSIGNED8, "rw", 1), Variable(DT.INTEGER8, "rw", -3)
        self.od[0x60C2] = period
        # What the drive states of its scale: index to numerator and denominator. Devices need not state anything.
        for index, (above, below) in (scale or {}).items():
            ratio = Record()
            ratio[1], ratio[2] = Variable(DT.UNSIGNED32, "rw", above), Variable(DT.UNSIGNED32, "rw", below)
            self.od[index] = ratio
        self.od.update_callbacks[(0x6040, 0)].add(self.control)
        self.od.update_callbacks[(0x6060, 0)].add(lambda mode: self.od.write(0x6061, 0, mode))
        self.od.update_callbacks[(0x607A, 0)].add(self.target)

    def control(self, word):
        """Transitions by the controlword."""
        if word & 0x02 == 0:
            self.state = "off"
        elif word & 0x04 == 0:
            self.state = "quick" if self.state in ("enabled", "quick") else "off"
        elif word & 0x0F == 0x06 and self.state != "quick":
            self.state = "ready"
        elif word & 0x0F == 0x07 and self.state in ("ready", "on", "enabled"):
            self.state = "on"
        elif word & 0x0F == 0x0F and self.state in ("on", "enabled"):
            self.state = "enabled"
        self.od.write(0x6041, 0, self.STATUS[self.state])

    def target(self, counts):
        """Follows, when enabled."""
        if self.state == "enabled":
            self.od.write(0x6064, 0, counts)

    def position_rad(self, sign):
        """Where the joint is."""
        return self.od.read(0x6064, 0) * sign / COUNTS_PER_RAD

    def refuse(self, index, subindex):
        """From now on a write of this object is aborted."""
        def abort(_value):
            raise ValueError("refused on purpose")
        self.od.validate_callbacks[(index, subindex)].add(abort)

    def close(self):
        """Leaves the bus."""
        self.od.write(0x1017, 0, 0)
        self.node.network.stop()
        self.node.network._bus.shutdown()


class Arm:
    """Our own programs."""

    def __init__(self, programs, settings):
        self.programs, self.settings, self.running = programs, settings, []

    def start(self, name, *words):
        """Starts a program; `ready` is awaited by its first line."""
        process = subprocess.Popen(
            [f"{self.programs}/{name}", "--settings", self.settings, *words], stdout=subprocess.PIPE, text=True
        )
        self.running.append(process)
        return process

    def cli(self, *words):
        """One command; its exit code, output and complaint."""
        done = subprocess.run(
            [f"{self.programs}/taustream", "--settings", self.settings, *words], capture_output=True, text=True
        )
        return done.returncode, done.stdout, done.stderr

    def done(self, *words):
        """One command that must succeed."""
        code, out, err = self.cli(*words)
        check(code == 0, f"taustream {' '.join(words)}", err)
        return out

    def status(self):
        """The newest report."""
        return json.loads(self.done("status", "--json"))

    def await_status(self, what, wanted, limit_s=60.0):
        """Waits for a report."""
        until = time.monotonic() + limit_s
        while not wanted(status := self.status()):
            check(time.monotonic() < until, f"waited for {what}", json.dumps(status)[:2000])
            time.sleep(0.1)
        return status

    def end(self):
        """Ends what runs, newest first."""
        for process in reversed(self.running):
            process.terminate()
            process.wait(30)
        self.running = []


def drives(interface, **of_third):
    """Six drives; the third may differ."""
    counts = [round(angle * COUNTS_PER_RAD) * sign for angle, sign in zip(HOME, SIGNS)]
    return [Drive(interface, n, counts[n - 1], **(of_third if n == 3 else {})) for n in range(1, 7)]


def moves_them(arm, interface):
    """Enable, two plans, disable: the devices are where the goals are."""
    # Five state no scale; the third states the one of the settings, in other numbers.
    devices = drives(interface, scale={0x608F: (262144, 2), 0x6091: (202, 2), 0x6092: (101 * 131072, 1)})
    check("ready" in arm.start("taustream-streamer", "--link", "socketcan").stdout.readline(), "streamer")
    check("ready" in arm.start("taustream-planner").stdout.readline(), "planner")
    arm.await_status("configured drives", lambda s: s["phase"] == "disabled")
    for device in devices:
        period_s = device.od.read(0x60C2, 1) * 10.0 ** device.od.read(0x60C2, 2)
        check(device.od.read(0x6060, 0) == 8 and abs(period_s - 0.02) < 1e-9, "mode and period were configured", period_s)
        check(device.od.read(0x605A, 0) == 6 and device.od.read(0x6007, 0) == 3, "the stated reaction was configured")
        check(device.node.nmt.state == 5, "started by NMT")
    arm.done("enable")
    check(all(device.state == "enabled" for device in devices), "energised", [d.state for d in devices])
    arm.done("speed", "50")
    for goal in (GOAL, HOME):
        arm.done("replan", "--goal", ",".join(map(str, goal)), "--seed", "1")
        arm.await_status("the goal", lambda s: s["phase"] == "holding" and s["motion"]["at_s"] >= s["motion"]["duration_s"])
        time.sleep(0.5)
        reached = [device.position_rad(sign) for device, sign in zip(devices, SIGNS)]
        check(max(abs(a - b) for a, b in zip(reached, goal)) < 1e-5, "the devices are at the goal", reached)
    arm.done("disable")
    check(all(device.state != "enabled" for device in devices), "de-energised", [d.state for d in devices])
    status = arm.status()
    check(status["frames_lost"] == 0 and status["guard_trips"] == 0, "without losses", status["frames_lost"])
    arm.end()
    for device in devices:
        device.close()


def is_refused(arm, devices, words):
    """The fault of a bring-up that must fail names joint, object and reason; nothing was energised."""
    check("ready" in arm.start("taustream-streamer", "--link", "socketcan").stdout.readline(), "streamer")
    fault = arm.await_status("the refusal", lambda s: s["phase"] == "fault")["fault"]["message"]
    check(all(word in fault for word in words), f"refused by {words}", fault)
    code, _, err = arm.cli("enable")
    check(code == 1 and "fault" in err, "enable is refused", err)
    check(all(device.state == "off" for device in devices), "nothing was energised", [d.state for d in devices])
    arm.end()
    for device in devices:
        device.close()


def main():
    """A motion, and four refusals."""
    programs, settings = sys.argv[1:3]
    interface = sys.argv[3] if len(sys.argv) > 3 else "vcan0"
    # A PDO that is switched off hears SYNC all the same in durand, and complains of it.
    logging.getLogger("durand").setLevel(logging.CRITICAL)
    scheduler = SyncScheduler()
    set_scheduler(scheduler)
    threading.Thread(target=scheduler.run, daemon=True).start()
    began, arm = time.monotonic(), Arm(programs, settings)
    try:
        moves_them(arm, interface)
        is_refused(arm, drives(interface, modes=1), ("elbow", "0x6502", "cyclic synchronous position"))
        is_refused(arm, drives(interface, scale={0x6091: (50, 1)}), ("elbow", "0x6091", "50", "101"))
        is_refused(arm, drives(interface, scale={0x608F: (131072, 0)}), ("elbow", "0x608F", "zero"))
        devices = drives(interface)
        devices[4].refuse(0x1600, 2)
        is_refused(arm, devices, ("wrist_2", "0x1600:02", "0x08000020"))
    finally:
        arm.end()
    print(f"DURAND DRIVES OK: {CHECKS} checks, durand {importlib.metadata.version('durand')}, {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
