"""Commands of the mechanics, one file each; `wellmixed` mounts them."""
