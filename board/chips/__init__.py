"""I2C chips: functions without state that convert registers to values.

Face: power, eeprom, expander, temperature.
"""
