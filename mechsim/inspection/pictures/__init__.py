"""Pictures, films and interactive views of runs."""
