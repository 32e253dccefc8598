"""An independent CANopen master drives the simulated CiA 402 drives on a CAN interface.

Usage: canopen_master.py SERVOSIM SETTINGS [INTERFACE]

The master is christiansandberg's canopen with python-can: its SDO client, PDO mapping, NMT, EMCY consumer and CiA 402
state machine share no line with this project. Each check prints one line; one that fails, or an
exception, ends in status 1. Nothing is skipped: what cannot be tried is a failure.
"""

import math
import subprocess
import sys
import threading
import time

import canopen
from canopen import objectdictionary as od
from canopen.objectdictionary import datatypes as dt
from canopen.profiles.p402 import BaseNode402
from facts import check, conclude, within


def counts_per_rad(node):
    """Encoder counts a radian of the link, as the drive states them."""
    encoder = node.sdo[0x608F][1].raw / node.sdo[0x608F][2].raw
    return encoder * node.sdo[0x6091][1].raw / node.sdo[0x6091][2].raw / (2.0 * math.pi)


def dictionary():
    """The objects used here, written from CiA 301 and 402 and not from the simulator."""
    all_objects = od.ObjectDictionary()

    def variable(parent, name, index, sub, kind):
        entry = od.ODVariable(name, index, sub)
        entry.data_type, entry.access_type, entry.pdo_mappable = kind, "rw", True
        parent.add_member(entry) if parent is not None else all_objects.add_object(entry)

    def record(index, name, members):
        parent = od.ODRecord(name, index)
        for sub, kind in members.items():
            variable(parent, f"{name} {sub}", index, sub, kind)
        all_objects.add_object(parent)

    u8, u16, u32 = dt.UNSIGNED8, dt.UNSIGNED16, dt.UNSIGNED32
    i8, i16, i32 = dt.INTEGER8, dt.INTEGER16, dt.INTEGER32
    for index, kind in {
        0x1000: u32, 0x1001: u8, 0x1005: u32, 0x1006: u32, 0x1008: dt.VISIBLE_STRING, 0x1009: dt.VISIBLE_STRING,
        0x100A: dt.VISIBLE_STRING, 0x1014: u32, 0x1017: u16, 0x1019: u8, 0x2002: u16, 0x6007: i16, 0x603F: u16,
        0x6040: u16, 0x6041: u16, 0x605A: i16, 0x605B: i16, 0x605C: i16, 0x605D: i16, 0x605E: i16, 0x6060: i8,
        0x6061: i8, 0x6062: i32, 0x6064: i32, 0x6065: u32, 0x606C: i32, 0x6077: i16, 0x607A: i32, 0x6085: u32,
        0x60B1: i32, 0x60B2: i16, 0x60F4: i32, 0x6502: u32,
    }.items():
        variable(None, f"object {index:04X}", index, 0, kind)
    record(0x1003, "history", {0: u8, **{sub: u32 for sub in range(1, 9)}})
    record(0x1010, "store", {0: u8, 1: u32})
    record(0x1016, "consumers", {0: u8, 1: u32, 2: u32})
    record(0x1018, "identity", {0: u8, 1: u32, 2: u32, 3: u32, 4: u32})
    record(0x60C2, "interpolation", {0: u8, 1: u8, 2: i8})
    for index, name in ((0x608F, "encoder resolution"), (0x6091, "gear ratio")):
        record(index, name, {0: u8, 1: u32, 2: u32})
    record(0x607D, "soft limits", {0: u8, 1: i32, 2: i32})
    for n in range(4):
        record(0x1400 + n, f"RPDO{n + 1}", {0: u8, 1: u32, 2: u8, 5: u16})
        record(0x1800 + n, f"TPDO{n + 1}", {0: u8, 1: u32, 2: u8, 3: u16, 5: u16, 6: u8})
        for base in (0x1600, 0x1A00):
            record(base + n, f"mapping {base + n:04X}", {sub: u8 if sub == 0 else u32 for sub in range(9)})
    return all_objects


