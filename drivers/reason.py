"""Drop reasons. Every discarded message is counted under one of them, and a sample of it is kept.

Two sets elsewhere contain some of these reasons. Those in USUAL of firmware/routing/drops.py are logged at level INFO.
Those in LOST of firmware/recorder/triggers.py start a recording.
"""

from enum import StrEnum


class Reason(StrEnum):
    """Reason codes in status, confirms and the journal. MEANING has their meanings; notes are below.

    facilities-busy    at most 1,024 requests and 4 MiB wait. Received messages are counted at the place `json`.
    policy             the row of the policy has `interfaces = []`.
    no-area            an interface carries an area if it has GeoNetworking or reaches all receivers, as `mqtt` does.
    queue-full         the interface is slower than its requests, or `queue` is too small.
    kernel-queue       the kernel counts these drops.
    receive-queue      the process with the radio's library or the MQTT client counts these drops.
    own-echo           another station forwarded the message, or the broker returned it. Copies of own multicasts that
                       the kernel makes are not counted.
    gn-duplicate       the packet has the source, sequence number and payload of an earlier one.
    gn-requests        the requests are those of the Location Service.
    secured-format     `detail` has the cause. The station reads envelopes of TS 103 097 V1.2.1, and of V1.3.1 and later
                       (IEEE 1609.2).
    btp-port           applies to PDUs of any size; `reception.unknown_btp_port` may deliver them.
    retained           a profile may accept retained messages: `accept_retained`.
    subscriber-slow    applies to ports 5556 and 5558. Other subscribers lose nothing.
    connections        the limit is 512 connections in all; it is lower if `ulimit -n` is below 1,280.
    topics             the limits are 512 topics per port from this machine, 32 from another address, and 2,048 in all:
                       the connection with most topics is ended. Subscribers with ZMTP 2.0 (libzmq before 4.0) share 512
                       topics per port.
    unfinished-message  the limits are 64 frames and 327,680 octets.
    subscriber-flood   subscribers of one address may send 163,840 octets at once and 4,096 octets per second, without
                       heartbeats. Beyond that, a connection that has sent more than 1,024 octets is ended.
    subscriber-cut     the limits are 32,768 waiting messages per port, and 8,192 per subscriber.
    """

    BAD_ENVELOPE = "bad-envelope"
    ONE_FRAME = "one-frame"
    BAD_OPTIONS = "bad-options"
    BAD_JSON = "bad-json"
    FACILITIES_BUSY = "facilities-busy"
    FACILITIES_RESTARTING = "facilities-restarting"
    NO_LIBRARY = "no-library"
    UNKNOWN_TYPE = "unknown-type"
    NO_PORT = "no-port"
    NO_INTERFACE = "no-interface"
    POLICY = "policy"
    RATE_LIMIT = "rate-limit"
    NO_AREA = "no-area"
    HEADER_MISMATCH = "header-mismatch"
    EMPTY_PDU = "empty-pdu"
    SHORT_PDU = "short-pdu"
    LONG_PDU = "long-pdu"
    QUEUE_FULL = "queue-full"
    EXPIRED = "expired"
    LINK_DOWN = "link-down"
    SEND_FAILED = "send-failed"
    NO_SUBSCRIBER = "no-subscriber"
    STOPPED = "stopped"
    KERNEL_QUEUE = "kernel-queue"
    RECEIVE_QUEUE = "receive-queue"
    DUPLICATE = "duplicate"
    OWN_ECHO = "own-echo"
    TRUNCATED = "truncated"
    NOT_GEONETWORKING = "not-geonetworking"
    GN_VERSION = "gn-version"
    GN_HEADER = "gn-header"
    GN_LIFETIME = "gn-lifetime"
    GN_HOP_LIMIT = "gn-hop-limit"
    GN_DUPLICATE = "gn-duplicate"
    GN_OUTSIDE_AREA = "gn-outside-area"
    GN_NOT_FOR_US = "gn-not-for-us"
    GN_REQUESTS = "gn-requests"
    GN_NEXT_HEADER = "gn-next-header"
    OWN_ADDRESS = "own-address"
    IMPLAUSIBLE = "implausible"
    SECURED = "secured"
    SECURED_FORMAT = "secured-format"
    BTP_PORT = "btp-port"
    FRAMING = "framing"
    CHECKSUM = "checksum"
    RAW_FORMAT = "raw-format"
    TOPIC = "topic"
    PAYLOAD = "payload"
    RETAINED = "retained"
    SUBSCRIBER_SLOW = "subscriber-slow"
    DELIVERY_LIMIT = "delivery-limit"
    CONNECTIONS = "connections"
    TOPICS = "topics"
    UNFINISHED = "unfinished-message"
    SUBSCRIBER_FLOOD = "subscriber-flood"
    SUBSCRIBER_CUT = "subscriber-cut"


# Groups of reasons by the place of the drop. A group starts at the reason named here, in the order of Reason.
GROUPS = {
    "From users": Reason.BAD_ENVELOPE,
    "From either side": Reason.EMPTY_PDU,
    "In the queue of an interface": Reason.QUEUE_FULL,
    "From an interface": Reason.KERNEL_QUEUE,
    "To users": Reason.SUBSCRIBER_SLOW,
    "Connections of the endpoint": Reason.CONNECTIONS,
}

