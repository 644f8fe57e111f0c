"""The access policies of config/security are valid, and allow exactly what each running node uses."""

from __future__ import annotations

import copy
import inspect
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from rclpy.node import NodeNameNonExistentError
from std_msgs.msg import Empty

from hand_client.node import HandClient
from test.nodes.policies import FOLDER, allowed, problems, real

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

EVERYTHING = (
    "use(c.enable, True); use(c.vent); use(c.grasp, 'open', 1.0, 0.0, int); c.collect(['a'], {});"
    " c.command({'a': 0.0}); c.hold(['a'])"
)
USES = {
    "hand_client": EVERYTHING,
    "hand_enable": "use(c.enable, True)",
    "hand_grasp": "use(c.grasp, 'open', 1.0, 0.0, int)",
    "hand_move": "use(c.move, {'a': 0.0}, 1.0); c.hold(['a'])",
    "hand_stop": "c.send_stop()",
    "hand_studio": EVERYTHING,
    "hand_up": "",
    "hand_watch": "",
}
"""The nodes of programs that use a hand, and what they do with it; all are in one file."""
CLIENTS = """
import sys
from hand_client.node import HandClient, NoHandError
def use(call, *given):
    for _ in range(5):  # a hand that is not found in a few seconds is not asked further
        try:
            return call(*given)
        except NoHandError as error:
            print(error, file=sys.stderr)
for name, uses in {uses}.items():
    with HandClient("hand", name) as c:
        exec(uses)
        sys.stdin.readline()  # once the test has seen what the node uses
"""
"""Every client in its turn."""
NODES = ("driver", "simulation", "controller", "frame_publisher", "recorder")
LIVE = {
    "demo": "perform(['a'], [], 'a', lambda *_: None, lambda: None)",
    "experiment": "list(run_experiment(load_hand('config/hand.yaml'), zeros((1, 11)), 'hand', lambda: None))",
}
"""The nodes of the tool, and the call that makes each: they then wait for a hand."""
IMPORTS = """
from numpy import zeros
from hand_model.description import load_hand
from hand_tool.live_node import perform, run_experiment
"""


def policy(name: str) -> ET.Element:
    return ET.parse(FOLDER / f"{name}.xml").getroot()


def enclave(name: str) -> ET.Element:
    """The enclave of a node."""
    (found,) = policy("client" if name in USES else name).iterfind(f"enclaves/enclave[@path='/hand/{name}']")
    return found


@pytest.mark.parametrize("name", [*NODES, *LIVE, "client"])
def test_a_policy_has_the_form_of_the_schema(name: str) -> None:
    """Fails when SROS2 would refuse a policy, or when it is for other nodes than its file says."""
    root, nodes = policy(name), list(USES) if name == "client" else [name]
    assert problems(root) == []
    assert [each.get("path") for each in root.iter("enclave")] == [f"/hand/{node}" for node in nodes]
    assert [profile.attrib for profile in root.iter("profile")] == [{"ns": "/hand", "node": node} for node in nodes]


def test_every_node_has_a_policy() -> None:
    """Fails when a policy is added or removed without a place in these tests."""
    assert {path.stem for path in FOLDER.iterdir()} == {*NODES, *LIVE, "client"}


def test_every_client_of_the_tool_has_a_policy() -> None:
    """Fails when a command makes a node of a name that no policy has: under SROS2 it could not start."""
    made = {str(inspect.signature(HandClient.__init__).parameters["name"].default)}
    for path in Path("hand_tool").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        made |= {f"hand_{command}" for command in re.findall(r'_client\(namespace, "(\w+)"\)', text)}
        made |= set(re.findall(r'^CLIENT = "(\w+)"$', text, re.M))
    assert made == set(USES)


def _change(root: ET.Element, how: str) -> None:
    profile = next(root.iter("profile"))
    group = profile[0]
    if how == "version":
        root.set("version", "0.1.0")
    elif how == "node":
        del profile.attrib["node"]
    elif how == "verb":
        group.set("write", "ALLOW")
    elif how == "value":
        group.set("publish", "YES")
    elif how == "none":
        group.attrib.clear()
    elif how == "group":
        group.tag = "parameters"
    elif how == "item":
        group[0].tag = "service"
    elif how == "name":
        group[0].text = " "
    elif how == "empty":
        group.clear()
        group.set("publish", "ALLOW")
    else:
        next(root.iter("enclave")).clear()


