"""The commands of calibration, one file each; `wellmixed` mounts them."""
