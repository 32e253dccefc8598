"""Frames of ODrive's CANSimple as an independent encoder packs and reads them.

Usage: odrive_frames.py FILE           writes the frames
       odrive_frames.py --check FILE   fails when the encoder gives other frames than FILE holds

The tables are the DBC of firmware 0.6.10 as the package odrive-can ships it; the encoder is cantools. Neither shares a
line with this project. The test `frames_are_those_of_an_independent_encoder` of drivers/tests/odrive_suite holds the codec
against FILE.
"""

import importlib.util
import pathlib
import random
import struct
import sys

import cantools

SEED = 20_261_130
TIMES = 120
# The DBC has these nodes.
NODES = range(8)


def database():
    """The tables."""
    package = pathlib.Path(importlib.util.find_spec("odrive_can").origin).parent
    return cantools.database.load_file(package / "dbc" / "odrive-cansimple-0.6.10.dbc")


def single(value):
    """The nearest number that the wire carries."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def lines():
    """Every case, as comma-separated words: what, node, arguments, frame."""
    draw = random.Random(SEED)
    tables = database()

    def pack(node, name, **signals):
        message = tables.get_message_by_name(f"Axis{node}_{name}")
        return f"{message.frame_id:03X}#{message.encode(signals, scaling=True).hex().upper()}"

    def read(node, name, data):
        message = tables.get_message_by_name(f"Axis{node}_{name}")
        return message.frame_id, message.decode(data, decode_choices=False)

    def sdo(node, name, opcode, endpoint, value):
        # The multiplexed tables cannot be encoded by name: the layout is taken signal by signal from them.
        message = tables.get_message_by_name(f"Axis{node}_{name}")
        packed = 0
        for signal, number in (("Endpoint_ID", endpoint), ("Value", value)):
            packed |= number << message.get_signal_by_name(signal).start
        if name == "RxSdo":
            packed |= opcode << message.get_signal_by_name("Opcode").start
        return f"{message.frame_id:03X}#{packed.to_bytes(8, 'little').hex().upper()}"

    for _ in range(TIMES):
        node = draw.choice(NODES)
        position, velocity, torque = single(draw.uniform(-500, 500)), draw.randint(-32768, 32767), draw.randint(-32768, 32767)
        frame = pack(node, "Set_Input_Pos", Input_Pos=position, Vel_FF=velocity / 1000, Torque_FF=torque / 1000)
        yield f"position,{node},{position!r},{velocity},{torque},{frame}"
        data = struct.pack("<ff", draw.uniform(-500, 500), draw.uniform(-50, 50))
        frame_id, seen = read(node, "Get_Encoder_Estimates", data)
        yield f"estimates,{node},{seen['Pos_Estimate']!r},{seen['Vel_Estimate']!r},{frame_id:03X}#{data.hex().upper()}"
        data = bytes(draw.randrange(256) for _ in range(8))
        frame_id, seen = read(node, "Heartbeat", data)
        words = [seen[name] for name in ("Axis_Error", "Axis_State", "Procedure_Result", "Trajectory_Done_Flag")]
        yield f"heartbeat,{node},{','.join(map(str, words))},{frame_id:03X}#{data.hex().upper()}"
        frame_id, seen = read(node, "Get_Error", data)
        yield f"error,{node},{seen['Active_Errors']},{seen['Disarm_Reason']},{frame_id:03X}#{data.hex().upper()}"
        frame_id, seen = read(node, "Get_Version", data)
        names = ("Protocol_Version", "Hw_Version_Major", "Hw_Version_Minor", "Hw_Version_Variant", "Fw_Version_Major",
                 "Fw_Version_Minor", "Fw_Version_Revision", "Fw_Version_Unreleased")
        yield f"version,{node},{','.join(str(seen[name]) for name in names)},{frame_id:03X}#{data.hex().upper()}"
        endpoint, value = draw.randrange(65536), draw.randrange(2**32)
        yield f"write,{node},{endpoint},{value},{sdo(node, 'RxSdo', 1, endpoint, value)}"
        yield f"endpoint,{node},{endpoint},{value},{sdo(node, 'TxSdo', 0, endpoint, value)}"
    for node in NODES:
        for state in (1, 8):
            yield f"state,{node},{state},{pack(node, 'Set_Axis_State', Axis_Requested_State=state)}"
        yield f"mode,{node},3,1,{pack(node, 'Set_Controller_Mode', Control_Mode=3, Input_Mode=1)}"
        yield f"clear,{node},{pack(node, 'Clear_Errors', Identify=0)}"
        yield f"estop,{node},{pack(node, 'Estop')}"
        turns = single(draw.uniform(-500, 500))
        yield f"absolute,{node},{turns!r},{pack(node, 'Set_Absolute_Position', Position=turns)}"


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
            sys.exit(f"{sys.argv[2]}:{number}: {ours}\nthe encoder gives: {theirs}")
    print(f"ok: {len(held)} frames are those of the encoder")


main()
