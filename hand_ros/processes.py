"""The processes of this machine, as /proc lists them."""

from __future__ import annotations

from pathlib import Path

from hand_ros.publishers import PROCESS_BITS, Processes

LONGEST_COMMAND = 80
START_FIELD = 19
"""Field of /proc/NUMBER/stat after the name in parentheses: start time in clock ticks since boot."""


def processes(low_bits: int, proc: Path = Path("/proc")) -> Processes:
    """The processes whose number has these low 16 bits, with start time [ticks] and shortened command line."""
    try:
        largest = int((proc / "sys/kernel/pid_max").read_text(encoding="ascii"))
    except (OSError, ValueError):
        largest = 1 << PROCESS_BITS
    found = {}
    for number in range(low_bits, largest + 1, 1 << PROCESS_BITS):
        try:
            stat = (proc / str(number) / "stat").read_text(encoding="utf-8", errors="replace")
            command = (proc / str(number) / "cmdline").read_bytes()
            start = int(stat.rpartition(")")[2].split()[START_FIELD])
        except (OSError, ValueError, IndexError):
            continue  # no such process, or it has just ended
        words = command.decode("utf-8", errors="replace").replace("\0", " ").split()
        found[number] = (start, " ".join(words)[:LONGEST_COMMAND] or "no command line")
    return found