@pytest.mark.parametrize(
    "how", ["version", "node", "verb", "value", "none", "group", "item", "name", "empty", "enclave"]
)
def test_a_policy_of_another_form_is_refused(how: str) -> None:
    """Fails when the check of the form misses a defect."""
    root = copy.deepcopy(policy("controller"))
    _change(root, how)
    assert problems(root)


def test_the_policies_allow_exactly_what_the_nodes_use(stack: Stack, client: Client) -> None:
    """Fails when a node gains a topic, service or action that its policy denies, or a policy allows an unused one."""
    for topic in ("emergency_stop", "heartbeat"):
        client.node.create_publisher(Empty, topic, 1)  # so that the recorder records it
    stack.node("driver", serial_port="/dev/nothing_here")
    stack.node("simulation", publish_clock="true")
    stack.node("controller", use_sim_time="true", enabled_at_start="false")
    stack.node("frame_publisher")
    for name, call in LIVE.items():  # they wait until there is a recorder
        stack.running.append(subprocess.Popen([sys.executable, "-c", IMPORTS + call], stderr=subprocess.DEVNULL))
        _await(client, name)
    stack.start("recorder", "--ros-args", "-r", "__ns:=/hand", "-p", f"out:={stack.folder / 'all.mcap'}")
    for name in NODES:
        _await(client, name)
    client.spin(1.0)  # a graph that is discovered in part must not pass
    for name in NODES:  # the live nodes have ended: the experiment refuses to run while the controller does
        assert real(client.node, name, "/hand") == allowed(enclave(name)), name
    command = [sys.executable, "-c", CLIENTS.replace("{uses}", repr(USES))]
    clients = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0)
    stack.running.append(clients)
    assert clients.stdin
    with clients.stdin:
        for name in USES:
            _await(client, name)
            clients.stdin.write(b"\n")


def test_hand_record_needs_no_more_than_the_policy_of_the_recorder(stack: Stack, client: Client) -> None:
    """Fails when `hand record` makes a node that has no policy, or that uses what the policy denies."""
    for topic in ("emergency_stop", "heartbeat"):
        client.node.create_publisher(Empty, topic, 1)
    command = [sys.executable, "-m", "hand_tool", "record", "--out", str(stack.folder / "all.mcap"), "--quiet"]
    stack.running.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))
    may = allowed(enclave("recorder"))

    def subscribed() -> set[str]:
        try:
            return real(client.node, "recorder", "/hand")["subscribe"]
        except NodeNameNonExistentError:
            return set()

    client.until(lambda: {"/hand/emergency_stop", "/hand/heartbeat"} <= subscribed())
    client.spin(1.0)  # a graph that is discovered in part must not pass
    have = real(client.node, "recorder", "/hand")
    assert {verb: have[verb] - may[verb] for verb in have if have[verb] - may[verb]} == {}


def _await(client: Client, name: str) -> None:
    """Until the node has what its policy allows; then it must not have more."""
    want = allowed(enclave(name))

    def seen() -> bool:
        names = client.node.get_node_names_and_namespaces()
        try:
            return (name, "/hand") in names and real(client.node, name, "/hand") == want
        except NodeNameNonExistentError:  # it has left the graph between both calls
            return False

    try:
        client.until(seen)
    except AssertionError:
        try:
            have = real(client.node, name, "/hand")
        except NodeNameNonExistentError:
            raise AssertionError(f"the node {name} has not started, or has ended") from None
        denied = {verb: sorted(have[verb] - want[verb]) for verb in have if have[verb] - want[verb]}
        unused = {verb: sorted(want[verb] - have[verb]) for verb in have if want[verb] - have[verb]}
        raise AssertionError(f"config/security, {name}: not allowed {denied}, not used {unused}") from None
