"""A back end's side of a broker: what a fleet publishes, taken by as many copies as it needs, shown and recorded."""
