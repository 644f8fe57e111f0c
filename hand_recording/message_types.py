"""Definitions of message types: the Jazzy set of rosbags, hand_msgs, and the packages of sourced workspaces.

A recording contains the full text of each type, so that it can be read where the type is not installed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

CHECKOUT = Path(__file__).resolve().parents[1]
INTERFACES = Path("share") / "fluidic_hand" / "interfaces"
"""Folder below the prefix of an installation that holds hand_msgs/msg/*.msg; needed where ROS is not installed."""


class Definition(NamedTuple):
    """A type as a recording stores it: the text with all types it refers to, and its RIHS01 hash (REP 2011)."""

    text: str
    type_hash: str


class UnknownType(ValueError):
    """No definition of this message type can be found."""


def share_folders(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Folders whose packages hold msg/*.msg: `share` of every sourced ament prefix, the checkout, the installation."""
    prefixes = environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    installed = [folder / INTERFACES for folder in CHECKOUT.parents if (folder / INTERFACES).is_dir()]
    return [Path(prefix) / "share" for prefix in prefixes if prefix] + [CHECKOUT, *installed]


@cache
def _jazzy() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


def definition(type_name: str, folders: Iterable[Path] | None = None) -> Definition:
    """Definition of `pkg/msg/Name`, searched in the Jazzy set of rosbags and in `folders` (default: share_folders()).

    Raises UnknownType where there is no definition or it does not parse.
    """
    store = _jazzy()
    try:
        _learn(store, type_name, list(share_folders() if folders is None else folders))
        return Definition(store.generate_msgdef(type_name, ros_version=2)[0], store.hash_rihs01(type_name))
    except (TypesysError, KeyError, OSError, UnicodeDecodeError) as error:
        raise UnknownType(f"{type_name}: definition cannot be read: {error}") from error


def typestore_of(type_name: str) -> Typestore:
    """A typestore that reads and writes this type. Raises UnknownType."""
    definition(type_name)
    return _jazzy()


def same_definition(type_name: str, text: str) -> bool:
    """Whether `text`, as a recording stores it, defines this type and all types it refers to as they are known here."""
    try:
        theirs = get_types_from_msg(text, type_name)
    except TypesysError:
        return False
    ours = typestore_of(type_name).fielddefs
    return all(name in ours and ours[name][1] == fields for name, (_, fields) in theirs.items())


def _learn(store: Typestore, type_name: str, folders: list[Path]) -> None:
    """Register a type that the store lacks, and the types it refers to, from its .msg file."""
    if type_name in store.fielddefs:
        return
    package, _, name = type_name.partition("/msg/")
    found = [path for folder in folders if (path := folder / package / "msg" / f"{name}.msg").is_file()]
    if not found:
        raise UnknownType(f"{type_name}: no definition found; source the workspace that has {package}")
    types = get_types_from_msg(found[0].read_text(encoding="utf-8"), type_name)
    for _, fields in types.values():
        for _, description in fields:
            for needed in _named_types(description):
                _learn(store, needed, folders)
    store.register(types)


def _named_types(description: object) -> list[str]:
    """Names of message types in rosbags' nested description of a field."""
    if isinstance(description, tuple):
        return [name for part in description for name in _named_types(part)]
    return [description] if isinstance(description, str) and "/msg/" in description else []
