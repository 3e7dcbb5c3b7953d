"""Control socket: answers commands of this machine, one JSON line each.

Face: control_socket, question.
"""
