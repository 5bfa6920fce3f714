"""What others observed, in a real tank or another simulator: their tables as jump paths, and the rates these give."""
