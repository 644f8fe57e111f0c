"""Floods of commands from another process: the driver refuses them, goes on, and its memory does not grow."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

PUBLISH = """
import sys, time
import rclpy
from hand_msgs.msg import ValveCommand
rclpy.init()
node = rclpy.create_node("flood", namespace="hand")
publisher = node.create_publisher(ValveCommand, "valve_command", 1)
raw, rate_hz, count = bytes.fromhex(sys.argv[1]) * int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
raw = b"\\0\\1\\0\\0" + raw[4:]
while not publisher.get_subscription_count():
    time.sleep(0.05)
due = time.monotonic()
for _ in range(count):
    publisher.publish(raw)
    due += 1.0 / rate_hz
    time.sleep(max(due - time.monotonic(), 0.0))
time.sleep(0.5)
"""
NAMES = struct.pack("<I", 1_000_000) + struct.pack("<I", 2) + b"j\x00\x00\x00"
GROWTH_KB = 10_000


def resident_kb(process: int) -> int:
    """Memory of a process that is resident [kB]."""
    lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def flood(raw: bytes, times: int, rate_hz: float, count: int) -> None:
    """Publish the bytes, repeated so many times in one message, from a process of their own."""
    arguments = [raw.hex(), str(times), str(rate_hz), str(count)]
    subprocess.run([sys.executable, "-c", PUBLISH, *arguments], check=True, timeout=60)


@pytest.mark.parametrize(
    ("raw", "times", "rate_hz", "count"),
    [(NAMES, 1_000_000, 1.0, 4), (b"\xff" * 64, 1, 5000.0, 15_000)],
    ids=["12 MB of names", "5 kHz malformed"],
)
def test_a_flood_leaves_no_memory(
    stack: Stack, client: Client, raw: bytes, times: int, rate_hz: float, count: int
) -> None:
    """Fails when large messages stay in memory, or the driver does not name them and go on afterwards."""
    driver = stack.node("simulation")
    client.until(lambda: len(client.joints) > 100, 60.0)
    before_kb = resident_kb(driver.pid)
    flood(raw, times, rate_hz, count)
    received = len(client.joints)
    client.until_said("simulation", "commands", "refused")
    client.until(lambda: len(client.joints) > received + 100)
    assert resident_kb(driver.pid) - before_kb < GROWTH_KB
