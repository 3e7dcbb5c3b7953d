"""AT commands of a modem: port core, lines, forms of answers and their parsers.

Face: port, fields, forms, answers.
"""
