"""Frames of the AgileX Piper as its maker's own library packs and reads them.

Usage: piper_frames.py FILE           writes the frames
       piper_frames.py --check FILE   fails when the library gives other frames than FILE holds

The library is piper_sdk; it shares no line with this project. The test `frames_are_those_of_the_makers_library` of
drivers/tests/piper_suite holds the codec against FILE.
"""

import random
import sys

import can
from piper_sdk.piper_msgs.msg_v2 import (
    ArmMsgJointConfig, ArmMsgJointCtrl, ArmMsgMotionCtrl_1, ArmMsgMotionCtrl_2, ArmMsgMotorEnableDisableConfig,
    ArmMsgSearchMotorMaxAngleSpdAccLimit, ArmMsgType, PiperMessage,
)
from piper_sdk.protocol.protocol_v2 import C_PiperParserV2

SEED = 20_261_130
TIMES = 150


def text(identifier, data):
    """A frame as text."""
    return f"{identifier:03X}#{bytes(data).hex().upper()}"


def lines():
    """Every case, as comma-separated words: what, arguments, frame."""
    draw = random.Random(SEED)
    parser = C_PiperParserV2()

    def pack(kind, **parts):
        message = PiperMessage(type_=kind, **parts)
        frame = can.Message()
        assert parser.EncodeMessage(message, frame)
        return text(frame.arbitration_id, frame.data)

    def read(identifier, data):
        message = PiperMessage()
        assert parser.DecodeMessage(can.Message(arbitration_id=identifier, data=data, is_extended_id=False), message)
        return message

    for _ in range(TIMES):
        a, b = draw.randint(-(2**31), 2**31 - 1), draw.randint(-200_000, 200_000)
        for pair, kind in enumerate((ArmMsgType.PiperMsgJointCtrl_12, ArmMsgType.PiperMsgJointCtrl_34, ArmMsgType.PiperMsgJointCtrl_56)):
            names = (f"joint_{2 * pair + 1}", f"joint_{2 * pair + 2}")
            targets = ArmMsgJointCtrl(**dict(zip(names, (a, b), strict=True)))
            yield f"targets,{pair},{a},{b},{pack(kind, arm_joint_ctrl=targets)}"
        data = bytes(draw.randrange(256) for _ in range(8))
        pair = draw.randrange(3)
        seen = read(0x2A5 + pair, data).arm_joint_feedback
        angles = [getattr(seen, f"joint_{2 * pair + side}") for side in (1, 2)]
        yield f"angles,{pair},{angles[0]},{angles[1]},{text(0x2A5 + pair, data)}"
        # The library makes the numbers that it knows into names, and all others into one: only known ones are compared.
        known = bytes(draw.randrange(most) for most in (8, 16, 6, 8, 2)) + data[5:]
        seen = read(0x2A1, known).arm_status_msgs
        words = [int(word) for word in (seen.ctrl_mode, seen.arm_status, seen.mode_feed, seen.teach_status, seen.motion_status)]
        yield f"status,{','.join(map(str, words))},{int(seen.trajectory_num)},{int(seen.err_code)},{text(0x2A1, known)}"
        joint = draw.randint(1, 6)
        seen = getattr(read(0x250 + joint, data), f"arm_high_spd_feedback_{joint}")
        yield f"speed,{joint},{seen.motor_speed},{seen.current},{text(0x250 + joint, data)}"
        seen = getattr(read(0x260 + joint, data), f"arm_low_spd_feedback_{joint}")
        status = data[5]
        flags = seen.foc_status
        named = [flags.voltage_too_low, flags.motor_overheating, flags.driver_overcurrent, flags.driver_overheating,
                 flags.collision_status, flags.driver_error_status, flags.driver_enable_status, flags.stall_status]
        assert sum(bool(flag) << bit for bit, flag in enumerate(named)) == status
        yield f"driver,{joint},{seen.vol},{seen.foc_temp},{seen.motor_temp},{status},{seen.bus_current},{text(0x260 + joint, data)}"
        limits = bytes([joint]) + data[1:]
        seen = read(0x473, limits).arm_feedback_current_motor_angle_limit_max_spd
        yield f"limits,{joint},{seen.max_angle_limit},{seen.min_angle_limit},{seen.max_joint_spd},{text(0x473, limits)}"
        seen = read(0x476, data).arm_feedback_resp_set_instruction
        yield f"acknowledge,{seen.instruction_index},{seen.is_set_zero_successfully},{text(0x476, data)}"
    for joint in range(1, 8):
        for word, flag in (("disable", 1), ("enable", 2)):
            part = ArmMsgMotorEnableDisableConfig(joint, flag)
            yield f"{word},{joint},{pack(ArmMsgType.PiperMsgMotorEnableDisableConfig, arm_motor_enable=part)}"
        part = ArmMsgSearchMotorMaxAngleSpdAccLimit(joint, 1)
        yield f"ask,{joint},{pack(ArmMsgType.PiperMsgSearchMotorMaxAngleSpdAccLimit, arm_search_motor_max_angle_spd_acc_limit=part)}"
        part = ArmMsgJointConfig(joint, 0xAE, 0, 0x7FFF, 0)
        yield f"zero,{joint},{pack(ArmMsgType.PiperMsgJointConfig, arm_joint_config=part)}"
        part = ArmMsgJointConfig(joint, 0, 0, 0x7FFF, 0xAE)
        yield f"clear,{joint},{pack(ArmMsgType.PiperMsgJointConfig, arm_joint_config=part)}"
    for percent in range(0, 101, 10):
        for follow in (0, 0xAD):
            part = ArmMsgMotionCtrl_2(1, 1, percent, follow)
            yield f"mode,1,1,{percent},{follow},{pack(ArmMsgType.PiperMsgMotionCtrl_2, arm_motion_ctrl_2=part)}"
    yield f"mode,0,0,0,0,{pack(ArmMsgType.PiperMsgMotionCtrl_2, arm_motion_ctrl_2=ArmMsgMotionCtrl_2(0, 0, 0, 0))}"
    for word, action in (("stop", 1), ("resume", 2)):
        yield f"{word},{pack(ArmMsgType.PiperMsgMotionCtrl_1, arm_motion_ctrl_1=ArmMsgMotionCtrl_1(action, 0, 0))}"


def main():
    """Writes the file, or compares it."""
    written = "".join(line + "\n" for line in lines())
    if sys.argv[1] != "--check":
        with open(sys.argv[1], "w", encoding="ascii") as file:
            file.write(written)
        return
    with open(sys.argv[2], encoding="ascii") as file:
        held = file.read().splitlines()
    for number, (ours, theirs) in enumerate(zip(held, written.splitlines(), strict=True), start=1):
        if ours != theirs:
            sys.exit(f"{sys.argv[2]}:{number}: {ours}\nthe library gives: {theirs}")
    print(f"ok: {len(held)} frames are those of the library")


main()
