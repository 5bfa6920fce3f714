"""First times against any setting of a scene, as in section V of the paper."""
