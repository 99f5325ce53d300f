"""What commands share: options, paths, execution, error messages, completion."""
