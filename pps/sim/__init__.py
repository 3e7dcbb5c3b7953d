"""What a pulse comes through, with the truth known: a crystal, its temperature, the machine's clocks, interrupts.

Nothing of pps imports this folder: what judges a clock cannot know how it was made. True time is ITS time in ns.
"""
