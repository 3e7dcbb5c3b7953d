"""The station: routing between user programs and V2X interfaces, and the commands of the binary."""

VERSION = "0.1.0"
