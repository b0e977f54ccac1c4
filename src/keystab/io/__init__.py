"""Files: pictures, tables, stores of arrays, checksums, and what figures say about themselves."""