class Bus:
    """The network with everything that was seen on it."""

    def __init__(self, interface):
        self.network = canopen.Network()
        self.network.connect(channel=interface, interface="socketcan")
        self.seen = []
        self.network.notifier.add_listener(self.seen.append)
        self.sync_on, self.sync_thread = False, None

    def node(self, node_id):
        """A CiA 402 node of this network."""
        node = BaseNode402(node_id, dictionary())
        self.network.add_node(node)
        node.sdo.RESPONSE_TIMEOUT, node.sdo.MAX_RETRIES = 1.0, 1
        return node

    def count(self, cob_id):
        """How many frames with this identifier were seen so far."""
        return sum(message.arbitration_id == cob_id for message in list(self.seen))

    def last(self, cob_id):
        """Data of the newest frame with this identifier."""
        return next((bytes(m.data) for m in reversed(list(self.seen)) if m.arbitration_id == cob_id), None)

    def start_sync(self, period_s, each=None):
        """SYNC from a thread; `each(n)` is called before SYNC number n."""
        self.sync_on = True

        def run():
            n, due = 0, time.monotonic()
            while self.sync_on:
                if each is not None:
                    each(n)
                self.network.send_message(0x80, b"")
                n, due = n + 1, due + period_s
                time.sleep(max(0.0, due - time.monotonic()))

        self.sync_thread = threading.Thread(target=run, daemon=True)
        self.sync_thread.start()

    def stop_sync(self):
        """Ends SYNC."""
        self.sync_on = False
        self.sync_thread.join()


def aborts(action, *codes):
    """The abort code that an SDO transfer met, as text; checks happen at the caller."""
    try:
        action()
    except canopen.SdoAbortedError as error:
        return error.code in codes, f"0x{error.code:08X}"
    except canopen.SdoCommunicationError as error:
        return False, str(error)
    return False, "no abort"


def network_management(bus, node):
    """NMT, boot-up and heartbeat."""
    for command in ("RESET COMMUNICATION", "RESET"):
        before = bus.count(0x700 + node.id)
        node.nmt.state = command
        check(within(3, lambda: bus.count(0x700 + node.id) > before), f"NMT {command}: a frame on 0x700 + node")
        check(bus.last(0x700 + node.id) == b"\x00", f"NMT {command}: it is the boot-up")
    node.sdo[0x1017].raw = 50
    for command, state in (("OPERATIONAL", 0x05), ("STOPPED", 0x04), ("PRE-OPERATIONAL", 0x7F)):
        node.nmt.state = command
        time.sleep(0.02)
        before = bus.count(0x700 + node.id)
        check(within(1, lambda: bus.count(0x700 + node.id) >= before + 3), f"heartbeats go on in {command}")
        check(bus.last(0x700 + node.id) == bytes([state]), f"heartbeat states 0x{state:02X} in {command}")
        if command == "STOPPED":
            try:
                node.sdo[0x1000].raw
                check(False, "no SDO in NMT stopped")
            except canopen.SdoCommunicationError as error:
                check(not isinstance(error, canopen.SdoAbortedError), "no SDO in NMT stopped", error)
    stamps = [m.timestamp for m in bus.seen if m.arbitration_id == 0x700 + node.id][-3:]
    check(stamps[-1] - stamps[0] > 0.08, "heartbeats are not sent more often than asked", stamps[-1] - stamps[0])
    node.sdo[0x1017].raw = 0
    time.sleep(0.1)
    before = bus.count(0x700 + node.id)
    time.sleep(0.2)
    check(bus.count(0x700 + node.id) == before, "heartbeat period 0 ends the heartbeat")


