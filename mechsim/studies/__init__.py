"""First-passage times as functions of the settings of a scene, as in section V of the paper."""
