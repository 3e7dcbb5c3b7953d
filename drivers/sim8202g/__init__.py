"""Driver for the SIMCom SIM8202G-M2, a modem used as a bearer: bring-up, watch and recovery.

Face: driver, options, pin, step.
"""
