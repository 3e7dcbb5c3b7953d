"""Chips on I2C: registers to values, by functions over a bus that transfers. They keep nothing between two calls."""
