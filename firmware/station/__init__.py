"""Station process: start and stop, interfaces, board, status.

Face: interface_supervisor, signatures, simulation, station, storage.
"""