MEANING: dict[Reason, str] = {
    Reason.BAD_ENVELOPE: "the first frame is neither `v2x.` nor `v2x.<type>.` of a known type; mind case and dot",
    Reason.ONE_FRAME: "the message has one frame; send two, the envelope and the PDU",
    Reason.BAD_OPTIONS: "the third frame is not a JSON object of known options; `detail` names the mistake",
    Reason.BAD_JSON: "the second frame is not the JSON of a message; `invalid` of the confirm lists all its faults",
    Reason.FACILITIES_BUSY: "more JSON than the facilities process converts",
    Reason.FACILITIES_RESTARTING: "the facilities process, which converts JSON, died; it starts again",
    Reason.NO_LIBRARY: "this program has no message library, which converts JSON; `make codec` builds it",
    Reason.UNKNOWN_TYPE: "messageID (second octet of the PDU) is in no table; add a row [[types]] to captain.toml",
    Reason.NO_PORT: "this type has no BTP port in the profile in use; choose profile standard or add a row [[types]]",
    Reason.NO_INTERFACE: "no interface that the policy or the user names for it exists and transmits",
    Reason.POLICY: "a row of the policy says that this message leaves by no interface",
    Reason.RATE_LIMIT: "more of these per second than the policy's row allows",
    Reason.NO_AREA: "the interface cannot carry a destination area; choose mqtt or one with GeoNetworking, or leave it",
    Reason.EMPTY_PDU: "the PDU has no octets",
    Reason.SHORT_PDU: "the PDU is shorter than the 6 octets of an ITS PDU header",
    Reason.LONG_PDU: "the PDU is longer than 1500 octets, or than what the interface carries",
    Reason.HEADER_MISMATCH: "the envelope and the PDU's messageID disagree, and endpoint.strict is on",
    Reason.QUEUE_FULL: "the interface's queue was full; the oldest of the lowest priority went out first",
    Reason.EXPIRED: "it waited in the interface's queue for longer than its lifetime",
    Reason.LINK_DOWN: "the interface's link was down for the rest of its lifetime",
    Reason.SEND_FAILED: "the interface took it and then reported a failure",
    Reason.NO_SUBSCRIBER: "interface processes are there, but none is subscribed to this type",
    Reason.STOPPED: "the station stopped before it was sent",
    Reason.KERNEL_QUEUE: "the kernel's receive queue was full: more arrives than the station can take",
    Reason.RECEIVE_QUEUE: "the queue of the radio's process was full: more arrives than the station can take",
    Reason.DUPLICATE: "another interface delivered this PDU first",
    Reason.OWN_ECHO: "the station's own frame came back",
    Reason.TRUNCATED: "it ends before its headers do",
    Reason.NOT_GEONETWORKING: "the frame's EtherType is not 0x8947",
    Reason.GN_VERSION: "its GeoNetworking protocol version is not accepted; see reception.gn_versions",
    Reason.GN_HEADER: "its GeoNetworking headers contradict themselves or the standard",
    Reason.GN_LIFETIME: "its GeoNetworking lifetime is zero or over",
    Reason.GN_HOP_LIMIT: "its remaining hop limit is zero or above its maximum",
    Reason.GN_DUPLICATE: "this GeoNetworking packet was received before",
    Reason.GN_OUTSIDE_AREA: "the station is outside the packet's destination area",
    Reason.GN_NOT_FOR_US: "the packet is addressed to another station, or carries no message for a user",
    Reason.GN_REQUESTS: "more requests for the station's position than the 10 per second that it answers",
    Reason.GN_NEXT_HEADER: "the header after the GeoNetworking headers is not BTP",
    Reason.OWN_ADDRESS: "beacon or request of another station that has this station's address; change one of the two",
    Reason.IMPLAUSIBLE: "implausible message, dropped by a row of the policy (match.implausible)",
    Reason.SECURED: "it is signed, signatures are not verified yet, and reception.unverified is drop",
    Reason.SECURED_FORMAT: "its security envelope is encrypted or cannot be read",
    Reason.BTP_PORT: "its BTP port carries no known type of message; add a row [[types]] to captain.toml",
    Reason.FRAMING: "octets between two frames on a serial line, or a frame of impossible length",
    Reason.CHECKSUM: "the frame's checksum does not match",
    Reason.RAW_FORMAT: "a message of an interface process is not a RawRxMessage in one frame",
    Reason.TOPIC: "the broker sent a topic that is outside the profile's templates",
    Reason.PAYLOAD: "its payload is not of the form that the profile of the broker has, or above 64 KiB",
    Reason.RETAINED: "the broker had retained it; its age is unknown",
    Reason.DELIVERY_LIMIT: "over 8,000 messages of a type in a second; topic `message.` has no more; port 5556 has",
    Reason.SUBSCRIBER_SLOW: "a subscriber fell behind; it alone loses messages until it has read half of its queue",
    Reason.CONNECTIONS: "too many connections; of the address with most, the oldest unused one was ended",
    Reason.TOPICS: "a subscriber has too many topics, or one of more than 256 octets; its connection was ended",
    Reason.UNFINISHED: "a message has too many octets or frames and does not end; its connection was ended",
    Reason.SUBSCRIBER_FLOOD: "a subscriber sends more than subscriptions need; its connection was ended",
    Reason.SUBSCRIBER_CUT: "subscribers that do not read have too many messages waiting; the slowest was ended",
}
