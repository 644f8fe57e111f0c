"""The access policies of config/security: their form, what they allow, and what a running node really has.

The rules of the form are those of `sros2/policy/schemas/policy.xsd` of the package sros2, version 0.2.0: a policy has
one list of enclaves, an enclave with a path has lists of profiles, a profile with ns and node has groups in any order,
and each group has at least one name, and ALLOW or DENY for what its kind can do. What the schema leaves open and these
files do not use, as metadata, is refused here.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from rclpy.action import get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node

FOLDER = Path("config/security")
VERSION = "0.2.0"
RULES = {"topics": ("publish", "subscribe"), "services": ("reply", "request"), "actions": ("execute", "call")}
"""Groups of a profile and what each can allow, by version 0.2.0 of the schema of SROS2."""
NESTING = {"policy": "enclaves", "enclaves": "enclave", "enclave": "profiles", "profiles": "profile"}
ATTRIBUTES = {"policy": {"version"}, "enclave": {"path"}, "profile": {"ns", "node"}}
Allowed = dict[str, set[str]]


def problems(root: ET.Element) -> list[str]:
    """What of a policy the schema of SROS2 does not allow, one line each; empty for a valid policy."""
    found = [] if root.tag == "policy" else [f"<{root.tag}> is not <policy>"]
    found += [] if root.get("version") == VERSION else [f"version is {root.get('version')}, not {VERSION}"]
    level = [root]
    for tag, inner in NESTING.items():
        below = []
        for element in level:
            if set(element.attrib) != ATTRIBUTES.get(tag, set()):
                found.append(f"<{tag}> has attributes {sorted(element.attrib)}")
            if not len(element) or any(child.tag != inner for child in element):
                found.append(f"<{tag}> must contain <{inner}> only")
            below += list(element)
        level = below
    for profile in level:
        if set(profile.attrib) != ATTRIBUTES["profile"]:
            found.append(f"<profile> has attributes {sorted(profile.attrib)}")
        for group in profile:
            found += _group_problems(group)
    return found


def _group_problems(group: ET.Element) -> list[str]:
    if group.tag not in RULES:
        return [f"<{group.tag}> is no group of a profile"]
    found = []
    if not group.attrib or not set(group.attrib) <= set(RULES[group.tag]):
        found.append(f"<{group.tag}> has attributes {sorted(group.attrib)}")
    if not set(group.attrib.values()) <= {"ALLOW", "DENY"}:
        found.append(f"<{group.tag}> has values {sorted(group.attrib.values())}")
    item = group.tag[:-1]
    if not len(group) or any(child.tag != item or len(child) or not (child.text or "").strip() for child in group):
        found.append(f"<{group.tag}> must contain <{item}> with a name only")
    return found


def allowed(enclave: ET.Element) -> Allowed:
    """Full names that the enclave of one node allows, by what it allows: publish, subscribe, reply, ..."""
    (profile,) = enclave.iter("profile")
    space, node = profile.attrib["ns"], profile.attrib["node"]
    result: Allowed = {verb: set() for verbs in RULES.values() for verb in verbs}
    for group in profile:
        names = {_full((item.text or "").strip(), space, node) for item in group}
        for verb, value in group.attrib.items():
            assert value == "ALLOW", f"{node}: the policies here only allow; DENY is the default"
            assert not names & result[verb], f"{node}: listed twice: {names & result[verb]}"
            result[verb] |= names
    return result


def _full(name: str, space: str, node: str) -> str:
    if name.startswith("/"):
        return name
    return f"{space}/{node}{name[1:]}" if name.startswith("~") else f"{space}/{name}"


def real(observer: Any, name: str, space: str) -> Allowed:
    """Full names that a running node has, as the graph lists them; the parts of an action are its action."""
    names = {
        "publish": observer.get_publisher_names_and_types_by_node(name, space),
        "subscribe": observer.get_subscriber_names_and_types_by_node(name, space),
        "reply": observer.get_service_names_and_types_by_node(name, space),
        "request": observer.get_client_names_and_types_by_node(name, space),
        "execute": get_action_server_names_and_types_by_node(observer, name, space),
        "call": get_action_client_names_and_types_by_node(observer, name, space),
    }
    return {verb: {item for item, _ in items if "/_action/" not in item} for verb, items in names.items()}