def reading_and_writing(bus, node):
    """SDO: expedited, segmented, abort codes, odd clients."""
    check(node.sdo[0x1000].raw == 0x00020192, "0x1000 names a CiA 402 servo drive", hex(node.sdo[0x1000].raw))
    check(node.sdo[0x1018][0].raw == 4 and node.sdo[0x1018][4].raw == node.id, "0x1018 identity, expedited")
    check(node.sdo[0x6502].raw & 0x80 != 0, "0x6502 offers CSP", hex(node.sdo[0x6502].raw))
    name = node.sdo[0x1008].raw
    check(len(name) > 7 and "simulated" in name, "0x1008 read in segments", name)
    check(node.sdo.upload(0x1009, 0) == b"none", "0x1009, four characters")
    check(len(node.sdo[0x100A].raw) > 4, "0x100A read in segments", node.sdo[0x100A].raw)
    node.sdo[0x6065].raw = 0x12345678
    check(node.sdo[0x6065].raw == 0x12345678, "u32 written and read back")
    node.sdo[0x6065].raw = 0xFFFFFFFF
    node.sdo[0x60C2][2].raw = -2
    check(node.sdo[0x60C2][2].raw == -2, "i8 below zero written and read back")
    u, d = node.sdo.upload, node.sdo.download
    for what, action, codes in (
        ("read of an object that is not there", lambda: u(0x5FFF, 0), (0x06020000,)),
        ("write of an object that is not there", lambda: d(0x5FFF, 0, b"\0"), (0x06020000,)),
        ("read of a subindex that is not there", lambda: u(0x1018, 5), (0x06090011,)),
        ("read of a subindex of a plain variable", lambda: u(0x6041, 1), (0x06090011,)),
        ("write of a read-only object", lambda: d(0x6041, 0, b"\0\0"), (0x06010002,)),
        ("write of a constant", lambda: d(0x1000, 0, b"\0\0\0\0"), (0x06010002,)),
        ("read of a write-only object", lambda: u(0x2002, 0), (0x06010001,)),
        ("a write that is too long", lambda: d(0x6040, 0, b"\0\0\0\0"), (0x06070012, 0x06070010)),
        ("a write that is too short", lambda: d(0x6065, 0, b"\0\0"), (0x06070013, 0x06070010)),
        ("a mode that is not offered", lambda: d(0x6060, 0, b"\x02"), (0x06090030,)),
        ("a mode that is below the range", lambda: d(0x6060, 0, b"\x80"), (0x06090030, 0x06090032)),
        ("quick stop option 4", lambda: d(0x605A, 0, b"\x04\0"), (0x06090030,)),
        ("a history that is cleared with 1", lambda: d(0x1003, 0, b"\x01"), (0x06090030,)),
        ("a store without the signature", lambda: d(0x1010, 1, b"\x01\0\0\0"), (0x08000020, 0x08000021, 0x08000022)),
        ("one node watched twice", lambda: (d(0x1016, 1, b"\x64\0\x55\0"), d(0x1016, 2, b"\x64\0\x55\0")), (0x06040043,)),
        ("an empty history's first entry", lambda: u(0x1003, 1), (0x08000024, 0x08000000)),
    ):
        good, seen = aborts(action, *codes)
        check(good, f"SDO abort for {what}", seen)
    d(0x1016, 1, b"\0\0\0\0")
    with node.sdo.open(0x1008, 0, "rb", block_transfer=True) as file:
        name = file.read()
    check(name == b"taustream simulated drive", "block upload, with its check sum", name)
    raw_aborts(bus, node)


