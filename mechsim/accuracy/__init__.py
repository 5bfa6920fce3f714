"""What accuracy of the mechanics costs in time, and the presets that follow from it."""
