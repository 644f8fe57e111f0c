"""Ctrl-C: one line that says which outputs were written, no child process left, exit code 130.

SIGINT is blocked in the process and in every child process. A thread waits for it, ends the children, prints the
line and ends the process. An exception in the main thread would not do: library code that is interrupted in an
import or in a destructor prints tracebacks. A subcommand that must end in order (nodes to stop, a hand to vent)
calls `release`: from then on SIGINT raises Interrupted. What needs no order, as an index of what is done so far, is
given to `Outputs.at_interruption`.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

EXIT_CODE = 130
CHILDREN_END_S = 2.0
"""Time for child processes to end after SIGTERM; SIGKILL follows."""
_QUIET_TRACKER = "ignore:resource_tracker:UserWarning"

_installed = threading.Event()
_released = threading.Event()
_ending = threading.Event()
_raised = threading.Event()


class Interrupted(BaseException):
    """Ctrl-C after `release`. The parser of the command line handles KeyboardInterrupt itself, without our line."""


class Outputs:
    """The files and folders that a subcommand writes, and which of them are complete."""

    def __init__(self, command: str = "hand", planned: Sequence[Path] = ()) -> None:
        """Remember what exists before the subcommand writes anything."""
        self.command = command
        self._before = {path: _stamp(path) for path in planned}
        self._complete: set[Path] = set()
        self._last_act: Callable[[], None] | None = None

    def complete(self, *paths: Path) -> None:
        """Call this when the files have been written to their end."""
        self._complete.update(paths)

    def at_interruption(self, act: Callable[[], None] | None) -> None:
        """Set what Ctrl-C still does when the child processes have ended; None: nothing."""
        self._last_act = act

    def end(self) -> None:
        """Do what was set; an error of it only leaves its file incomplete."""
        if self._last_act is not None:
            with suppress(Exception):
                self._last_act()

    def sentence(self) -> str:
        """What was written, what is incomplete, what was not written."""
        states: dict[str, list[str]] = {"written": [], "incomplete": [], "not written": []}
        for path, before in self._before.items():
            if path in self._complete:
                states["written"].append(str(path))
            else:
                states["not written" if _stamp(path) == before else "incomplete"].append(str(path))
        parts = [f"{state}: {', '.join(paths)}" for state, paths in states.items() if paths]
        return "; ".join(parts) or "nothing was written"


_current = Outputs()


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def begin(outputs: Outputs) -> Outputs:
    """Make these the outputs that an interruption reports on."""
    global _current  # noqa: PLW0603 - a process runs one subcommand
    _current = outputs
    return outputs


def install() -> None:
    """Handle SIGINT as above; does nothing where the caller of the process chose to ignore SIGINT."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        return
    # The resource tracker of multiprocessing removes the semaphores of ended workers; its warning is no news then.
    given = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = f"{given},{_QUIET_TRACKER}" if given else _QUIET_TRACKER
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    _installed.set()
    threading.Thread(target=_watch, daemon=True, name="interrupts").start()


def release() -> None:
    """Give SIGINT an effect in the main thread again: Interrupted is raised, or the subcommand's own handler runs."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _raise)
    _released.set()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def end_on_sigterm() -> None:
    """Let SIGTERM end this subcommand like Ctrl-C, also where the caller ignores SIGINT (a script's background job)."""
    signal.signal(signal.SIGTERM, _raise)


def _raise(*_: object) -> None:
    _raised.set()
    raise Interrupted


def was_raised() -> bool:
    """Whether Interrupted was raised. Compiled library code may turn it into an error of its own."""
    return _raised.is_set()


def check() -> None:
    """Raise Interrupted where it was raised, and library code has dropped it."""
    if was_raised():
        raise Interrupted


@contextmanager
def until_raised() -> Iterator[None]:
    """Context of work that Ctrl-C ends in order, also where library code has turned it into an error of its own."""
    try:
        yield
    except Interrupted:
        pass
    except Exception:
        if not was_raised():
            raise


def before_workers() -> None:
    """Call this before multiprocessing starts worker processes.

    Its resource tracker unblocks SIGINT in the thread that starts it, and would do so in the workers, too.
    """
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()
    if threading.current_thread() is threading.main_thread() and _installed.is_set() and not _released.is_set():
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def report(error_fd: int = 2) -> None:
    """Print the line of an interrupted subcommand."""
    clear = "\r\x1b[K\x1b[?25h" if os.isatty(error_fd) else ""  # a progress bar hides the cursor
    line = f"{clear}{_current.command}: interrupted; {_current.sentence()}\n"
    os.write(error_fd, line.encode())


def wait_if_ending() -> None:
    """Wait for the end of the process where an interruption is under way."""
    if _ending.is_set():
        threading.Event().wait()


def _watch() -> None:
    while True:
        signal.sigwait({signal.SIGINT})
        if not _released.is_set():
            _ending.set()
            error_fd = _silence()
            end_children()
            _current.end()
            end_children()  # a pool may have replaced its workers meanwhile
            report(error_fd)
            os._exit(EXIT_CODE)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _silence() -> int:
    """Discard what other threads print about their ended children; returns a copy of standard error for the line."""
    error_fd = os.dup(2)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    return error_fd


def end_children() -> None:
    """End every process that descends from this one: SIGTERM, then SIGKILL."""
    number, last = signal.SIGTERM, time.monotonic() + CHILDREN_END_S
    told: set[int] = set()
    while running := descendants():
        if time.monotonic() > last:
            number, told = signal.SIGKILL, set()
        for pid in running:
            if pid not in told:
                told.add(pid)
                _send(pid, number)
        time.sleep(0.02)


def _send(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def descendants() -> list[int]:
    """Process ids of all running descendants, parents first, without the resource tracker of multiprocessing."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            parent = _running_child_of(entry)
            if parent is not None:
                children.setdefault(parent, []).append(int(entry.name))
    found = list(children.get(os.getpid(), []))
    for pid in found:
        found += children.get(pid, [])  # the loop reaches what is appended here
    return found


def _running_child_of(process: Path) -> int | None:
    """The parent of a process that runs; None where it has ended or ends with us by itself."""
    try:
        state, parent = (process / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[:2]
        command = (process / "cmdline").read_bytes()
    except OSError:
        return None
    return None if state in "ZX" or b"resource_tracker" in command else int(parent)
