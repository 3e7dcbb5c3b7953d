"""A user's side of a station: its sockets, what goes and comes over them, and how people are shown it."""
