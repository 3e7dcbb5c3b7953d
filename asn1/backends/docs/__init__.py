"""Output format docs: one Markdown page per message.

Face: form, pages, wording.
"""
