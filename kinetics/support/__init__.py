"""Support used by all packages: arrays, files, memory, plots, tables and the command line."""
