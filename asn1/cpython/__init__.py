"""The Python module captain_messages: C over the message library's tables, and what builds it."""
