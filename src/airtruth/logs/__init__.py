"""Flight logs: arrays and metadata in memory, structural validation, the Parquet store."""
