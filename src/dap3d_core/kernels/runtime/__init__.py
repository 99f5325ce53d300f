"""Runtime of compiled code: cache, function tables, structs of arrays, generated modules."""
