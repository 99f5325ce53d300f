"""From a type to its compiled group loops: kernel arguments, storage layout, loop source."""
