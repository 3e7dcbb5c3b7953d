"""Messages of users: what is asked for, files and imports. Face: wish, files, imports, identifier, announced."""
