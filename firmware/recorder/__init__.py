"""A station's recorder: it hears frames, writes them down, and keeps what was before an event."""
