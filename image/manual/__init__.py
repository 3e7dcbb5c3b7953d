"""Man pages and shell completion of captain, from the parsers of its command line."""
