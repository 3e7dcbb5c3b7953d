"""Messages decoded, encoded and explained: what stands between the message library and a person."""
