"""Readers of foreign formats; they run in a disposable process and know nothing of mappings."""
