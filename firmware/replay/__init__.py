"""What was recorded, sent again: read, chosen, rewritten, paced, through a bad way, to a station or a link."""
