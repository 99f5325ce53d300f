"""Adams methods of order 1 to 12."""
