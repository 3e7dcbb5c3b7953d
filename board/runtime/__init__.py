"""Runtime of every program: event loop, child processes, errors, files, logs; no hardware."""
