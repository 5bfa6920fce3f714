"""What every room uses and none owns: arrays, files, memory, plots and tables."""
