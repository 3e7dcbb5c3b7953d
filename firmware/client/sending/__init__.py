"""Sending of PDUs by a user: input from text and files, pace, confirms.

Face: account, flights, json_texts, payload, sending.
"""
