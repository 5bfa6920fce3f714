"""Events observed elsewhere, in a real tank or another simulator: tables as jump paths, and rates from them."""
