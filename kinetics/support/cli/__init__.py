"""Support for commands: shared options, progress, import on demand."""
