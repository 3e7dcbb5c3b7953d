"""The box around the station: what its owner writes on the card, and its updates. Run by their own commands only."""
