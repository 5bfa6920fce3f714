"""Commands of the kinetics, one file each; `wellmixed.py` mounts them."""
