"""Reports for people: HTML, tables and figures."""
