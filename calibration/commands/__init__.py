"""Commands that know all three rooms, one file each; `wellmixed` mounts them."""
