"""What ROS 2's environment variables mean for whom the topics reach."""

import pytest

from limo_hog.ros2.network import LOOPBACK, BusError, network

RANGE, PEERS, ONLY = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"


@pytest.mark.parametrize(
    "environment",
    [{}, {ONLY: "1"}, {RANGE: "LOCALHOST"}, {ONLY: "1", RANGE: "SUBNET", PEERS: "10.0.0.2"}, {RANGE: "", PEERS: " ; "}],
)
def test_messages_stay_on_this_machine_unless_told_otherwise(environment: dict[str, str]) -> None:
    got = network(environment)
    assert got.configuration == LOOPBACK and "on this machine alone" in str(got)


@pytest.mark.parametrize("environment", [{ONLY: "0"}, {RANGE: "SUBNET"}, {ONLY: "0", RANGE: "SUBNET"}])
def test_the_local_network_is_reached_by_multicast(environment: dict[str, str]) -> None:
    got = network(environment)
    assert "<AllowMulticast>true" in str(got.configuration) and "<NetworkInterface" not in str(got.configuration)
    assert str(got) == "ROS domain 0, on the local network"


def test_static_peers_are_asked_beside_the_range() -> None:
    both = network({PEERS: "10.0.0.2; robot<1>", "ROS_DOMAIN_ID": "7"})
    told = ('<Peer address="10.0.0.2"/><Peer address="robot&lt;1&gt;"/>', "<AllowMulticast>true")
    assert all(words in str(both.configuration) for words in told)
    assert str(both) == "ROS domain 7, on the local network and with 10.0.0.2, robot<1>"
    near = str(network({RANGE: "LOCALHOST", PEERS: "10.0.0.2"}).configuration)
    told = ('<Peer address="localhost"/><Peer address="10.0.0.2"/>', "<AllowMulticast>false")
    assert all(words in near for words in told) and "<NetworkInterface" not in near


def test_the_whole_configuration_may_be_cyclone_dds_own() -> None:
    assert network({"CYCLONEDDS_URI": "file:x.xml", ONLY: "1"}).configuration is None
    assert network({RANGE: "SYSTEM_DEFAULT"}).configuration is None


@pytest.mark.parametrize(
    ("name", "value"), [(RANGE, "subnet"), (ONLY, "yes"), *(("ROS_DOMAIN_ID", value) for value in ("233", "x", "-1"))]
)
def test_a_value_that_ros_2_does_not_know_is_refused(name: str, value: str) -> None:
    with pytest.raises(BusError, match=f"{name} is {value!r}"):
        network({name: value})
