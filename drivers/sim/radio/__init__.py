"""Simulated SOM301-E: a library with the vendor's calls. It sends and receives UDP datagrams in place of the air.

Each datagram is a whole Ethernet frame with GeoNetworking, as of the `udp` interface with framing ethernet. The far end
may be that interface, another simulated radio, or Vanetza's tools. The library reads its settings from the environment
variable CAPTAIN_SIM_RADIO, and they can be changed while it runs. settings.h describes them.

Face: control.
"""
