"""Text, tables and figures of a trace."""
