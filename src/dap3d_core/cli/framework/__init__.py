"""Framework of the commands: options, paths, execution, error messages, completion."""
