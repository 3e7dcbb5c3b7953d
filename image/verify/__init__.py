"""A finished card, compared with its description.

Face: card.
"""
