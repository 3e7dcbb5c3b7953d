"""The link meter: what became of each message between stations, matched by what stations say of it themselves."""
