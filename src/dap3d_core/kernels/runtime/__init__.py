"""Around compiled code: its cache, function tables, structs of arrays, generated modules."""