def raw_aborts(bus, node):
    """What the library's client cannot be made to send."""

    def ask(data):
        before = bus.count(0x580 + node.id)
        bus.network.send_message(0x600 + node.id, bytes(data))
        return bus.last(0x580 + node.id) if within(0.5, lambda: bus.count(0x580 + node.id) > before) else None

    started = ask([0x40, 0x08, 0x10, 0, 0, 0, 0, 0])
    check(started is not None and started[0] == 0x41, "segmented upload announces its size", started.hex())
    wrong = ask([0x70, 0, 0, 0, 0, 0, 0, 0])
    check(wrong == bytes.fromhex("80081000 00000305"), "first segment asked with the wrong toggle", wrong.hex())
    stray = ask([0x60, 0, 0, 0, 0, 0, 0, 0])
    check(stray is not None and stray[0] == 0x80 and stray[4:] == bytes.fromhex("01000405"), "segment without a transfer",
          stray.hex())
    big = ask([0x21, 0x65, 0x60, 0, 8, 0, 0, 0])
    check(big in (bytes.fromhex("8065600012000706"), bytes.fromhex("8065600010000706")), "eight bytes for a u32", big.hex())
    segmented = ask([0x21, 0x65, 0x60, 0, 4, 0, 0, 0]), ask([0x07, 0x44, 0x33, 0x22, 0x11, 0, 0, 0])
    check(segmented[0] == bytes.fromhex("6065600000000000") and segmented[1] == bytes.fromhex("2000000000000000")
          and node.sdo[0x6065].raw == 0x11223344, "four bytes written by segments", segmented)
    node.sdo[0x6065].raw = 0xFFFFFFFF
    unsized = ask([0x22, 0x17, 0x10, 0, 0, 0, 0, 0])
    check(unsized == bytes.fromhex("6017100000000000"), "expedited write whose size is not stated", unsized.hex())
    unknown = ask([0xE0, 0x17, 0x10, 0, 0, 0, 0, 0])
    check(unknown == bytes.fromhex("8017100001000405"), "unknown SDO command", unknown.hex())
    before = bus.count(0x580 + node.id)
    bus.network.send_message(0x600 + node.id, b"\x40\x00\x10\x00")
    bus.network.send_message(0x600 + node.id, b"\x80\x00\x10\x00\x00\x00\x00\x08")
    time.sleep(0.1)
    check(bus.count(0x580 + node.id) == before, "neither a short request nor an abort is answered")


def map_pdo(pdo, cob_id, kind, entries, event_ms=None, inhibit=None):
    """Maps a PDO with the library, which writes in the order of CiA 301."""
    pdo.clear()
    for index, sub, bits in entries:
        pdo.add_variable(index, sub, bits)
    pdo.cob_id, pdo.trans_type, pdo.enabled = cob_id, kind, True
    pdo.event_timer, pdo.inhibit_time = event_ms, inhibit
    pdo.rtr_allowed = cob_id & 0x80 == 0
    pdo.save()


def mapping_rules(node):
    """Remapping is refused where CiA 301 refuses it."""
    node.nmt.state = "PRE-OPERATIONAL"
    d = node.sdo.download
    off = (0x80000200 + node.id).to_bytes(4, "little")
    on = (0x200 + node.id).to_bytes(4, "little")
    d(0x1400, 1, off)
    d(0x1600, 0, b"\0")
    for what, entry, codes in (
        ("a read-only object in an RPDO", 0x60410010, (0x06040041, 0x06010002)),
        ("an object that is not there", 0x5FFF0010, (0x06020000, 0x06040041)),
        ("an object with a wrong width", 0x607A0010, (0x06040041, 0x06070010, 0x06040042)),
        ("an object that cannot be mapped", 0x10180120, (0x06040041,)),
    ):
        good, seen = aborts(lambda: d(0x1600, 1, entry.to_bytes(4, "little")), *codes)
        check(good, f"mapping refused: {what}", seen)
    for sub, entry in enumerate((0x60400010, 0x607A0020, 0x60B10020), 1):
        d(0x1600, sub, entry.to_bytes(4, "little"))
    good, seen = aborts(lambda: d(0x1600, 0, b"\x03"), 0x06040042)
    check(good, "mapping refused: 80 bits", seen)
    d(0x1600, 0, b"\x02")
    good, seen = aborts(lambda: d(0x1600, 1, b"\x10\0\x40\x60"), 0x06010000, 0x06010002, 0x06040041, 0x08000022)
    check(good, "mapping refused: an entry of a mapping in force", seen)
    d(0x1400, 1, on)
    good, seen = aborts(lambda: d(0x1600, 0, b"\0"), 0x06010000, 0x06040041, 0x08000022, 0x08000020, 0x06010002)
    check(good, "mapping refused: while the PDO exists", seen)
    good, seen = aborts(lambda: d(0x1400, 1, (0x333).to_bytes(4, "little")), 0x06090030, 0x08000022, 0x06010000)
    check(good, "an identifier changes only while the PDO is off", seen)
    d(0x1400, 1, off)
    for cob_id in (0x000, 0x001, 0x101, 0x581, 0x601, 0x701, 0x7FF):
        good, seen = aborts(lambda: d(0x1400, 1, cob_id.to_bytes(4, "little")), 0x06090030, 0x06040043)
        check(good, f"restricted identifier 0x{cob_id:03X} refused", seen)
    good, seen = aborts(lambda: d(0x1400, 2, b"\xf5"), 0x06090030)
    check(good, "reserved transmission type 245 refused", seen)


