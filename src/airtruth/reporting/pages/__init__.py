"""HTML pages of results, one module per kind of result."""
