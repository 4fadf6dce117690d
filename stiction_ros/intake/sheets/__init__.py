"""Tables in files: text, packed text, workbooks, Parquet; read a piece at a time."""
