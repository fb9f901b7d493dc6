"""The flight log: arrays and metadata, validated once at the border, and its Parquet store."""