def remap(node):
    """A mapping unlike our own master's: three objects out, two TPDOs back, one on every second SYNC."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.rpdo.read()
    node.tpdo.read()
    for n in (2, 3, 4):
        node.rpdo[n].enabled = node.tpdo[n].enabled = False
        node.rpdo[n].save()
        node.tpdo[n].save()
    map_pdo(node.rpdo[1], 0x200 + node.id, 1, [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32)])
    map_pdo(node.tpdo[1], 0x180 + node.id, 1, [(0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32)])
    map_pdo(node.tpdo[2], 0x280 + node.id, 2, [(0x606C, 0, 32), (0x6077, 0, 16), (0x603F, 0, 16)])
    for pdo, count in ((node.rpdo[1], 3), (node.tpdo[1], 3), (node.tpdo[2], 3)):
        check(pdo.map_array[0].raw == count, "mapping read back")


def sync_types(bus, node):
    """Transmission types 1 and 2; nothing without SYNC."""
    node.nmt.state = "OPERATIONAL"
    time.sleep(0.1)
    one, two = 0x180 + node.id, 0x280 + node.id
    before = bus.count(one), bus.count(two)
    time.sleep(0.1)
    check((bus.count(one), bus.count(two)) == before, "synchronous TPDOs wait for SYNC")
    for _ in range(10):
        bus.network.send_message(0x80, b"")
        time.sleep(0.02)
    check(bus.count(one) - before[0] == 10, "type 1 answers every SYNC", bus.count(one) - before[0])
    check(bus.count(two) - before[1] == 5, "type 2 answers every second SYNC", bus.count(two) - before[1])
    check(len(bus.last(one)) == 7 and len(bus.last(two)) == 8, "TPDO lengths follow the mapping")
    node.nmt.state = "PRE-OPERATIONAL"
    time.sleep(0.05)
    before = bus.count(one)
    bus.network.send_message(0x80, b"")
    time.sleep(0.05)
    check(bus.count(one) == before, "no PDO in pre-operational")


def enable_and_follow(bus, node, period_s):
    """CSP through profiles.p402, then a sine."""
    node.sdo[0x60C2][1].raw = round(period_s * 1000)
    node.sdo[0x60C2][2].raw = -3
    node.sdo[0x605A].raw = 6
    node.sdo[0x6007].raw = 3
    start = node.sdo[0x6064].raw
    rpdo = node.rpdo[1]
    rpdo[0x6040].raw, rpdo[0x6060].raw, rpdo[0x607A].raw = 0, 8, start
    plan = {"at": lambda n: start, "log": [], "scale": counts_per_rad(node)}

    def each(n):
        rpdo[0x607A].raw = target = plan["at"](n)
        position = node.tpdo_values.get(0x6064)
        plan["log"].append((target, position))
        if not plan.get("mute"):
            rpdo.transmit()

    # BaseNode402 sends the controlword itself at a change; the stream only carries it on.
    node.setup_402_state_machine(read_pdos=False)
    node.nmt.state = "OPERATIONAL"
    bus.start_sync(period_s, each)
    check(within(1, lambda: node.tpdo_values.get(0x6061) == 8), "mode 8 set by RPDO and shown in the TPDO")
    check(node.state == "SWITCH ON DISABLED", "state after start", node.state)
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
        check(node.state == state, f"p402 reaches {state}", hex(node.statusword))
    check(within(1, lambda: node.statusword & 0x1000), "bit 12: the drive follows", hex(node.statusword))
    amplitude, omega = 0.05 * plan["scale"], 2.0 * math.pi * 0.5
    begin = len(plan["log"])
    plan["at"] = lambda n: start + round(amplitude * (1.0 - math.cos(omega * (n - begin) * period_s)) / 2.0)
    time.sleep(4.0)
    log = plan["log"][begin + 10:]
    # The target sent before SYNC k acts from it on and is reached one period later; what the callback of cycle k has
    # seen was sampled at SYNC k - 1. So the position at k belongs to the target of k - 2, and a little servo lag.
    worst = max(abs(position - log[k - 2][0]) for k, (_, position) in enumerate(log) if k >= 2)
    reach = max(target for target, _ in log) - start
    check(len(log) > 0.7 * 4.0 / period_s and reach > 0.9 * amplitude, "sine was sent", f"{len(log)} cycles")
    check(worst < 0.15 * amplitude, "position follows the targets", f"worst {worst / plan['scale']:.5f} rad of 0.05")
    hold = plan["log"][-1][0]
    plan["at"] = lambda n: hold
    time.sleep(0.4)
    rest = abs(node.tpdo_values[0x6064] - hold)
    check(rest < 0.0005 * plan["scale"], "position comes to the target", f"{rest} counts")
    check(abs(node.sdo[0x60F4].raw) < 0.001 * plan["scale"], "0x60F4 is small at rest")
    return plan


def quick_stop(bus, node, plan):
    """Quick stop with option 6 holds; it is left by enable operation, and by disable voltage."""
    node.state = "QUICK STOP ACTIVE"
    check(node.state == "QUICK STOP ACTIVE", "quick stop is active", hex(node.statusword))
    check(node.statusword & 0x20 == 0 and node.statusword & 0x1000 == 0, "bits 5 and 12 are 0 in quick stop")
    held = node.tpdo_values[0x6064]
    here = plan["at"](0)
    plan["at"] = lambda n: here + round(0.01 * plan["scale"])
    time.sleep(0.5)
    check(abs(node.tpdo_values[0x6064] - held) < 0.001 * plan["scale"], "targets do not move it in quick stop")
    check(node.state == "QUICK STOP ACTIVE", "option 6 stays in quick stop active")
    plan["at"] = lambda n: node.tpdo_values[0x6064]
    node.state = "OPERATION ENABLED"  # transition 16
    check(within(1, lambda: node.statusword & 0x1000), "transition 16: enabled and following", hex(node.statusword))
    now = node.tpdo_values[0x6064]
    plan["at"] = lambda n: now
    node.state = "QUICK STOP ACTIVE"
    time.sleep(0.3)
    node.state = "SWITCH ON DISABLED"  # transition 12
    check(node.state == "SWITCH ON DISABLED", "transition 12: disable voltage")
    node.sdo[0x605A].raw = 2
    now = node.tpdo_values[0x6064]
    plan["at"] = lambda n: now
    node.state = "OPERATION ENABLED"
    within(1, lambda: node.statusword & 0x1000)
    node.rpdo[1][0x6040].raw = 0x0002
    check(within(2, lambda: node.state == "SWITCH ON DISABLED"), "option 2 ends in switch on disabled", node.state)


def option_codes(node, plan):
    """Leaving operation enabled by shutdown, disable operation and disable voltage."""
    for word, state in ((0x0007, "SWITCHED ON"), (0x0006, "READY TO SWITCH ON"), (0x0000, "SWITCH ON DISABLED")):
        now = node.tpdo_values[0x6064]
        plan["at"] = lambda n: now
        node.state = "OPERATION ENABLED"
        check(within(1, lambda: node.statusword & 0x1000), "enabled again", hex(node.statusword))
        node.rpdo[1][0x6040].raw = word
        check(within(2, lambda: node.state == state), f"controlword 0x{word:04X} from enabled: {state}", node.state)
        node.rpdo[1][0x6040].raw = 0
        check(within(1, lambda: node.state == "SWITCH ON DISABLED"), "disable voltage", node.state)
    # CiA 402: 0x000F in ready to switch on takes transitions 3 and 4 by itself, also when it is written only once.
    now = node.tpdo_values[0x6064]
    plan["at"] = lambda n: now
    node.sdo.download(0x2000, 1, b"\0\0")  # The drive's watchdog over setpoints: none are sent for a moment.
    plan["mute"] = True
    time.sleep(0.05)
    node.sdo[0x6040].raw = 0x0006
    check(within(1, lambda: node.state == "READY TO SWITCH ON"), "shutdown by SDO", node.state)
    node.sdo[0x6040].raw = 0x000F
    check(within(1, lambda: node.state == "OPERATION ENABLED"), "0x000F from ready to switch on, once", node.state)
    node.rpdo[1][0x6040].raw = 0x000F
    plan["mute"] = False


def faults(bus, node, plan):
    """A drive fault while enabled: EMCY, states, reset by the rising edge only."""
    node.emcy.reset()
    node.sdo[0x2002].raw = 0x3210
    check(within(1, lambda: any(emcy.code == 0x3210 for emcy in node.emcy.log)), "EMCY 0x3210 is received")
    check(node.emcy.log[-1].register & 0x05 == 0x05, "with the generic and the voltage bit", hex(node.emcy.log[-1].register))
    check(within(2, lambda: node.state == "FAULT"), "the drive ends in FAULT", node.state)
    check(node.sdo[0x603F].raw == 0x3210 and node.sdo[0x1001].raw & 1, "0x603F and 0x1001 tell")
    check(node.sdo[0x1003][0].raw == 1 and node.sdo[0x1003][1].raw & 0xFFFF == 0x3210, "0x1003 tells")
    two = 0x280 + node.id
    check(bus.last(two)[6:8] == b"\x10\x32", "0x603F in the second TPDO", bus.last(two).hex())
    for word in (0x0006, 0x000F, 0x0000):
        node.rpdo[1][0x6040].raw = word
        time.sleep(0.1)
        check(node.state == "FAULT", f"controlword 0x{word:04X} does not leave FAULT")
    now = node.tpdo_values[0x6064]
    plan["at"] = lambda n: now
    node.rpdo[1][0x6040].raw = 0x0080
    check(within(1, lambda: node.state == "SWITCH ON DISABLED"), "the rising edge of bit 7 does", node.state)
    check(within(1, lambda: bytes(bus.last(0x80 + node.id) or b"")[:3] == b"\0\0\0"), "EMCY error reset")
    check(node.sdo[0x603F].raw in (0, 0x3210) and node.sdo[0x1001].raw == 0, "error register is clear")
    node.sdo[0x2002].raw = 0x4310
    check(within(1, lambda: node.state == "FAULT"), "bit 7 still set: the next fault stays", node.state)
    time.sleep(0.1)
    check(node.state == "FAULT", "bit 7 held is no edge")
    node.rpdo[1][0x6040].raw = 0
    time.sleep(0.1)
    node.reset_from_fault()
    check(node.state == "OPERATION ENABLED", "p402.reset_from_fault enables", node.state)
    node.sdo[0x1003][0].raw = 0
    check(node.sdo[0x1003][0].raw == 0, "history cleared")


def lost_connection(bus, node, plan):
    """NMT stop while enabled: reaction 0x6007; then the SYNC ends and comes back."""
    node.nmt.state = "STOPPED"
    time.sleep(0.6)
    node.nmt.state = "OPERATIONAL"
    node.rpdo[1][0x6040].raw = 0x000F
    time.sleep(0.3)
    check(node.state in ("SWITCH ON DISABLED", "QUICK STOP ACTIVE", "FAULT"), "NMT stop ended operation", node.state)
    node.rpdo[1][0x6040].raw = 0
    time.sleep(0.1)
    node.rpdo[1][0x6040].raw = 0x80
    time.sleep(0.1)
    node.rpdo[1][0x6040].raw = 0
    check(within(1, lambda: node.state == "SWITCH ON DISABLED"), "and it can be disabled", node.state)


def event_driven(bus, node):
    """Type 255: RPDOs act at once, TPDOs at a change and by timer, inhibit time kept."""
    node.nmt.state = "PRE-OPERATIONAL"
    map_pdo(node.rpdo[1], 0x200 + node.id, 255, [(0x6040, 0, 16)])
    map_pdo(node.tpdo[1], 0x180 + node.id, 255, [(0x6041, 0, 16)], event_ms=100, inhibit=200)
    map_pdo(node.tpdo[2], 0x3A5, 254, [(0x6041, 0, 16), (0x6061, 0, 8)], event_ms=0, inhibit=0)
    before = bus.count(0x180 + node.id), bus.count(0x3A5)
    node.nmt.state = "OPERATIONAL"
    time.sleep(1.05)
    timed = bus.count(0x180 + node.id) - before[0]
    check(8 <= timed <= 13, "event timer of 100 ms over 1.05 s", timed)
    once = bus.count(0x3A5) - before[1]
    check(once == 1, "no event timer: sent once on entering operational", once)
    node.rpdo[1][0x6040].raw = 0x0006
    node.rpdo[1].transmit()
    check(within(0.3, lambda: (bus.last(0x3A5) or b"\0")[0] & 0x6F == 0x21), "event-driven RPDO acts without SYNC",
          bus.last(0x3A5).hex())
    check(bus.count(0x3A5) - before[1] == 2, "and the TPDO is sent at the change")
    node.rpdo[1][0x6040].raw = 0x0000
    node.rpdo[1].transmit()
    check(within(0.3, lambda: bus.last(0x3A5)[0] & 0x4F == 0x40), "disable voltage at once")
    # Too short for its mapping: ignored, and said.
    before = bus.count(0x80 + node.id)
    bus.network.send_message(0x200 + node.id, b"\x06")
    check(within(0.3, lambda: bus.count(0x80 + node.id) > before), "an RPDO that is too short is reported")
    check(bus.last(0x80 + node.id)[:2] == b"\x10\x82", "EMCY 0x8210", bus.last(0x80 + node.id).hex())
    check(bus.last(0x3A5)[0] & 0x4F == 0x40, "and ignored")


def heartbeat_consumer(bus, node):
    """0x1016: a heartbeat that was there and ends is EMCY 0x8130."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.sdo[0x1016][1].raw = 0x55 << 16 | 150
    for _ in range(5):
        bus.network.send_message(0x700 + 0x55, b"\x05")
        time.sleep(0.05)
    emcy = node.emcy.wait(0x8130, timeout=1)
    check(emcy is not None, "a lost heartbeat is EMCY 0x8130", emcy)
    node.sdo[0x1016][1].raw = 0


