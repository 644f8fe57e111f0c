"""The sealed truth: it is encrypted, and its SHA-256 is published before any diagnosis starts."""

from __future__ import annotations

import hashlib
import json
import secrets
from pathlib import Path
from typing import Any

from cryptography.fernet import Fernet, InvalidToken

SEALED, COMMITMENT = "truth.sealed", "commitment.txt"
NUMBERS = ("settings", "fit_settings", "reading_settings", "machine_settings")
"""Keys of a report with the numbers of the tool."""


def new_key() -> bytes:
    """A new random key."""
    return Fernet.generate_key()


def tool_numbers(version: str, numbers: dict[str, Any]) -> dict[str, Any]:
    """What a commitment contains of the tool that will diagnose: its version, and the SHA-256 of its numbers.

    numbers: the groups of settings as report.json has them; they fix the splits of the data and every choice.
    """
    text = json.dumps({name: numbers[name] for name in NUMBERS}, sort_keys=True)
    return {"version": version, "settings_sha256": hashlib.sha256(text.encode()).hexdigest()}


def seal(truth: dict[str, Any], out: Path, key: bytes) -> str:
    """Write the encrypted truth and its commitment; returns the commitment, a SHA-256 in hexadecimal digits."""
    plain = json.dumps({"salt": secrets.token_hex(16), **truth}, sort_keys=True).encode()
    commitment = hashlib.sha256(plain).hexdigest()
    (out / SEALED).write_bytes(Fernet(key).encrypt(plain))
    (out / COMMITMENT).write_text(commitment + "\n", encoding="ascii")
    return commitment


def unseal(out: Path, key: bytes) -> tuple[dict[str, Any], str]:
    """The truth and its commitment.

    ValueError: a wrong key, or a truth that differs from the commitment. FileNotFoundError: no trial in the folder.
    """
    sealed = (out / SEALED).read_bytes()
    try:
        plain = Fernet(key).decrypt(sealed)
    except (InvalidToken, ValueError):
        raise ValueError(f"{out / SEALED}: the key does not open it") from None
    found = hashlib.sha256(plain).hexdigest()
    promised = (out / COMMITMENT).read_text(encoding="ascii").strip()
    if found != promised:
        raise ValueError(f"{out / SEALED}: its SHA-256 is {found}, but {promised} was promised")
    return json.loads(plain), found
