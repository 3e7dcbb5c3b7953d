"""Facilities: the process with the message library, which converts messages between octets and JSON.

The station itself never decodes. It gives this process the JSON of users, and the received messages that users want in
JSON.

Face: child, exchange.
"""