def main():
    """All checks, in the order of a commissioning."""
    servosim, settings = sys.argv[1:3]
    interface = sys.argv[3] if len(sys.argv) > 3 else "vcan0"
    bus = Bus(interface)
    simulator = subprocess.Popen(
        [servosim, "--settings", settings, "--link", "socketcan"], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True
    )
    try:
        check("ready" in simulator.stdout.readline(), "the simulator serves")
        check(within(5, lambda: all(bus.last(0x700 + n) == b"\0" for n in range(1, 7))), "six boot-ups after power-up")
        node = bus.node(1)
        network_management(bus, node)
        reading_and_writing(bus, node)
        mapping_rules(node)
        remap(node)
        sync_types(bus, node)
        plan = enable_and_follow(bus, node, 0.02)
        quick_stop(bus, node, plan)
        option_codes(node, plan)
        faults(bus, node, plan)
        lost_connection(bus, node, plan)
        bus.stop_sync()
        event_driven(bus, node)
        heartbeat_consumer(bus, node)
        other = bus.node(5)
        remap(other)
        plan = enable_and_follow(bus, other, 0.01)
        other.state = "SWITCH ON DISABLED"
        check(other.state == "SWITCH ON DISABLED", "disabled at the end")
        bus.stop_sync()
        check(simulator.poll() is None, "the simulator still serves")
    finally:
        simulator.terminate()
        status = simulator.wait(10)
    check(status == 0, "the simulator ends orderly", status)
    conclude("CANOPEN MASTER")


if __name__ == "__main__":
    main()
