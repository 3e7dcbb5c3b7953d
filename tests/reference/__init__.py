"""Generator of firmware/reference and of the picture in the documents; written from code."""
