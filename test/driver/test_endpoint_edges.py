"""Ports at their edges: names of someone else, a device that goes while it opens, a packet joined midway."""

from __future__ import annotations

import os
import termios
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import BoardError, Status
from hand_driver.serial_board import SerialBoard
from hand_driver.wire import PacketDecoder, SamplePayload, encode_sample
from hand_sim.serial_endpoint import Pty

PACKET = encode_sample(SamplePayload(7, 35_000, 5.0, Status(0), np.arange(33, dtype=np.uint16)))


def test_a_name_that_is_taken_is_left_alone(tmp_path: Path) -> None:
    """Fails when the emulator replaces a file or a link that no emulator made, such as udev's name of a real board."""
    real = tmp_path / "real"
    real.write_text("keep")
    named = tmp_path / "named"
    named.symlink_to(real)
    for path in (real, named):
        with pytest.raises(FileExistsError, match=path.name):
            Pty(str(path))
    assert named.readlink() == real
    assert real.read_text() == "keep"


def test_a_link_to_a_terminal_of_another_program_is_left_alone(tmp_path: Path) -> None:
    """Fails when the emulator replaces the link that another program, such as socat, made to its own terminal."""
    master, slave = os.openpty()
    named = tmp_path / "board"
    named.symlink_to(os.ttyname(slave))
    with pytest.raises(FileExistsError, match="that no emulator made; remove it or name another"):
        Pty(str(named))
    assert str(named.readlink()) == os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_link_that_a_killed_emulator_left_is_replaced(tmp_path: Path) -> None:
    """Fails when an emulator that was killed blocks its name, or the link does not lead to the new terminal."""
    named = tmp_path / "board"
    named.symlink_to("/dev/pts/../pts/99999")
    pty = Pty(str(named))
    assert named.samefile(os.ttyname(pty._slave))
    pty.close()
    assert not named.is_symlink()


def test_the_end_of_one_emulator_leaves_the_next_ones_link(tmp_path: Path) -> None:
    """Fails when an emulator that ends late takes away the place of the one that followed it."""
    path = tmp_path / "board"
    first, second = Pty(str(path)), Pty(str(path))
    first.close()
    assert path.is_symlink()
    second.close()
    assert not path.is_symlink()


def test_a_port_that_goes_while_it_is_opened_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the terminal's own error, which is no OSError, escapes and ends the reader's thread."""

    def gone(*_: object) -> None:
        raise termios.error(5, "Input/output error")

    pty = Pty(str(tmp_path / "board"))
    monkeypatch.setattr(termios, "tcflush", gone)
    with pytest.raises(BoardError, match="cannot be opened") as raised:
        SerialBoard(pty.name, 33)
    assert "\n" not in str(raised.value)
    pty.close()


@pytest.mark.parametrize("cut", [1, 40, len(PACKET) - 1])
def test_the_rest_of_a_packet_joined_midway_is_no_noise(cut: int) -> None:
    """Fails when opening a port of a running board looks like a bad cable, or real damage after it is not counted."""
    decoder = PacketDecoder(joining=True)
    assert len(decoder.feed(PACKET[cut:] + PACKET)) == 1
    assert decoder.corrupt == 0
    assert decoder.feed(PACKET[cut:-1] + b"\x00") == []
    assert decoder.corrupt == (cut < len(PACKET) - 1)
