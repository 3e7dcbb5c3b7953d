"""Parts of a card: boot partition, kernel, early boot, device tree, root.

Face: boot, device_tree, initrd, kernel, root, slot_names.
"""
