"""The status screen of a serial console: 80 columns, 24 lines, 115200 baud, and whoever holds the cable."""
