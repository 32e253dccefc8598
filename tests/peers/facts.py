"""Facts that must hold: counted, each said in a line, checked together at the end."""

import sys
import time

_BEGAN = time.monotonic()
_checks = 0
_failed = []


def check(holds, what, seen=None):
    """One fact that must hold."""
    global _checks
    _checks += 1
    print(f"{'ok    ' if holds else 'FAILED'} {what}" + ("" if seen is None else f"  [{seen}]"), flush=True)
    if not holds:
        _failed.append(what)


def within(limit_s, condition):
    """Waits for a condition; whether it came true in time."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.005)
    return condition()


def conclude(who):
    """Says how it went; ends in status 1 when a fact did not hold."""
    if _failed:
        sys.exit(f"{who}: {len(_failed)} of {_checks} checks failed: {'; '.join(_failed)}")
    print(f"{who} OK: {_checks} checks, {time.monotonic() - _BEGAN:.0f} s")
