"""Support for all rooms: arrays, files, memory, plots, tables and the command line."""
