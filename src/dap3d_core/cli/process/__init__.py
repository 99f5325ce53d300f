"""The process: exit codes, signals, standard streams."""
