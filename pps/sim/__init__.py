"""Simulated pulse path with known true time: crystal, temperature, clocks, interrupts.

pps never imports this folder: an estimator must not know the simulated truth. True time is ITS time in ns.
"""
