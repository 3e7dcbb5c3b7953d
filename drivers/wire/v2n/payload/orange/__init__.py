"""JSON form of payloads of Orange's its-client 2.x.

Face: envelope.
"""
