"""Result files: schema, writing, lazy reading, checksum, validation."""
