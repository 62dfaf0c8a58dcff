"""Which machines the topics reach, by ROS 2's environment variables; this machine alone where none is set.

CYCLONEDDS_URI is Cyclone DDS's own configuration and replaces all of them but ROS_DOMAIN_ID.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from limo_hog.exceptions import LimoHogError

RANGE, PEERS, LOCALHOST_ONLY = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"
RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")


class BusError(LimoHogError):
    """The ROS 2 network cannot be used as asked, or no camera image comes over it."""


@dataclass(frozen=True, slots=True)
class Network:
    """What a participant may reach."""

    domain: int  #: The ROS domain.
    reach: str  #: In words, for messages.
    configuration: str | None  #: Cyclone DDS's, as XML; None where that is the environment's or the library's own.

    def __str__(self) -> str:
        return f"ROS domain {self.domain}, {self.reach}"


def network(environment: Mapping[str, str]) -> Network:
    """Read the environment as ROS 2 Jazzy and Humble do.

    Raises `BusError` if ROS_DOMAIN_ID is no domain, or a variable has a value that ROS 2 does not know.
    """
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > 232:
        raise BusError(f"ROS_DOMAIN_ID is {text!r}; wanted is a number from 0 to 232")
    domain = int(text)
    if environment.get("CYCLONEDDS_URI"):
        return Network(domain, "as CYCLONEDDS_URI says", None)
    said, only = environment.get(RANGE, ""), environment.get(LOCALHOST_ONLY, "")
    peers = [peer.strip() for peer in environment.get(PEERS, "").split(";") if peer.strip()]
    if said not in ("", *RANGES):
        raise BusError(f"{RANGE} is {said!r}; wanted is one of {', '.join(RANGES)}")
    if only not in ("", "0", "1"):
        raise BusError(f"{LOCALHOST_ONLY} is {only!r}; wanted is 0 or 1")
    if only == "1":
        # As in Jazzy, Humble's variable stands above the newer two.
        return Network(domain, f"on this machine alone, as {LOCALHOST_ONLY} says", LOOPBACK)
    if not (said or only or peers):
        return Network(domain, f"on this machine alone ({RANGE}=SUBNET opens the network)", LOOPBACK)
    said = said or "SUBNET"
    if said == "SYSTEM_DEFAULT":
        return Network(domain, "as Cyclone DDS is built", None)
    if said == "OFF":
        return Network(domain, f"with nobody, as {RANGE}=OFF says", _configuration([], multicast=False, alone=True))
    also = f" and with {', '.join(peers)}" if peers else ""
    if said == "SUBNET":
        return Network(domain, f"on the local network{also}", _configuration(peers, multicast=True))
    if not peers:
        return Network(domain, f"on this machine alone, as {RANGE} says", LOOPBACK)
    return Network(domain, f"on this machine{also}", _configuration(["localhost", *peers], multicast=False))


def _configuration(peers: Sequence[str], *, multicast: bool, interface: str | None = None, alone: bool = False) -> str:
    """Return Cyclone DDS's configuration.

    Fragments are as long as UDP allows: an image of 0.9 MB in 690 short ones loses too many where the reader is Fast
    DDS with its small socket buffer, and one of its requests for what was lost names 256 at most. It asks when a
    heartbeat comes; the one that goes with the last fragment is often lost, too, and the next must not be 0.1 s later.
    The addresses of peers are tried for as long as it runs: Fast DDS does not find us by itself on loopback.
    """
    interfaces = f"<Interfaces><NetworkInterface address={quoteattr(interface)}/></Interfaces>" if interface else ""
    return f"""
<CycloneDDS><Domain id="any">
  <General>
    {interfaces}
    <AllowMulticast>{str(multicast).lower()}</AllowMulticast>
    <MaxMessageSize>65500B</MaxMessageSize>
    <FragmentSize>65000B</FragmentSize>
  </General>
  <Internal><HeartbeatInterval minsched="10ms">10ms</HeartbeatInterval></Internal>
  <Discovery>
    <InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <SPDPInterval>1s</SPDPInterval>
    <Peers>{"".join(f"<Peer address={quoteattr(peer)}/>" for peer in peers)}</Peers>
    {"<Tag>limo_hog_alone</Tag>" if alone else ""}
  </Discovery>
</Domain></CycloneDDS>
"""


#: Discovery by unicast to this machine's own ports: loopback has no multicast.
LOOPBACK = _configuration(["127.0.0.1"], multicast=False, interface="127.0.0.1")
