"""Limits for peers of the endpoint: connections, topics, octets of messages, descriptors."""

import resource

# Number of connections of the four ports together. An idle connection costs 45 kB.
CONNECTIONS = 512
# Number of descriptors for everything except connections of peers: interfaces, processes, libzmq. A connection needs
# two descriptors.
RESERVED = 256
# Limit of descriptors that the station requests. It does not affect select() in a vendor's library, which runs in its
# own process.
DESCRIPTORS = 16_384

# Octets of a topic. The longest that the station sends is `indication.` with the name of a type.
TOPIC = 256
# Number of topics to which a socket may have subscribers: from this machine, from each other address, and in total. A
# topic costs 80 octets of memory per letter.
TOPICS_LOCAL, TOPICS_OUTSIDE, TOPICS_TOTAL = 512, 32, 2048
# Longest message of a subscriber in octets: a subscription with its topic, or the handshake with its metadata.
SUBSCRIBER_MESSAGE = 1024

# Octets that libzmq may have read from one connection since its last complete message: three frames of 64 KiB, and
# one read of libzmq.
UNFINISHED = 5 * 65_536
# Allowance for ZMTP heartbeats, which are not messages: octets per second that are not counted.
HEARTBEATS = 64.0

# Number of messages that may wait for one subscriber: four seconds of a full channel, 4 MB.
QUEUE = 8192
# Number of messages that may wait for the stalled subscribers of a socket together.
WAITING = 4 * QUEUE

# ZMTP heartbeats in milliseconds: interval and timeout. They end connections to machines without power and to programs
# that do not answer.
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 10_000, 30_000


def raise_descriptors() -> None:
    """Raise the soft limit of descriptors to DESCRIPTORS, or to the hard limit if that is lower.

    systemd's default of 1024 is for programs that use select().
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def most_connections() -> int:
    """Return the number of connections that the limit of descriptors allows, at most CONNECTIONS."""
    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if soft == resource.RLIM_INFINITY:
        return CONNECTIONS
    return max(16, min(CONNECTIONS, (soft - RESERVED) // 2))
