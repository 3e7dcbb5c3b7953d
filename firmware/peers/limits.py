"""Limits for peers of the endpoint: connections, topics, octets of messages, descriptors."""

import resource

# Connections of the four ports together. An idle one costs 45 kB.
CONNECTIONS = 512
# Descriptors for all that is no connection of a peer: interfaces, processes, libzmq's own. A connection has two.
RESERVED = 256
# Descriptors that the station asks for: select(), which a vendor's library may use in its process, is not affected.
DESCRIPTORS = 16_384

# Octets of a topic. The longest that the station sends is `indication.` with the name of a type.
TOPIC = 256
# Topics of one socket: of this machine, of each other address, and in total. A topic costs 80 octets per letter.
TOPICS_LOCAL, TOPICS_OUTSIDE, TOPICS_TOTAL = 512, 32, 2048
# Octets of a message from a subscriber: a topic, or the handshake with its metadata.
SUBSCRIBER_MESSAGE = 1024

# Octets that libzmq may have read from one connection since its last message that ended: three frames of 64 KiB, and
# as much as libzmq reads at once.
UNFINISHED = 5 * 65_536
# Heartbeats of ZMTP are no messages: octets a second that are not counted.
HEARTBEATS = 64.0

# Messages that wait for one subscriber; a second of a full channel, four times over, and 4 MB.
QUEUE = 8192
# Messages that wait for subscribers whose connections take nothing, all of a socket together.
WAITING = 4 * QUEUE

# ZMTP's heartbeat ends connections of machines that have lost their power, and of programs that never answer.
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 10_000, 30_000


def raise_descriptors() -> None:
    """Raise the soft limit of descriptors to the hard one: systemd's default of 1024 is for programs that select()."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def most_connections() -> int:
    """Connections that the limit of descriptors leaves room for, at most CONNECTIONS."""
    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if soft == resource.RLIM_INFINITY:
        return CONNECTIONS
    return max(16, min(CONNECTIONS, (soft - RESERVED) // 2))
