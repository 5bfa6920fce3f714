"""What the commands share: options, progress and loading on demand."""
