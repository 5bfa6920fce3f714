"""HTML reports with their tables and figures."""
